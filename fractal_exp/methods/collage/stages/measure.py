"""The stages that search on the image's measure, from random maps to a set from which stage 3 can continue."""

from __future__ import annotations

from dataclasses import replace

from ....cameras.camera import Camera
from ....cameras.estimate import angle_as_density
from ....cameras.levels import may_be_density
from ....cameras.pens import Drawn
from ....runtime.deadline import Deadline
from ....runtime.seeds import derive
from ..image.objective import ImageObjective
from ..measure.search import WRONG_NUMBER, MeasureSearch, Regime
from ..state import Candidate, Key, State
from .base import Stage
from .crossing import Crossing
from .problem import SearchProblem

AGREEMENT = 0.02        # relative difference of scores below which two restarts agree; the others are then skipped
POPULATIONS = 5         # maximum number of populations, each started from scratch
POPULATION_SIDE = 64    # maximum side, pixels, of the image by which their sets are judged and polished


class Restart(Stage[MeasureSearch]):
    """A search from random maps. At its end, the maps of all restarts so far are mixed: those of this round and, unless
    rounds are independent, of earlier ones."""

    name, part, ends_at = "search", "restart", "search_share"

    @property
    def expected_moves(self) -> int:
        return self.params.search.moves

    @property
    def latest_start(self) -> Deadline:
        """The first restart may begin as long as its round lasts, because the later stages need its code."""
        return self.deadline if self.key.restart else self._until("image_share")

    def is_wanted(self, state: State) -> bool:
        """False once two restarts of the round agree."""
        if len(state.scores) < 2:
            return True
        # above WRONG_NUMBER, the number of maps is wrong
        limit = min(WRONG_NUMBER, (1 + AGREEMENT) * state.leader.score)
        return state.scores[1] >= limit

    def open(self, state: State) -> None:
        # the words in seed paths name random streams: another word gives other numbers
        seed = derive(self.problem.seed, "island", 1000 * self.round + self.restart)
        before = None if self.problem.has_independent_rounds else state.before
        self.search = self._measure_search(state, before, Regime.whole(self.params), seed)

    def begin(self, state: State) -> Candidate:
        return self.search.start()

    def close(self, state: State) -> State:
        found = state.now
        scores, pool = tuple(sorted((*state.scores, found.score))), state.pool_with(found.maps)
        alone = state.best is None and (state.before is None or self.problem.has_independent_rounds)
        candidates = [found] if alone else [state.best or found, found]
        if self.params.search.mixture and not alone:
            candidates.append(self.search.mixed(pool))
        best = min(candidates, key=lambda candidate: candidate.score)
        return replace(state, best=best, scores=scores, pool=pool)


class Uncurved(Restart):
    """A restart on the image as a density behind a usual tone curve. The search stays with this measure if the code
    that was found on it explains the image better as a density than the code of the restart before."""

    MEASURED = Camera("tonemapped")

    @property
    def key(self) -> Key:
        """Between the first restart and the second, whose random numbers stay the same."""
        return Key(self.round, self.part, self.restart + 0.5)

    @staticmethod
    def may_help(problem: SearchProblem) -> bool:
        """Whether an image that others drew may be a density."""
        levels = problem.levels
        return (isinstance(levels, Drawn) and "tonemapped" in levels.kinds and levels.params.curves
                and levels.params.estimate and may_be_density(problem.given))

    def is_wanted(self, state: State) -> bool:
        return True

    def open(self, state: State) -> None:
        super().open(replace(state, measured_through=self.MEASURED))

    def close(self, state: State) -> State:
        found = state.now
        if self._angle(found) >= self._angle(state.leader):
            return state
        return replace(state, best=found, scores=(found.score,), pool=state.pool_with(found.maps),
                       measured_through=self.MEASURED)

    def _angle(self, found: Candidate) -> float:
        problem, seed = self.problem, derive(self.problem.seed, "uncurved")
        return angle_as_density(problem.image, problem.levels, found.code, seed)


class FromMixture(Stage[MeasureSearch]):
    """The search from the best mixture, on a measure that the mixture corrects for saturation."""

    name, part, ends_at = "search", "mixture", "mixture_share"

    @property
    def expected_moves(self) -> int:
        search = self.params.search
        return search.moves if search.restarts > 1 and search.mixture else 0

    def open(self, state: State) -> None:
        seed = derive(self.problem.seed, "closing", self.round)
        self.search = self._measure_search(state, state.best, Regime.whole(self.params), seed)

    def begin(self, state: State) -> Candidate:
        return self.search.resume(state.leader)


class Detail(Stage[MeasureSearch]):
    """Stage 2: the search on a finer grid."""

    name, ends_at = "detail", "detail_share"

    @property
    def expected_moves(self) -> int:
        return self.params.search.detail_moves

    def open(self, state: State) -> None:
        seed = derive(self.problem.seed, "detail", self.round)
        self.search = self._measure_search(state, state.best, Regime.detail(self.params), seed)

    def begin(self, state: State) -> Candidate:
        return self.search.resume(state.leader)


class Populations(Stage[Crossing]):
    """Crossed populations of sets with the given number of maps, instead of stages 1 and 2 where they search better."""

    name, ends_at = "population", "detail_share"

    @property
    def expected_moves(self) -> int:
        return self.params.population.generations

    @property
    def most_moves(self) -> int:
        return POPULATIONS * self.expected_moves

    def open(self, state: State) -> None:
        problem, size = self.problem, POPULATION_SIDE
        image = problem.image if len(problem.image) <= size else problem.levels.shrunk(problem.image, size)
        seed = derive(problem.seed, "population", self.round)
        objective = ImageObjective(image, problem.levels, self.params, seed)
        self.search = Crossing(problem.masses, objective, self.params, seed=seed, done=state.step,
                               deadline=self.deadline)

    def begin(self, state: State) -> Candidate:
        return self.search.start()

    def is_settled(self, state: State) -> bool:
        return self.search.is_settled(state.now)
