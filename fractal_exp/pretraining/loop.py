"""The loop that trains a network: batches that depend on their number alone, a look at held-out data now and then, the
best state kept."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import torch
from pydantic import Field
from torch import Tensor, nn

from ..errors import InputError
from ..methods.base import FitDiverged, OnStep, Progress, check_device
from ..methods.pretrained import Pretrained
from ..runtime.checkpoint import Checkpoint, Snapshot
from ..runtime.deadline import Deadline
from ..runtime.params import Amount, Params, Positive

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
    """One network's training. A batch depends on the recipe, the seed and its number alone.

    seed: of every random number; options: the fields of `Params`. Raises `InputError` on values out of range.
    """

    method: ClassVar[type[Pretrained]]  # what the network is for
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
    def errors(self, network: nn.Module, device: str) -> dict[str, Tensor]:
        """The loss on each held-out code (B,) as `held_out`, and that of a trivial answer under a name of its own."""

    def judge(self, network: nn.Module, device: str) -> dict[str, float]:
        """The means of `errors`."""
        return {name: float(values.double().mean()) for name, values in self.errors(network, device).items()}


@dataclass(frozen=True)
class Trained:
    """The tensors of the network, its scores on held-out codes, and why the training stopped, in words."""

    tensors: Mapping[str, Tensor]
    scores: dict[str, float]
    stopped: str


@dataclass
class _Best:
    """The least held-out loss so far, the scores of then, and the looks since."""

    scores: dict[str, float]
    tensors: dict[str, Tensor]
    stale: int = 0

    def look(self, network: nn.Module, scores: dict[str, float], keeps_best: bool) -> None:
        better = not self.scores or scores["held_out"] < self.scores["held_out"]
        self.stale = 0 if better else self.stale + 1
        if better or not keeps_best:
            self.scores, self.tensors = scores, {name: value.detach().clone()
                                                 for name, value in network.state_dict().items()}


def train(training: Training, *, device: str = "cpu", seconds: float | None = None, on_step: OnStep | None = None,
          checkpoint: Checkpoint | None = None) -> Trained:
    """Train a network. The same training gives the same weights on one machine with one number of threads, also if it
    was interrupted and resumed from its checkpoint.

    seconds: a limit after which the best state so far is returned. Raises `InputError` on a device that there is not or
    a checkpoint that does not fit, and `FitDiverged` if the loss is no longer finite.
    """
    network = training.network().to(check_device(device))
    optimizer, deadline = training.optimizer(network), Deadline(seconds)
    best = _Best({}, {})
    first = done = _resume(network, optimizer, best, checkpoint)
    latest = dict(best.scores)
    stopped = f"all {training.steps} steps done"
    while done < training.steps:
        if checkpoint and done > first and done % checkpoint.every == 0:
            checkpoint.save(_snapshot(network, optimizer, best, done))
        for group in optimizer.param_groups:
            group["lr"] = training.rate(done)
        batch = tuple(part.to(device) for part in training.batch(done))
        loss = training.loss(network.train(), batch)
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        done += 1
        value = float(loss.detach())
        if not math.isfinite(value):
            raise FitDiverged(f"step {done} of the training met a NaN or an infinity; take a lower rate")
        late = deadline.passed
        if done % training.every == 0 or done == training.steps or late:
            with torch.no_grad():
                latest = training.judge(network.eval(), device)
            best.look(network, latest, training.keeps_best)
        if on_step:
            on_step(Progress(done, min(1.0, max(done / training.steps, deadline.used)), {"loss": value, **latest},
                             stage=f"step {done} of {training.steps}"))
        if late:
            stopped = f"the time limit of {seconds:g} s was reached after {done} steps"
            break
        if training.patience is not None and best.stale >= training.patience:
            stopped = f"{best.stale} looks in a row found nothing better, after {done} steps"
            break
    return Trained({name: value.cpu() for name, value in best.tensors.items()}, best.scores, stopped)


def _snapshot(network: nn.Module, optimizer: torch.optim.Optimizer, best: _Best, done: int) -> Snapshot:
    tensors = {f"network/{name}": value for name, value in network.state_dict().items()}
    tensors |= {f"best/{name}": value for name, value in best.tensors.items()}
    for number, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer/{number}/{name}": value for name, value in state.items()}
    return Snapshot(done, tensors, {"scores": best.scores, "stale": best.stale})


def _resume(network: nn.Module, optimizer: torch.optim.Optimizer, best: _Best, checkpoint: Checkpoint | None) -> int:
    saved = checkpoint.load() if checkpoint else None
    if saved is None:
        return 0
    kept: dict[str, dict[str, Tensor]] = {"network": {}, "best": {}, "optimizer": {}}
    for name, value in saved.tensors.items():
        part, _, rest = name.partition("/")
        kept[part][rest] = value
    network.load_state_dict(kept["network"])
    state: dict[int, dict[str, Tensor]] = {}
    for name, value in kept["optimizer"].items():
        number, _, key = name.partition("/")
        state.setdefault(int(number), {})[key] = value
    optimizer.load_state_dict({"state": state, "param_groups": optimizer.state_dict()["param_groups"]})
    device = next(network.parameters()).device
    best.tensors = {name: value.to(device) for name, value in kept["best"].items()}
    best.scores, best.stale = dict(saved.numbers["scores"]), int(saved.numbers["stale"])
    return saved.iteration
