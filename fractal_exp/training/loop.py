"""The loop that trains a network: batches that depend on their number alone, a look at held-out data now and then, the
best state kept."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

import torch
from pydantic import BaseModel, Field, field_validator
from torch import Tensor, nn

from ..errors import InputError
from ..methods.base import FitDiverged, OnStep, Progress, check_device
from ..runtime.checkpoint import Checkpoint, Snapshot, moments
from ..runtime.deadline import Deadline
from ..runtime.params import Amount, Count, Params, Positive

Batch = tuple[Tensor, ...]


class Recipe(Params):
    """What every training has."""

    batch: Positive = 32
    """Pictures in a batch."""
    rate: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1e-3
    """Learning rate of Adam at first."""
    weight_decay: Amount = 0.0
    """Weight decay of Adam."""
    held_out: Positive = 512
    """Codes that are held out."""


class Training(ABC):
    """What the loop asks of one network's training. A batch depends on the recipe, the seed and its number alone.

    seed: of every random number; options: the fields of `Params`. Raises `InputError` on values out of range.
    """

    Params: ClassVar[type[Recipe]]

    def __init__(self, *, seed: int = 0, **options: Any):
        if seed < 0:
            raise InputError(f"seed must be at least 0, got {seed}")
        self.params, self.seed = self.Params().updated(**options), seed

    @property
    @abstractmethod
    def steps(self) -> int:
        """The budget."""

    @property
    @abstractmethod
    def every(self) -> int:
        """Steps from one look at the held-out data to the next."""

    @property
    def patience(self) -> int | None:
        """Looks in a row that find nothing better, after which the training stops; None: it does not."""
        return None

    @property
    def keeps_best(self) -> bool:
        """Whether the state with the least held-out loss is the result; else the last one."""
        return True

    def recipe(self) -> dict[str, Any]:
        """All that the training depends on, as plain data."""
        return self.params.model_dump(mode="json") | {"seed": self.seed}

    @abstractmethod
    def network(self) -> nn.Module:
        """The network with its first weights, on the CPU."""

    def optimizer(self, network: nn.Module) -> torch.optim.Optimizer:
        """Adam; where the weights decay, by their gradient."""
        return torch.optim.Adam(network.parameters(), self.params.rate, weight_decay=self.params.weight_decay)

    @abstractmethod
    def rate(self, step: int) -> float:
        """The learning rate of a step."""

    @abstractmethod
    def batch(self, step: int) -> Batch:
        """What a step learns from, on the CPU."""

    @abstractmethod
    def loss(self, network: nn.Module, batch: Batch) -> Tensor:
        """What is lowered."""

    @abstractmethod
    def judge(self, network: nn.Module, device: str) -> dict[str, float]:
        """The scores on held-out data: `held_out`, lower is better, and others under names of their own."""


@dataclass(frozen=True)
class Trained:
    """The tensors of the network, its scores on held-out codes, and why the training stopped, in words."""

    tensors: Mapping[str, Tensor]
    scores: dict[str, float]
    stopped: str


def train(training: Training, *, device: str = "cpu", seconds: float | None = None, on_step: OnStep | None = None,
          checkpoint: Checkpoint | None = None) -> Trained:
    """Train a network. The same training gives the same weights on one machine with one number of threads, also if it
    was interrupted and resumed from its checkpoint.

    seconds: a limit after which the best state so far is returned. Raises `InputError` on a device that there is not or
    a checkpoint that does not fit, and `FitDiverged` if the loss is no longer finite.
    """
    network, deadline = training.network().to(check_device(device)), Deadline(seconds)
    state = State(network, training.optimizer(network))
    if checkpoint and (saved := checkpoint.load()):
        state.restore(saved)
        if state.done >= training.steps and not state.best:
            raise InputError(f"the checkpoint tells of {state.done} steps and of no look at the held-out data; start "
                             "afresh with resume=false")
    first, latest = state.done, state.scores
    stopped = f"all {training.steps} steps done"
    while state.done < training.steps:
        if checkpoint and state.done > first and state.done % checkpoint.every == 0:
            checkpoint.save(state.snapshot())
        for group in state.optimizer.param_groups:
            group["lr"] = training.rate(state.done)
        batch = tuple(part.to(device) for part in training.batch(state.done))
        loss = training.loss(network.train(), batch)
        state.optimizer.zero_grad()
        loss.backward()
        state.optimizer.step()
        state.done += 1
        value = float(loss.detach())
        if not math.isfinite(value):
            raise FitDiverged(f"step {state.done} of the training met a NaN or an infinity; take a lower rate")
        late = deadline.passed
        if state.done % training.every == 0 or state.done == training.steps or late:
            with torch.no_grad():
                latest = training.judge(network.eval(), device)
            state.look(latest, training.keeps_best)
        if on_step:
            on_step(Progress(state.done, min(1.0, max(state.done / training.steps, deadline.used)),
                             {"loss": value, **latest}, stage=f"step {state.done} of {training.steps}"))
        if late:
            stopped = f"the time limit of {seconds:g} s was reached after {state.done} steps"
            break
        if training.patience is not None and state.stale >= training.patience:
            stopped = f"{state.stale} looks in a row found nothing better, after {state.done} steps"
            break
    return Trained({name: value.cpu() for name, value in state.best.items()}, state.scores, stopped)


class Numbers(BaseModel):
    """The numbers of a checkpoint: the scores of the best look, and the looks since then."""

    scores: dict[str, float]
    stale: Count

    @field_validator("scores")
    @classmethod
    def _tell_of_held_out_data(cls, scores: dict[str, float]) -> dict[str, float]:
        if scores and "held_out" not in scores:
            raise ValueError("the score held_out is missing")
        return scores


@dataclass
class State:
    """All that a training needs to go on, and thus what a checkpoint holds: the network and its optimiser, the steps
    done, the tensors and scores of the best look at the held-out data, and the looks since then."""

    network: nn.Module
    optimizer: torch.optim.Optimizer
    done: int = 0
    best: dict[str, Tensor] = field(default_factory=dict)
    scores: dict[str, float] = field(default_factory=dict)
    stale: int = 0

    def look(self, scores: dict[str, float], keeps_best: bool) -> None:
        """Keep the network as it is now with its scores, if they are the best, or only the last ones count."""
        better = not self.scores or scores["held_out"] < self.scores["held_out"]
        self.stale = 0 if better else self.stale + 1
        if better or not keeps_best:
            self.scores = scores
            self.best = {name: value.detach().clone() for name, value in self.network.state_dict().items()}

    def snapshot(self) -> Snapshot:
        """It as a checkpoint."""
        tensors = {f"network/{name}": value for name, value in self.network.state_dict().items()}
        tensors |= {f"best/{name}": value for name, value in self.best.items()}
        for number, values in self.optimizer.state_dict()["state"].items():
            tensors |= {f"optimizer/{number}/{name}": value for name, value in values.items()}
        return Snapshot(self.done, tensors, {"scores": self.scores, "stale": self.stale})

    def restore(self, saved: Snapshot) -> None:
        """Go back to a checkpoint. Raises `InputError` if it is of another training."""
        numbers = saved.checked(Numbers)
        parts = {"network": self.network.state_dict()} | ({"best": self.network.state_dict()} if numbers.scores else {})
        if saved.holds("optimizer/"):
            parts["optimizer"] = moments({str(i): value for i, value in enumerate(self.network.parameters())})
        tensors = saved.like({f"{part}/{name}": value for part, of in parts.items() for name, value in of.items()})
        kept = {part: {name: tensors[f"{part}/{name}"] for name in of} for part, of in parts.items()}
        for name, own in parts["network"].items():  # tables of positions are no weights: nothing trains them
            if not own.is_floating_point() and own.ndim and not all(
                    torch.equal(kept[part][name], own) for part in ("network", "best") if part in kept):
                raise InputError(f"the checkpoint has another {name}, which no training changes; start afresh with "
                                 "resume=false")
        adam: dict[int, dict[str, Tensor]] = {}
        for name, value in kept.get("optimizer", {}).items():
            number, _, key = name.partition("/")
            adam.setdefault(int(number), {})[key] = value
        self.network.load_state_dict(kept["network"])
        self.optimizer.load_state_dict({"state": adam, "param_groups": self.optimizer.state_dict()["param_groups"]})
        self.best = kept.get("best", {})
        self.done, self.scores, self.stale = saved.iteration, numbers.scores, numbers.stale
