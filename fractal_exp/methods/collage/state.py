"""The state of collage search, and how checkpoints store it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import torch
from pydantic import AfterValidator, BaseModel
from torch import Tensor

from ...cameras.camera import Camera
from ...cameras.kinds import KINDS
from ...errors import InputError
from ...ifs.affine import normalized, to_code, volumes
from ...ifs.code import IFS
from ...runtime.checkpoint import Snapshot
from ...runtime.checks import shown
from ...runtime.params import Count, Odds, Share

VERSION = 21   # of the stages and their scores; stored in checkpoints
LARGEST = 10.0**6  # of a camera's values
CANDIDATES = "current", "best", "before"   # fields of `State`
STAGES = ("sketch", "population", "restart", "mixture", "detail", "promise", "approach", "construction", "image",
          "full size", "rounding", "growth")   # in order; the last three come after all rounds


class Key(NamedTuple):
    """Which stage of which round, and which restart; a fraction is a restart between two others."""

    round: int
    stage: str
    restart: float = 0

    @property
    def place(self) -> tuple[int, int, float]:
        """Higher for later stages."""
        return self.round, STAGES.index(self.stage), self.restart


@dataclass(frozen=True)
class WeightedMaps:
    """Maps (N,6) with weights.

    weights (N,): relative; the probability of a map is its weight over their sum. None: they are tied to |det| + 0.01.
    """

    maps: Tensor
    weights: Tensor | None

    @property
    def probabilities(self) -> Tensor:
        """(N,), summing to 1."""
        return normalized(volumes(self.maps) if self.weights is None else self.weights)

    @property
    def own_weights(self) -> Tensor:
        """`weights`, where they are not tied, as in all sets on the image's measure."""
        assert self.weights is not None
        return self.weights

    @property
    def code(self) -> IFS:
        return to_code(self.maps, self.weights)


@dataclass(frozen=True)
class Candidate(WeightedMaps):
    """A code as the search sees it, with its error and its score; lower is better. camera: the one that was used to
    judge it; None: none was."""

    error: float
    score: float = float("inf")
    camera: Camera | None = None


@dataclass(frozen=True)
class Grown(WeightedMaps):
    """A grown set of maps. likeness: of its drawing through the camera, see `stages.growing`."""

    likeness: float
    camera: Camera

    @property
    def candidate(self) -> Candidate:
        """The same set for the search, whose error falls as its likeness rises."""
        return Candidate(self.maps, self.weights, 1 - self.likeness, 1 - self.likeness, self.camera)


@dataclass(frozen=True)
class State:
    """All that a search needs to continue.

    done: the last closed stage. step: moves made so far in the next stage; current: its candidate, None before it
    begins; halved: the move at which its error was last halved, and that error. best: the best candidate of this round;
    before: the best of earlier rounds; pool (M,6): the maps of all restarts; scores: those of this round's restarts, in
    ascending order; stopped: why the last round ended, in words; curve: grown sets of more and more maps; is_outgrown:
    whether they are so much more like the picture than what the search found that it ended. measured_through: the
    camera through which the search reads masses from the image; None: the levels of the problem.
    """

    done: Key | None = None
    step: int = 0
    current: Candidate | None = None
    halved: tuple[int, float] | None = None
    best: Candidate | None = None
    before: Candidate | None = None
    pool: Tensor | None = None
    scores: tuple[float, ...] = ()
    stopped: str = ""
    curve: tuple[Grown, ...] = ()
    is_outgrown: bool = False
    measured_through: Camera | None = None

    @property
    def now(self) -> Candidate:
        """`current`, once the stage has begun."""
        assert self.current is not None
        return self.current

    @property
    def leader(self) -> Candidate:
        """`best`, once the round has found a code."""
        assert self.best is not None
        return self.best

    @property
    def found(self) -> Candidate:
        """`result`, once the search has found a code."""
        assert self.result is not None
        return self.result

    @property
    def result(self) -> Candidate | None:
        """The candidate to return if the search ended here."""
        return self.searched or (self.curve[-1].candidate if self.curve else None)

    @property
    def searched(self) -> Candidate | None:
        """The candidate that the search has found, rather than grown."""
        return self.before or self.best

    def has_done(self, key: Key) -> bool:
        return self.done is not None and key.place <= self.done.place

    def begun(self, first: Callable[[], Candidate]) -> State:
        """The state in which a stage begins with a candidate; as it is if the stage is resumed."""
        return self if self.current is not None else replace(self, current=first())

    def moved(self, candidate: Candidate) -> State:
        step, halved = self.step + 1, self.halved or (0, self.now.error)
        if candidate.error <= halved[1] / 2:
            halved = step, candidate.error
        return replace(self, current=candidate, step=step, halved=halved)

    def closed(self, key: Key) -> State:
        return replace(self, done=key, step=0, current=None, halved=None)

    def pool_with(self, maps: Tensor) -> Tensor:
        return maps if self.pool is None else torch.cat([self.pool, maps])

    def snapshot(self) -> Snapshot:
        kept = {name: each for name in CANDIDATES if (each := getattr(self, name)) is not None}
        tensors = {f"{name}/maps": each.maps for name, each in kept.items()}
        tensors |= {f"{name}/weights": each.weights for name, each in kept.items() if each.weights is not None}
        if self.pool is not None:
            tensors["pool"] = self.pool
        for i, each in enumerate(self.curve):
            tensors |= {f"curve/{i}/maps": each.maps, f"curve/{i}/weights": each.weights}
        numbers = {name: [each.error, each.score, each.camera and each.camera.plain()] for name, each in kept.items()}
        numbers |= {"curve": [[each.likeness, each.camera.plain()] for each in self.curve]}
        through = self.measured_through
        return Snapshot(self.step, tensors, {
            "collage": VERSION, "done": self.done, "halved": self.halved, "scores": list(self.scores),
            "stopped": self.stopped, "is_outgrown": self.is_outgrown,
            "measured_through": through and through.plain(), **numbers})

    @classmethod
    def of(cls, snapshot: Snapshot, device: str) -> State:
        """The state of a checkpoint. Raises `InputError` if another version of the search wrote it."""
        version = snapshot.numbers.get("collage", snapshot.numbers.get("stages", 1))
        if version != VERSION:
            raise InputError(f"expected a checkpoint of version {VERSION} of collage search, got version "
                             f"{shown(version)}; start over with resume=false")
        numbers = snapshot.checked(_Numbers, finite=False)
        kept = {name: judged for name in CANDIDATES if (judged := getattr(numbers, name)) is not None}
        sets = [*kept, *(f"curve/{i}" for i in range(len(numbers.curve)))]
        needed = {name for name in ("pool", *(f"{name}/weights" for name in kept)) if name in snapshot.tensors}
        needed |= {f"{name}/maps" for name in sets} | {f"curve/{i}/weights" for i in range(len(numbers.curve))}
        tensors = snapshot.like({name: _as_expected(name, snapshot.tensors, device) for name in needed})
        if infinite := [name for name, value in tensors.items() if not bool(value.isfinite().all())]:
            raise InputError(f"the checkpoint has infinite values in {infinite[0]}; start afresh with resume=false")
        candidates = {name: Candidate(tensors[f"{name}/maps"], tensors.get(f"{name}/weights"), *judged)
                      for name, judged in kept.items()}
        curve = tuple(Grown(tensors[f"curve/{i}/maps"], tensors[f"curve/{i}/weights"], *shown)
                      for i, shown in enumerate(numbers.curve))
        return cls(numbers.done and Key(*numbers.done), snapshot.iteration, **candidates, curve=curve,
                   halved=numbers.halved, pool=tensors.get("pool"), scores=numbers.scores, stopped=numbers.stopped,
                   is_outgrown=numbers.is_outgrown, measured_through=numbers.measured_through)


def _as_expected(name: str, tensors: Mapping[str, Tensor], device: str) -> Tensor:
    """A tensor of the shape that maps, weights or a pool have, with as many maps as those in the checkpoint."""
    maps = tensors.get(name.replace("/weights", "/maps"))
    count = max(1, len(maps)) if maps is not None and maps.ndim else 1
    return torch.zeros(count, device=device) if name.endswith("/weights") else torch.zeros(count, 6, device=device)


def _is_a_stage(name: str) -> str:
    if name not in STAGES:
        raise ValueError(f"a stage must be one of {', '.join(STAGES)}")
    return name


def _is_of_a_kind(camera: Camera) -> Camera:
    values = [value for key, value in camera.plain().items() if key != "kind" and value is not None]
    if camera.kind not in KINDS or not all(0 <= value <= LARGEST for value in values):
        raise ValueError(f"a camera must be one of {', '.join(KINDS)}, with values from 0 to {LARGEST:g}")
    return camera


SomeCamera = Annotated[Camera, AfterValidator(_is_of_a_kind)]
Judged = tuple[float, float, SomeCamera | None]


class _Numbers(BaseModel):
    """The numbers of a checkpoint. Scores may be infinite: of what is not judged yet."""

    done: tuple[Count, Annotated[str, AfterValidator(_is_a_stage)], Odds] | None
    halved: tuple[Count, float] | None
    scores: tuple[float, ...]
    stopped: str
    is_outgrown: bool
    measured_through: SomeCamera | None
    curve: tuple[tuple[Share, SomeCamera], ...]
    current: Judged | None = None
    best: Judged | None = None
    before: Judged | None = None
