"""The state of collage search that is handed from one stage to the next, and kept in checkpoints."""

from __future__ import annotations

from dataclasses import dataclass, replace

from torch import Tensor

from ...errors import InputError
from ...runtime.checkpoint import Snapshot
from .search import Tiling

TILINGS = "tiling", "best", "before"   # of `Work`
STAGES = 5       # the version of the stages and their scores, which checkpoints name


@dataclass(frozen=True)
class Work:
    """How far the search has come: the number of the stage, its step and tiling (None before it begins); the step at
    which its error was last halved, and that error; the best tiling of the stages of this round, and of the rounds
    before; and of the islands all maps (M,6) and the scores."""

    stage: int = 0
    step: int = 0
    tiling: Tiling | None = None
    halved: tuple[int, float] | None = None
    best: Tiling | None = None
    before: Tiling | None = None
    pool: Tensor | None = None
    scores: tuple[float, ...] = ()

    @property
    def result(self) -> Tiling | None:
        """The tiling to return if all ended here."""
        return self.before or self.best

    def moved(self, tiling: Tiling) -> Work:
        """After a step."""
        step, halved = self.step + 1, self.halved or (0, self.tiling.error)
        if tiling.error <= halved[1] / 2:
            halved = step, tiling.error
        return replace(self, tiling=tiling, step=step, halved=halved)

    def done(self, best: Tiling | None, stages: int = 1) -> Work:
        """After the stage, so many stages on."""
        return replace(self, stage=self.stage + stages, step=0, tiling=None, halved=None, best=best)

    def snapshot(self) -> Snapshot:
        kept = {name: t for name in TILINGS if (t := getattr(self, name)) is not None}
        tensors = {f"{name}/{part}": getattr(t, part) for name, t in kept.items() for part in ("maps", "weights")}
        if self.pool is not None:
            tensors["pool"] = self.pool
        numbers = {name: [t.error, t.score] for name, t in kept.items()} | {"halved": self.halved}
        return Snapshot(self.step, tensors, {"stages": STAGES, "stage": self.stage, "scores": list(self.scores),
                                             **numbers})

    @classmethod
    def of(cls, snapshot: Snapshot, device: str) -> Work:
        """Raises `InputError` on a snapshot of other stages, or of scores that were reckoned otherwise."""
        tensors, numbers = {name: t.to(device) for name, t in snapshot.tensors.items()}, snapshot.numbers
        if numbers.get("stages") != STAGES:
            raise InputError(f"expected a checkpoint of collage search in its version {STAGES}, got one of version "
                             f"{numbers.get('stages', 1)}; start anew with resume=false")
        tilings = {name: Tiling(tensors[f"{name}/maps"], tensors[f"{name}/weights"], *numbers[name])
                   for name in TILINGS if name in numbers}
        halved = tuple(numbers["halved"]) if numbers["halved"] else None
        return cls(numbers["stage"], snapshot.iteration, **tilings, halved=halved, pool=tensors.get("pool"),
                   scores=tuple(numbers["scores"]))
