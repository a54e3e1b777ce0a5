"""The stages that search on the image's measure, from random maps to a set from which stage 3 can continue."""

from __future__ import annotations

import math
from dataclasses import replace

from ....cameras.kinds import with_camera
from ....ifs import affine
from ....runtime.deadline import Deadline
from ....runtime.seeds import derive
from ..bins import saturation_corrected
from ..measure.search import WRONG_NUMBER, MeasureSearch, Regime
from ..measure.windows import search_on
from ..state import Candidate, State
from .base import Stage

CONTRACTION = 0.9    # upper limit of the smaller singular value in rounds that avoid near-isometries
# Shares of a round's part of the time at which restarts, the search from their mixture, and stage 2 end
RESTARTS_END, MIXTURE_ENDS, DETAIL_ENDS = 0.35, 0.45, 0.65
AGREEMENT = 0.02        # relative difference of scores below which two restarts agree; the others are then skipped
LEFT = 0.75             # time left after a stage on a part of a shape, relative to that on a whole one
NEAR = 20.0             # noise ratio of a set below which the moves that follow find what it lacks sooner than restarts
NEARER = 12.0           # the same, sooner than the search from the mixture as well


class MeasureStage(Stage):
    """A search on the image's measure."""

    search: MeasureSearch
    ends_at: float

    @property
    def deadline(self) -> Deadline:
        """Later in a part of a shape: there, these stages find the maps, or nothing does."""
        share = self.ends_at if self.problem.levels.known is None else 1 - LEFT * (1 - self.ends_at)
        return self.problem.times.stage_end(self.round, share)

    def _search_of(self, state: State, found: Candidate | None, regime: Regime, seed: int) -> MeasureSearch:
        """The search on the image's measure, which `found` corrects for saturation."""
        masses = self.problem.masses_of(self.round, state.measured_through)
        if found is not None:
            levels = with_camera(self.problem.levels, state.measured_through)
            masses = saturation_corrected(masses, found.code, levels, self.params.saturation, seed)
        return search_on(masses, self.problem.levels.known, regime, self.params, seed, self._smaller_limit(state))

    def _smaller_limit(self, state: State) -> float:
        """Upper limit of a map's smaller singular value. A symmetry of the shape explains its measure as well as the
        identity does. So every other round avoids near-isometries: the first and the third in pictures that others
        drew, and in binary images that may have several rounds; the second in other images, after a code with one."""
        levels = self.problem.levels
        from_start = not levels.is_exact or not levels.is_graded and self.problem.rounds > 1
        has_failed = state.before is not None and _has_isometry(state.before)
        avoided = self.round % 2 == 0 if from_start else self.round % 2 == 1 and has_failed
        return CONTRACTION if self.params.stages.avoid_isometries and avoided else 1.0

    def _draws_within(self, ratio: float, found: Candidate | None) -> bool:
        """Whether a set draws the image to within this noise ratio, so that no further search is needed. It has a right
        number of maps, and none that may be a symmetry of the shape. Other levels than densities do not tell: a wrong
        code may draw them well, or their camera is unknown."""
        levels = self.problem.levels
        if found is None or found.score >= WRONG_NUMBER or not (levels.is_exact and levels.is_density):
            return False
        return not _has_isometry(found) and self.problem.noise_ratio(found) < ratio


def _has_isometry(found: Candidate) -> bool:
    """Whether a map of a code may be a symmetry of the shape."""
    return bool((affine.smaller_singular(found.maps) > CONTRACTION).any())


class Restart(MeasureStage):
    """A search from random maps. At its end, the maps of all restarts so far are mixed: those of this round and, unless
    rounds are independent, of earlier ones."""

    name, part, ends_at = "search", "restart", RESTARTS_END

    @property
    def expected_moves(self) -> int:
        return math.ceil(self.params.search.moves / self.problem.split)

    @property
    def latest_start(self) -> Deadline:
        """The first restart may begin as long as its round lasts, because the later stages need its code."""
        return self.deadline if self.restart else self.problem.times.round_end(self.round)

    def is_wanted(self, state: State) -> bool:
        """False once two restarts of the round agree, or one is near. Short ones agree on wrong maps too often."""
        # above WRONG_NUMBER, the number of maps is wrong
        scores = state.scores if self.problem.split == 1 else ()
        agree = len(scores) > 1 and scores[1] < min(WRONG_NUMBER, (1 + AGREEMENT) * state.leader.score)
        return not agree and not self._draws_within(NEAR, state.best)

    def open(self, state: State) -> State:
        seed = derive(self.problem.seed, *self.stream)
        before = None if self.problem.has_independent_rounds else state.before
        self.search = self._search_of(state, before, Regime.whole(self.params), seed)
        return state.begun(self.search.start)

    @property
    def stream(self) -> tuple[str | int, ...]:
        """The path of the seed. Its word names a random stream: another word gives other numbers."""
        return "island", 1000 * self.problem.split * self.round + int(self.restart)

    def close(self, state: State) -> State:
        found = state.now
        scores, pool = tuple(sorted((*state.scores, found.score))), state.pool_with(found.maps)
        alone = state.best is None and (state.before is None or self.problem.has_independent_rounds)
        candidates = [found] if alone else [state.best or found, found]
        if self.params.search.mixture and not alone:
            candidates.append(self.search.mixed(pool, min(candidates, key=lambda candidate: candidate.score)))
        best = min(candidates, key=lambda candidate: candidate.score)
        return replace(state, best=best, scores=scores, pool=pool)


class FromMixture(MeasureStage):
    """The search from the best mixture, on a measure that the mixture corrects for saturation."""

    name, part, ends_at = "search", "mixture", MIXTURE_ENDS

    @property
    def expected_moves(self) -> int:
        search = self.params.search
        return search.moves if self.problem.split * search.restarts > 1 and search.mixture else 0

    def is_wanted(self, state: State) -> bool:
        """False once a set is so near that the later stages find sooner what it lacks."""
        return not self._draws_within(NEARER, state.best)

    def open(self, state: State) -> State:
        seed = derive(self.problem.seed, "closing", self.round)
        self.search = self._search_of(state, state.best, Regime.whole(self.params), seed)
        return state.begun(lambda: self.search.resume(state.leader))


class Detail(MeasureStage):
    """Stage 2: the search on a finer grid."""

    name, ends_at = "detail", DETAIL_ENDS

    @property
    def expected_moves(self) -> int:
        return self.params.search.detail_moves

    def open(self, state: State) -> State:
        seed = derive(self.problem.seed, "detail", self.round)
        self.search = self._search_of(state, state.best, Regime.detail(self.params), seed)
        return state.begun(lambda: self.search.resume(state.leader))
