"""The stages of collage search, in order."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import torch
from torch import Tensor

from ...ifs.code import IFS
from ...runtime.seeds import derive
from . import maps as affine
from .frame import Frame
from .measure import Levels, desaturated
from .memory import MemoryBudget
from .picture import Picture, reduced
from .picture_search import DRAWINGS, FAR, LOW, PRICE, PictureSearch
from .polish import fitted_into_frame
from .refine import grid_for
from .rounding import Rounding
from .search import Judge, Search, Tiling
from .superfluous import without_superfluous
from .work import Work

AGREED = 0.02    # relative difference of scores at which two islands have found the same
LONGER, RECENT = 3, 2 / 3    # times the moves asked for: that there are at most, and since when the error was halved
WRONG = 1.2      # times a drawing's noise: a picture error from which on a second round is worth while,
STILL_WRONG = 2.0  # and a third and a fourth, which a right code that was drawn a little amiss would not gain by;
AGAIN = 0.5      # the chance that a round is followed by another, as the progress bar takes it
ISOMETRY, CONTRACTION = 0.95, 0.9   # smaller singular value of a map that may be a symmetry; the most without such maps
LARGEST = 512    # pixels a side of the picture that is searched,
FULL = 1024      # and of a larger one that the code is polished on in the end,
FULL_POLISH = 4  # in so many steps
DETAIL = Judge(price=1e-4, prior=0.03)


@dataclass(frozen=True)
class Problem:
    """What all stages share: the picture `given` (R,R), what its grey levels say, and the options of `Collage`. The
    search is made on an `image` of at most 512², and its `masses`; `full_side` is at most 1024. part: how much of the
    time has passed, up to 1; memory_gib: see `Collage`."""

    given: Tensor
    levels: Levels
    seed: int
    proposals: int
    finest: int
    fixed: int | None
    most: int | None
    part: Callable[[], float] = float
    memory_gib: float | None = None
    image: Tensor = field(init=False)
    full_side: int = field(init=False)
    masses: Tensor = field(init=False)
    memory: MemoryBudget = field(init=False)

    def __post_init__(self) -> None:
        side = self.given.shape[0]
        memory = MemoryBudget(self.memory_gib, side, self.levels.supersample)
        size = memory.size(LARGEST)
        image = self.given if size == side else self.levels.shrunk(self.given, size)
        object.__setattr__(self, "memory", memory)
        object.__setattr__(self, "image", image)
        object.__setattr__(self, "full_side", min(side, FULL))
        object.__setattr__(self, "masses", self.levels.measure(image))

    def late(self) -> bool:
        """Whether time is up."""
        return self.part() >= 1

    @property
    def is_reduced(self) -> bool:
        """Whether the search is made on a smaller picture than the one given."""
        return self.image is not self.given

    def picture(self, size: int, code: IFS, seed: int, drawings: int = 1) -> Picture:
        """The picture at this size as a judge of codes, within the memory there is; `code` is the best so far."""
        whole = size == self.given.shape[0]
        image = self.given if whole else reduced(self.given, size, code, self.levels, seed)
        return Picture(image, self.levels, seed, drawings, maps_at_once=self.memory.maps_at_once(size))

    def search(self, masses: Tensor, wanted: int, seed: int, **options: object) -> Search:
        """On a grid of `wanted` cells a side, or what the picture can fill."""
        size = grid_for(masses.shape[0], wanted)
        return Search(masses, size=size, coarse=size // 2, seed=seed, fixed=self.fixed, most=self.most,
                      proposals=self.proposals, **options)


class Stage(ABC):
    """A search of its own. name: as it is reported; moves: its steps, at most; asked: as many as are to be expected;
    ends: the part of a limited time at which it ends, and before which it must begin; number: tells it from others of
    its kind; round: 0 for the first."""

    name: str
    ends: float
    round = 0
    search: Search | PictureSearch

    def __init__(self, problem: Problem, moves: int, number: int = 0):
        self.problem, self.moves, self.asked, self.number = problem, moves, moves, number

    @property
    def expected(self) -> float:
        """Steps, by chance."""
        return AGAIN**self.round * self.asked

    @abstractmethod
    def open(self, work: Work) -> None:
        """Make ready; `work.tiling` is None when the stage begins, and not when it is resumed."""

    @abstractmethod
    def begin(self, work: Work) -> Tiling:
        """The tiling to start with."""

    def step(self, now: Tiling, number: int) -> Tiling:
        """`now`, or a better one."""
        return self.search.step(now, number)

    def settled(self, work: Work) -> bool:
        """Whether there is nothing left to do, or no hope."""
        return False

    def close(self, work: Work) -> Work:
        """The work, handed on to the next stage."""
        return work.done(work.tiling)

    def smaller(self, work: Work) -> float:
        """What the smaller singular value of a map may be. A symmetry of the shape explains its measure as well as the
        identity does: if a code with a map near to an isometry has failed, every other round does without such maps."""
        suspect = work.before is not None and bool((affine.smaller_singular(work.before.maps) > ISOMETRY).any())
        return CONTRACTION if suspect and self.round % 2 else 1.0


class Island(Stage):
    """A search from nothing; the maps of all islands so far are mixed, and those of the rounds before."""

    name, ends = "search", 0.35

    def __init__(self, problem: Problem, moves: int, number: int, others: int):
        super().__init__(problem, moves, number)
        self.others = others

    def open(self, work: Work) -> None:
        problem, seed = self.problem, derive(self.problem.seed, "island", self.number)
        masses = problem.masses
        if work.before is not None:
            masses = desaturated(masses, work.before.code, problem.levels, seed)
        self.search = problem.search(masses, 64, seed, smaller=self.smaller(work))

    def begin(self, work: Work) -> Tiling:
        return self.search.start()

    def close(self, work: Work) -> Work:
        found, scores = work.tiling, tuple(sorted((*work.scores, work.tiling.score)))
        pool = found.maps if work.pool is None else torch.cat([work.pool, found.maps])
        work = replace(work, pool=pool, scores=scores)
        if work.best is None and work.before is None:
            return work.done(found)
        best = min(work.best or found, found, self.search.mixed(pool), key=lambda tiling: tiling.score)
        agreed = len(scores) > 1 and scores[1] < min(1, (1 + AGREED) * best.score)  # 1 and more: too many maps, or few
        return work.done(best, 1 + self.others if agreed else 1)


class Closing(Stage):
    """The search goes on from the best mixture, which corrects the picture's measure for what it hides."""

    name, ends = "search", 0.45

    def open(self, work: Work) -> None:
        problem, seed = self.problem, derive(self.problem.seed, "closing", self.number)
        masses = desaturated(problem.masses, work.best.code, problem.levels, seed)
        self.search = problem.search(masses, 64, seed, smaller=self.smaller(work))

    def begin(self, work: Work) -> Tiling:
        return self.search.resume(work.best.maps, work.best.weights)


class Detail(Stage):
    """A search on a finer grid of the picture's measure, corrected by what the best so far hides of its own."""

    name, ends = "detail", 0.65

    def open(self, work: Work) -> None:
        problem, seed = self.problem, derive(self.problem.seed, "detail", self.number)
        corrected = desaturated(problem.masses, work.best.code, problem.levels, seed)
        self.search = problem.search(corrected, 128, seed, judge=DETAIL, fine_details=True, count=24,
                                     smaller=self.smaller(work))

    def begin(self, work: Work) -> Tiling:
        return self.search.resume(work.best.maps, work.best.weights)


class Approach(Stage):
    """The code polished on a picture that was made smaller, which is known the better the nearer the code is."""

    name, ends = "approach", 0.75

    def open(self, work: Work) -> None:
        self.search = picture_search(self.problem, work.best.code, "approach", self.number)
        self.search.late = lambda: self.problem.part() >= self.ends  # all of it is one step

    def begin(self, work: Work) -> Tiling:
        return self.search.resume(work.best)


class Retouch(Stage):
    """Refinement, and moves of single maps, judged by the picture; the end of a round. While the error has been halved
    not long ago there are more moves than asked for. If the code is still wrong, and the picture not so far off that it
    may be of no code at all, another round begins, with the maps found so far in the pool."""

    name, ends = "picture", 0.95

    def __init__(self, problem: Problem, moves: int, number: int, others: int):
        super().__init__(problem, LONGER * moves, number)
        self.asked, self.recent, self.others = moves, max(1, round(RECENT * moves)), others

    def open(self, work: Work) -> None:
        self.search = picture_search(self.problem, work.best.code, "retouch", self.number)

    def begin(self, work: Work) -> Tiling:
        return self.search.resume(work.best)

    def step(self, now: Tiling, number: int) -> Tiling:
        more = number + 1 - self.asked  # small maps hold large ones where they are, and the search with them
        due = more >= 0 and more % self.recent == 0
        return self.search.tidied(now) if due else self.search.step(now, number)

    def settled(self, work: Work) -> bool:
        idle = work.step - (work.halved[0] if work.halved else 0)
        hopeless = work.step >= self.asked and idle >= self.recent
        return hopeless or self.search.settled(work.tiling, work.step)

    def close(self, work: Work) -> Work:
        if self.problem.is_reduced and not self.problem.late():
            self.search = picture_search(self.problem, work.tiling.code, "finish", self.number)
        found, before = self.search.finish(work.tiling), work.before
        if before is not None and self.problem.is_reduced:  # it was judged by another picture
            before = self.search.judged(before)
        best = found if before is None or found.score < before.score else before
        if self.others and self._is_wrong(best):
            simple = self.search.simplified(best)
            best = best if simple is None or self._is_wrong(simple) else simple
        if self.others and self._is_wrong(best):
            pool = torch.cat([work.pool, found.maps])
            return replace(work.done(None), before=best, pool=pool, scores=())
        return replace(work.done(best, 1 + self.others), before=None)

    def _is_wrong(self, tiling: Tiling) -> bool:
        worth = STILL_WRONG if self.round else WRONG
        return self.search.noises(tiling) > worth and not self.search.is_hopeless(tiling)


class Full(Stage):
    """The code polished on the picture at its full resolution, or on 1024², where the search was made on a smaller one:
    what is compared are 512² cells, in which a larger drawing only has less noise."""

    name, ends = "full size", 0.98

    def open(self, work: Work) -> None:
        self.picture = self.problem.picture(self.problem.full_side, work.result.code, derive(self.problem.seed, "full"))

    def begin(self, work: Work) -> Tiling:
        start = self.picture.judge(work.result.maps, work.result.chances)
        noise, late = self.picture.noise(start.code), self.problem.late
        near = start.error < FAR * noise
        start = without_superfluous(self.picture, start, PRICE * noise, self.problem.fixed or 0, near=near, late=late)
        frame = Frame.of(self.picture.image) if near else None
        drawn = fitted_into_frame(self.picture, start, FULL_POLISH, frame, late=late)
        return Tiling(drawn.maps, drawn.chances, drawn.error, drawn.error)

    def close(self, work: Work) -> Work:
        return replace(work.done(work.tiling), before=None)


class LastDigits(Stage):
    """Of a code that is nearly found: simple numbers rounded, and the frame filled exactly."""

    name, ends = "last digits", 0.99

    def open(self, work: Work) -> None:
        seed, drawings = derive(self.problem.seed, "last digits"), 1 if self.problem.full_side > LARGEST else DRAWINGS
        self.picture = self.problem.picture(self.problem.full_side, work.result.code, seed, drawings)

    def begin(self, work: Work) -> Tiling:
        found, hasty = work.result, self.picture.hasty()
        if hasty.judge(found.maps, found.chances).error > max(FAR * hasty.noise(found.code), LOW):
            return found
        drawn = Rounding(self.picture, self.problem.late)(self.picture.judge(found.maps, found.chances))
        return Tiling(drawn.maps, drawn.chances, drawn.error, drawn.error)

    def close(self, work: Work) -> Work:
        return replace(work.done(work.tiling), before=None)


def plan(problem: Problem, *, rounds: int, islands: int, moves: int, detail_moves: int, picture_moves: int
         ) -> list[Stage]:
    """The stages in order; half as many islands in rounds after the first."""
    stages, fewer = [], (islands + 1) // 2
    for number in range(rounds):
        count = fewer if number else islands
        stages += [Island(problem, moves, 1000 * number + island, count - 1 - island) for island in range(count)]
        stages += [Closing(problem, moves if islands > 1 else 0, number), Detail(problem, detail_moves, number)]
        approach = [Approach(problem, 0, number)] if problem.is_reduced else []
        others = (rounds - 1 - number) * (fewer + 3 + len(approach))
        stages += [*approach, Retouch(problem, picture_moves, number, others)]
        for stage in stages[-count - 3 - len(approach):] if number else []:
            stage.ends, stage.round = Retouch.ends, number
    full = [Full(problem, 0)] if problem.full_side > len(problem.image) else []
    return [*stages, *full, LastDigits(problem, 0)]


def picture_search(problem: Problem, code: IFS, *path: str | int) -> PictureSearch:
    """The search by the picture, at the size of the problem's image; `code` is the best so far."""
    seed = derive(problem.seed, *path)
    picture = problem.picture(len(problem.image), code, seed)
    masses = problem.levels.measure(picture.image) if problem.is_reduced else problem.masses
    return PictureSearch(picture, masses, noise=picture.noise(code), seed=seed, finest=problem.finest,
                         fixed=problem.fixed, most=problem.most, late=problem.late)
