"""The stages of collage search, in order, and the state that is handed from one to the next."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import torch
from torch import Tensor

from ..checkpoint import Snapshot
from ..seeds import derive
from .measure import Levels, desaturated
from .picture import Picture
from .picture_search import PictureSearch
from .polish import never, polished
from .refine import grid_for
from .search import Judge, Search, Tiling

AGREED = 0.02    # relative difference of scores at which two islands have found the same
LARGEST = 512    # pixels a side of the picture that is searched
FULL_POLISH = 4  # steps on a larger one
DETAIL = Judge(price=1e-4, prior=0.03)


@dataclass(frozen=True)
class Work:
    """How far the search has come: the number of the stage, its step and tiling (None before it begins); the best
    tiling of the stages before, and of the islands all maps (M,6) and the scores."""

    stage: int = 0
    step: int = 0
    tiling: Tiling | None = None
    best: Tiling | None = None
    pool: Tensor | None = None
    scores: tuple[float, ...] = ()

    def moved(self, tiling: Tiling) -> Work:
        """After a step."""
        return replace(self, tiling=tiling, step=self.step + 1)

    def done(self, best: Tiling, stages: int = 1) -> Work:
        """After the stage, so many stages on."""
        return replace(self, stage=self.stage + stages, step=0, tiling=None, best=best)

    def snapshot(self) -> Snapshot:
        kept = {name: t for name, t in (("tiling", self.tiling), ("best", self.best)) if t is not None}
        tensors = {f"{name}/{part}": getattr(t, part) for name, t in kept.items() for part in ("maps", "weights")}
        if self.pool is not None:
            tensors["pool"] = self.pool
        numbers = {name: [t.error, t.score] for name, t in kept.items()}
        return Snapshot(self.step, tensors, {"stage": self.stage, "scores": list(self.scores), **numbers})

    @classmethod
    def of(cls, snapshot: Snapshot, device: str) -> Work:
        tensors, numbers = {name: t.to(device) for name, t in snapshot.tensors.items()}, snapshot.numbers
        tiling, best = (Tiling(tensors[f"{name}/maps"], tensors[f"{name}/weights"], *numbers[name])
                        if name in numbers else None for name in ("tiling", "best"))
        return cls(numbers["stage"], snapshot.iteration, tiling, best, tensors.get("pool"), tuple(numbers["scores"]))


@dataclass(frozen=True)
class Problem:
    """What all stages share: the image `full` (R,R), what its grey levels say, and the options of `Collage`. The search
    is made on an `image` of at most 512², and its `masses`. late: whether time is up."""

    full: Tensor
    levels: Levels
    seed: int
    proposals: int
    finest: int
    fixed: int | None
    most: int | None
    late: Callable[[], bool] = never
    image: Tensor = field(init=False)
    masses: Tensor = field(init=False)

    def __post_init__(self) -> None:
        size = self.full.shape[0] // math.ceil(self.full.shape[0] / LARGEST)
        image = self.full if size == self.full.shape[0] else self.levels.shrunk(self.full, size)
        object.__setattr__(self, "image", image)
        object.__setattr__(self, "masses", self.levels.measure(image))

    def search(self, masses: Tensor, wanted: int, seed: int, **options: object) -> Search:
        """On a grid of `wanted` cells a side, or what the picture can fill."""
        size = grid_for(masses.shape[0], wanted)
        return Search(masses, size=size, coarse=size // 2, seed=seed, fixed=self.fixed, most=self.most,
                      proposals=self.proposals, **options)


class Stage(ABC):
    """A search of its own. name: as it is reported; moves: its steps; ends: the part of a limited time at which it
    ends, and before which it must begin."""

    name: str
    ends: float
    search: Search | PictureSearch

    def __init__(self, problem: Problem, moves: int):
        self.problem, self.moves = problem, moves

    @abstractmethod
    def open(self, work: Work) -> None:
        """Make ready; `work.tiling` is None when the stage begins, and not when it is resumed."""

    @abstractmethod
    def begin(self, work: Work) -> Tiling:
        """The tiling to start with."""

    def step(self, now: Tiling, number: int) -> Tiling:
        """`now`, or a better one."""
        return self.search.step(now, number)

    def settled(self, now: Tiling) -> bool:
        """Whether nothing is left to do."""
        return False

    def close(self, work: Work) -> Work:
        """The work, handed on to the next stage."""
        return work.done(work.tiling)


class Island(Stage):
    """A search from nothing; the maps of all islands so far are mixed."""

    name, ends = "search", 0.35

    def __init__(self, problem: Problem, moves: int, number: int, others: int):
        super().__init__(problem, moves)
        self.number, self.others = number, others

    def open(self, work: Work) -> None:
        problem = self.problem
        self.search = problem.search(problem.masses, 64, derive(problem.seed, "island", self.number))

    def begin(self, work: Work) -> Tiling:
        return self.search.start()

    def close(self, work: Work) -> Work:
        found, scores = work.tiling, tuple(sorted((*work.scores, work.tiling.score)))
        pool = found.maps if work.pool is None else torch.cat([work.pool, found.maps])
        work = replace(work, pool=pool, scores=scores)
        if work.best is None:
            return work.done(found)
        best = min(work.best, found, self.search.mixed(pool), key=lambda tiling: tiling.score)
        agreed = scores[1] < min(1, (1 + AGREED) * best.score)  # not so with a number of maps that is not allowed
        return work.done(best, 1 + self.others if agreed else 1)


class Closing(Stage):
    """The search goes on from the best mixture, which corrects the picture's measure for what it hides."""

    name, ends = "search", 0.45

    def open(self, work: Work) -> None:
        problem, seed = self.problem, derive(self.problem.seed, "closing")
        self.search = problem.search(desaturated(problem.masses, work.best.code, problem.levels, seed), 64, seed)

    def begin(self, work: Work) -> Tiling:
        return self.search.resume(work.best.maps, work.best.weights)


class Detail(Stage):
    """A search on a finer grid of the picture's measure, corrected by what the best so far hides of its own."""

    name, ends = "detail", 0.65

    def __init__(self, problem: Problem, moves: int, number: int):
        super().__init__(problem, moves)
        self.number = number

    def open(self, work: Work) -> None:
        problem, seed = self.problem, derive(self.problem.seed, "detail", self.number)
        corrected = desaturated(problem.masses, work.best.code, problem.levels, seed)
        self.search = problem.search(corrected, 128, seed, judge=DETAIL, fine_details=True, count=24)

    def begin(self, work: Work) -> Tiling:
        return self.search.resume(work.best.maps, work.best.weights)


class Retouch(Stage):
    """Refinement, and moves of single maps, judged by the picture."""

    name, ends = "picture", 0.95

    def open(self, work: Work) -> None:
        problem, seed = self.problem, derive(self.problem.seed, "retouch")
        picture = Picture(problem.image, problem.levels, seed)
        self.search = PictureSearch(picture, problem.masses, noise=picture.noise(work.best.code), seed=seed,
                                    finest=problem.finest, fixed=problem.fixed, most=problem.most, late=problem.late)

    def begin(self, work: Work) -> Tiling:
        return self.search.resume(work.best)

    def settled(self, now: Tiling) -> bool:
        return self.search.settled(now)

    def close(self, work: Work) -> Work:
        return work.done(self.search.finish(work.tiling))


class Full(Stage):
    """The code polished on the picture at its full resolution, where the search was made on a smaller one."""

    name, ends = "full size", 0.98

    def open(self, work: Work) -> None:
        self.picture = Picture(self.problem.full, self.problem.levels, derive(self.problem.seed, "full"))

    def begin(self, work: Work) -> Tiling:
        drawn = polished(self.picture, self.picture.judge(work.best.maps, work.best.chances), FULL_POLISH,
                         late=self.problem.late)
        return Tiling(drawn.maps, drawn.chances, drawn.error, drawn.error)


def plan(problem: Problem, *, islands: int, moves: int, rounds: int, detail_moves: int, picture_moves: int
         ) -> list[Stage]:
    """The stages in order."""
    return [*(Island(problem, moves, number, islands - 1 - number) for number in range(islands)),
            Closing(problem, moves if islands > 1 else 0),
            *(Detail(problem, detail_moves, number) for number in range(rounds)),
            Retouch(problem, picture_moves),
            *([Full(problem, 0)] if problem.image is not problem.full else [])]
