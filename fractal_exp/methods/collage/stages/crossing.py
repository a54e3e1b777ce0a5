"""Populations of sets with the given number of maps. The best sets are judged by renderings."""

from __future__ import annotations

from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from ..image.gauss_newton import polished
from ..image.objective import ImageObjective, Rendered
from ..measure.population import Population
from ..moves.tools import Latest
from ..params import CollageParams
from ..state import Candidate, State
from .base import Stage
from .measure import DETAIL_ENDS
from .plan import Plan

POPULATIONS = 5     # most populations, each started from scratch
POPULATION_SIDE = 64   # most pixels per side of the image by which their sets are judged and polished
JUDGED_EVERY = 10   # generations after which the best sets are rendered
JUDGED = 8          # number of sets that are rendered
POLISHED = 3        # number of sets that are polished: those with the best renderings
FIRST_POLISH = 3    # Gauss-Newton steps of each polished set
POLISH = 8          # further steps if the first ones were hopeful
HOPEFUL = 0.3       # share of the error that the first steps leave near the true code
SETTLED = 1.15      # noise ratio up to which a code counts as the true one; above it, another population starts


class Crossing:
    """One population after another on masses (R,R), each for its number of generations, judged by `objective`.

    Every random number derives from the seed and the step's number, so a resumed search is the same as one that never
    stopped.
    """

    def __init__(self, masses: Tensor, objective: ImageObjective, params: CollageParams, *, seed: int = 0,
                 done: int = 0, deadline: Deadline = NO_DEADLINE):
        self.masses, self.objective, self.deadline, self.seed = masses, objective, deadline, seed
        self.all, self.params = params, params.population
        self.noise = Latest(lambda code: objective.noise(code.code))
        self._begin(done // self.params.generations)
        for number in range(done - done % self.params.generations, done):
            self._advance(number)

    def start(self) -> Candidate:
        """The best set of the first population."""
        return self._judged(0).candidate()

    def step(self, now: Candidate, number: int) -> Candidate:
        """`now`, or a better code of the next generation."""
        if number // self.params.generations != self.number:
            self._begin(number // self.params.generations)
        new = [self._judged(i) for i in self._advance(number)]
        new.sort(key=lambda rendered: rendered.error)
        for each in self.deadline.during(new[:POLISHED]):
            found = polished(self.objective, each, FIRST_POLISH, deadline=self.deadline)
            if found.error <= HOPEFUL * each.error:
                found = polished(self.objective, found, POLISH, deadline=self.deadline)
            now = min(now, found.candidate(), key=lambda candidate: candidate.error)
        return now

    def is_settled(self, now: Candidate) -> bool:
        """Whether the code explains the image."""
        return now.error <= SETTLED * self.noise(now)

    def _begin(self, number: int) -> None:
        self.number = number
        assert self.all.maps is not None, "populations are for a given number of maps"
        self.population = Population(self.masses, self.all.maps, self.all, derive(self.seed, "population", number))
        self._seen: set[float] = set()

    def _advance(self, number: int) -> list[int]:
        """Make one generation; return the sets to judge now, without those judged before."""
        self.population.advance()
        if (number + 1) % JUDGED_EVERY:
            return []
        errors = self.population.errors[:JUDGED].tolist()
        new = [i for i, error in enumerate(errors) if error not in self._seen]
        self._seen |= set(errors)
        return new

    def _judged(self, i: int) -> Rendered:
        return self.objective.judge(self.population.maps[i], self.population.probabilities[i])


class Populations(Stage):
    """Crossed populations of sets with the given number of maps, instead of stages 1 and 2 where they search better."""

    name, ends_at = "population", DETAIL_ENDS

    @property
    def expected_moves(self) -> int:
        return self.params.population.generations

    @property
    def most_moves(self) -> int:
        return POPULATIONS * self.expected_moves

    def open(self, state: State) -> State:
        problem, size = self.problem, POPULATION_SIDE
        image = problem.image if len(problem.image) <= size else problem.levels.shrunk(problem.image, size)
        seed = derive(problem.seed, "population", self.round)
        objective = ImageObjective(image, problem.levels, self.params, seed)
        self.search = Crossing(problem.masses, objective, self.params, seed=seed, done=state.step,
                               deadline=self.deadline)
        return state.begun(self.search.start)

    def is_settled(self, state: State) -> bool:
        return self.search.is_settled(state.now)


class CrossedPlan(Plan):
    """The stages of a search with populations."""

    def search(self, number: int) -> list[Stage]:
        return [Populations(self.problem, number)]
