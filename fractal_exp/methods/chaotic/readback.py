"""Steps whose numbers are still on the device: they are fetched together, so that a GPU seldom has to be waited for."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import torch
from torch import Tensor

from .model import ForwardModel, Parameters
from .optimizers import Step

STEPS = {"cpu": 1}  # by the kind of device; a step on the CPU has its numbers at once
STEPS_ELSEWHERE = 32


def steps_at_a_time(device: str) -> int:
    """How many steps may wait before their numbers are fetched."""
    return STEPS.get(torch.device(device).type, STEPS_ELSEWHERE)


@dataclass(frozen=True)
class Numbers:
    """What a step came to: its loss and terms, whether they and the parameters that it led to are finite, and whether
    the parameters that it scored are contractive (None if they were not looked at, beyond the first bad step)."""

    step: Step
    iteration: int
    fraction: float
    temperature: float
    loss: float
    terms: dict[str, float]
    finite: bool
    contractive: bool | None

    def scalars(self) -> dict[str, float]:
        """By name, as `Progress` has them."""
        accepted = {} if self.step.accepted is None else {"accepted": self.step.accepted}
        return {"loss": self.loss, "temperature": self.temperature, **self.terms, **accepted}


@dataclass
class Pending:
    """The steps since numbers were last fetched."""

    steps: list[tuple[Step, int, float, float]] = field(default_factory=list)

    def __len__(self) -> int:
        return len(self.steps)

    def add(self, step: Step, iteration: int, fraction: float, temperature: float) -> None:
        """`fraction` of the run is done with this step, the one of number `iteration`."""
        self.steps.append((step, iteration, fraction, temperature))

    def fetch(self, model: ForwardModel, raw: Parameters) -> list[Numbers]:
        """The numbers of all steps, of which none is left, in their order; `raw` is what the last one led to."""
        entries, self.steps = self.steps, []
        steps = [entry[0] for entry in entries]
        scored = {name: torch.stack([step.raw[name] for step in steps]) for name in steps[0].raw}
        led_to = torch.cat([torch.cat([value[1:], raw[name].detach()[None]]).flatten(1)
                            for name, value in scored.items()], 1)
        names = list(steps[0].terms)
        table = torch.stack([torch.stack([step.loss, *(step.terms[name] for name in names),
                                          finite.to(step.loss.dtype)])
                             for step, finite in zip(steps, led_to.isfinite().all(1), strict=True)]).tolist()
        good = [bool(finite) and math.isfinite(loss) for loss, *_, finite in table]
        sound = good.index(False) if False in good else len(good)  # a singular value decomposition raises on NaN
        contractive = [*_flags(model, {name: value[:sound] for name, value in scored.items()}),
                       *[None] * (len(good) - sound)]
        return [Numbers(*entry, loss, dict(zip(names, terms, strict=True)), finite, shrinks)
                for entry, (loss, *terms, _), finite, shrinks in zip(entries, table, good, contractive, strict=True)]


def _flags(model: ForwardModel, scored: dict[str, Tensor]) -> list[bool]:
    count = len(next(iter(scored.values())))
    return model.is_contractive(scored).tolist() if count else []
