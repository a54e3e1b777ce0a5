"""What collage search knows at any moment, and how it is kept in checkpoints."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ...errors import InputError
from ...runtime.checkpoint import Snapshot
from .maps import WeightedMaps

VERSION = 8   # of the stages and their scores, which checkpoints name
CANDIDATES = "current", "best", "before"   # of `State`

Key = tuple[int, int, int]   # a stage: its round, its order in the round, and which restart it is


@dataclass(frozen=True)
class Candidate(WeightedMaps):
    """A code as the search sees it: its error, and its score; less is better of both. camera: with which it was judged,
    see `measure.tones`."""

    error: float
    score: float = float("inf")
    camera: tuple[str | float, ...] = ()


@dataclass(frozen=True)
class Grown(WeightedMaps):
    """A set of maps that was grown. likeness: the F1 within a pixel of what it draws."""

    likeness: float


@dataclass(frozen=True)
class State:
    """All that a search needs to go on.

    done: the last stage that was closed. Of the stage after it: its moves so far (`step`), its candidate (`current`,
    None before it begins), and the move at which its error was last halved, with that error. best: of the stages of
    this round; before: of the rounds before; pool (M,6): the maps of all restarts; scores: those of the restarts of
    this round, in ascending order; stopped: why the last round ended, in words; curve: sets of
    more and more maps, that were grown.
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

    @property
    def result(self) -> Candidate | None:
        """The candidate to return if all ended here."""
        return self.before or self.best

    def has_done(self, key: Key) -> bool:
        """Whether this stage is behind."""
        return self.done is not None and key <= self.done

    def moved(self, candidate: Candidate) -> State:
        """After a move."""
        step, halved = self.step + 1, self.halved or (0, self.current.error)
        if candidate.error <= halved[1] / 2:
            halved = step, candidate.error
        return replace(self, current=candidate, step=step, halved=halved)

    def closed(self, key: Key) -> State:
        """After a stage."""
        return replace(self, done=key, step=0, current=None, halved=None)

    def with_pool(self, maps: Tensor) -> State:
        """With more maps (n,6) in the pool."""
        return replace(self, pool=maps if self.pool is None else torch.cat([self.pool, maps]))

    def snapshot(self) -> Snapshot:
        """What a checkpoint keeps."""
        kept = {name: each for name in CANDIDATES if (each := getattr(self, name)) is not None}
        tensors = {f"{name}/maps": each.maps for name, each in kept.items()}
        tensors |= {f"{name}/weights": each.weights for name, each in kept.items() if each.weights is not None}
        if self.pool is not None:
            tensors["pool"] = self.pool
        for i, each in enumerate(self.curve):
            tensors |= {f"curve/{i}/maps": each.maps, f"curve/{i}/weights": each.weights}
        numbers = {name: [each.error, each.score, *each.camera] for name, each in kept.items()}
        numbers |= {"curve": [each.likeness for each in self.curve]}
        return Snapshot(self.step, tensors, {"collage": VERSION, "done": self.done, "halved": self.halved,
                                             "scores": list(self.scores), "stopped": self.stopped, **numbers})

    @classmethod
    def of(cls, snapshot: Snapshot, device: str) -> State:
        """The state that a checkpoint kept. Raises `InputError` on one of another version of the search."""
        tensors, numbers = {name: each.to(device) for name, each in snapshot.tensors.items()}, snapshot.numbers
        version = numbers.get("collage", numbers.get("stages", 1))
        if version != VERSION:
            raise InputError(f"expected a checkpoint of collage search in its version {VERSION}, got one of version "
                             f"{version}; start anew with resume=false")
        kept = {}
        for name in (name for name in CANDIDATES if name in numbers):
            error, score, *camera = numbers[name]
            kept[name] = Candidate(tensors[f"{name}/maps"], tensors.get(f"{name}/weights"), error, score, tuple(camera))
        done, halved = (tuple(each) if each else None for each in (numbers["done"], numbers["halved"]))
        curve = tuple(Grown(tensors[f"curve/{i}/maps"], tensors[f"curve/{i}/weights"], likeness)
                      for i, likeness in enumerate(numbers["curve"]))
        return cls(done, snapshot.iteration, **kept, curve=curve, halved=halved, pool=tensors.get("pool"),
                   scores=tuple(numbers["scores"]), stopped=numbers["stopped"])
