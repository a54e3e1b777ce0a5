"""Methods that repeat one step until their budget is spent: the loop, the limit of time, progress and checkpoints."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

from torch import Tensor

from ..errors import InputError
from ..ifs.code import IFS
from ..runtime.checkpoint import Checkpoint, Snapshot
from ..runtime.checks import check_seconds
from ..runtime.deadline import Deadline
from ..runtime.params import Params
from ..runtime.precision import full_precision
from .base import (
    AnyTarget,
    CodeReconstruction,
    FitDiverged,
    Method,
    OnStep,
    Progress,
    check_device,
    check_target,
    time_is_up,
)

State = Mapping[str, Tensor]
SMALLEST_INPUT = 16  # pixels a side of a target


class Walk(ABC):
    """One method at work on one checked image (R,R), float32, with its parameters and the seed of every random number.
    A step depends on the state before it and on its number alone, and makes a new state, so that a state is all that a
    checkpoint has to keep. Raises `InputError` if the method cannot take the image."""

    def __init__(self, image: Tensor, params: Any, seed: int):
        self.image, self.params, self.seed = image, params, seed

    @abstractmethod
    def start(self) -> State:
        """The state before the first step."""

    @abstractmethod
    def step(self, state: State, number: int) -> State:
        """The state after the step of this number, from 0 on."""

    @abstractmethod
    def evaluations(self, steps: int) -> int:
        """How many images have been drawn after so many steps."""

    @abstractmethod
    def loss(self, state: State) -> float:
        """What the method lowers, of the best code so far."""

    @abstractmethod
    def code(self, state: State) -> IFS:
        """The best code so far, contractive and in the frame of the image."""

    @abstractmethod
    def draw(self, state: State) -> Tensor:
        """The best code so far as the method itself sees it, (S,S) in [0,1]."""


class Stepwise(Method):
    """A method of so many steps. The result is the best code that was met.

    seconds: a limit after which the best code so far is returned (the run can then no longer be repeated bit for bit).
    seed: of every random number. previews: how many preview images are reported. device: where tensors live. options:
    the parameters of `Params`. Raises `InputError` on values out of range.
    """

    walk: ClassVar[type[Walk]]  # the work on an image
    unit: ClassVar[str]      # what a step is called, in the plural; the parameter of this name is the budget
    budget: ClassVar[int]    # that two cores finish in minutes
    Params: ClassVar[type[Params]]

    def __init__(self, *, seconds: float | None = None, seed: int = 0, previews: int = 10, device: str = "cpu",
                 **options: Any):
        check_seconds(seconds)
        if previews < 0:
            raise InputError(f"previews must be at least 0, got {previews}")
        self.params = self.Params().updated(**options)
        self.seconds, self.seed, self.previews, self.device = seconds, seed, previews, check_device(device)

    @classmethod
    def laptop(cls, *, resolution: int = 256, seed: int = 0, seconds: float | None = None, previews: int = 0,
               **options: Any) -> Self:
        """The method with a budget that two cores finish in minutes. It takes images of any resolution from 16² on."""
        check_resolution(resolution)
        sizes: dict[str, Any] = {cls.unit: cls.budget} | options
        return cls(seed=seed, seconds=seconds, previews=previews, **sizes)

    @property
    def steps(self) -> int:
        """The budget."""
        return getattr(self.params, self.unit)

    def begun(self, target: AnyTarget) -> Walk:
        """The work on a target. Raises `InputError` if the method cannot take it."""
        return self.walk(check_target(target).to(self.device), self.params, self.seed)

    def check(self, target: AnyTarget) -> None:
        self.begun(target)

    @full_precision()
    def reconstruct(self, target: AnyTarget, *, on_step: OnStep | None = None, checkpoint: Checkpoint | None = None
                    ) -> CodeReconstruction:
        walk = self.begun(target)
        deadline = Deadline(self.seconds)
        state, done = self._begin(walk, checkpoint)
        first, every = done, math.ceil(self.steps / self.previews) if self.previews else None
        while done < self.steps and not (deadline.passed and done > first):
            try:
                state, done = walk.step(state, done), done + 1
                loss = walk.loss(state)
                if not math.isfinite(loss):
                    raise FitDiverged(f"step {done} of {self.unit} met a NaN or an infinity; try another seed")
                if on_step:
                    fraction = min(1.0, max(done / self.steps, deadline.used))
                    wanted, stage = every and (done % every == 0 or fraction == 1), self._stage(done)
                    on_step(Progress(done, fraction, {"loss": loss, "evaluations": walk.evaluations(done)},
                                     walk.draw(state).cpu() if wanted else None, f"first {stage} {self.unit}",
                                     walk.code(state).to("cpu") if stage == done or fraction == 1 else None))
                if checkpoint and done % checkpoint.every == 0 and done < self.steps:
                    checkpoint.save(Snapshot(done, state))
            except KeyboardInterrupt:  # state and number belong together: they are set at once
                if checkpoint:
                    checkpoint.save(Snapshot(done, state))
                raise
        stopped = f"all {self.steps} {self.unit} done" if done >= self.steps else time_is_up(deadline)
        return CodeReconstruction(walk.code(state).to("cpu").check_contractive(), stopped,
                                  evaluations=walk.evaluations(done))

    def _stage(self, done: int) -> int:
        """The end of the stage that a step belongs to: stages end where the steps have doubled, and with the budget."""
        return min(1 << (done - 1).bit_length(), self.steps)

    def _begin(self, walk: Walk, checkpoint: Checkpoint | None) -> tuple[State, int]:
        """The first state, or the saved one, and the steps done. Raises `InputError` if it is of another search."""
        start = walk.start()
        saved = checkpoint.load() if checkpoint else None
        if saved is None:
            return start, 0
        return saved.like(start), saved.iteration


def check_resolution(resolution: int) -> None:
    """Raise `InputError` if targets of so many pixels a side are too small."""
    if resolution < SMALLEST_INPUT:
        raise InputError(f"resolution must be at least {SMALLEST_INPUT}, got {resolution}")
