"""Growth as a stage of the search, for shapes that show no code."""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

from ....cameras.estimate import showing
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from ..growth.growing import Grower
from ..state import Candidate, Grown, State
from .base import SearchProblem, Stage

UNLIKE = 0.9    # likeness below which maps are grown and compared with what the search found
MARGIN = 0.02   # minimum gain in likeness for grown maps to replace what the search found


class Growth(Stage):
    """Each move grows one number of maps on the curve of likeness. At the end, the stage chooses between the found and
    the grown sets. It is skipped if the search found the code."""

    name = "growth"

    def __init__(self, problem: SearchProblem, number: int = 0, restart: float = 0):
        super().__init__(problem, number, restart)
        self.counts = self._counts()

    def _counts(self) -> list[int]:
        params, growth = self.params, self.params.growth
        last = params.maps or params.most_maps or (max(growth.counts) if params.likeness else growth.usual)
        hurried = self.problem.deadline.seconds is not None
        return [*([] if hurried else [count for count in growth.counts if count < last]), last]

    @property
    def expected_moves(self) -> int:
        return len(self.counts) if self.params.grows_at_once else 0

    @property
    def most_moves(self) -> int:
        return len(self.counts)

    @property
    def deadline(self) -> Deadline:
        """No deadline: even if time is up, there is at least a plain paving. Its refinement ends in time."""
        return NO_DEADLINE

    def is_wanted(self, state: State) -> bool:
        found = state.result
        if found is None or state.current is not None:
            return True
        likeness = self._likeness(found)
        if likeness < (self.params.likeness or 0):
            return True
        return likeness < UNLIKE and not self._explains_rendering(found)

    @cached_property
    def grower(self) -> Grower:
        """What draws and grows sets for the image, whatever the search has found."""
        problem = self.problem
        return Grower(problem.image, self.params, derive(problem.seed, "growth"), problem.deadline)

    def open(self, state: State) -> State:
        return state.begun(lambda: state.result or self._candidate(self.grower.plain(self.counts[0])))

    def move(self, state: State) -> State:
        grown = self.grower.grown(self.counts[state.step], state.curve[-1] if state.curve else None)
        return replace(state.moved(self._candidate(grown)), curve=(*state.curve, grown))

    def is_settled(self, state: State) -> bool:
        return bool(state.curve) and state.curve[-1].likeness >= self._goal

    def close(self, state: State) -> State:
        found, chosen = state.result, self._chosen(state.curve)
        grown, likeness = self._drawn(chosen)
        if found is not None and self.params.maps in (None, len(found.maps)) and (
                likeness < self._likeness(found) + MARGIN or self._draws_better(found, chosen)):
            return replace(state, best=found, before=None)
        return replace(state, best=grown, before=None,
                       stopped=f"{len(chosen.maps)} maps were grown, F1 {likeness:.3f} within a pixel")

    def _drawn(self, chosen: Grown) -> tuple[Candidate, float]:
        """Grown maps with the camera that shows them best, and the likeness of what it draws."""
        problem, seed = self.problem, derive(self.problem.seed, "grown")
        camera = showing(problem.image, problem.levels, chosen.code, seed)
        objective = problem.objective(len(problem.image), chosen.code, seed, camera=camera)
        shown = objective.judge(chosen.maps, chosen.weights)
        drawn = Candidate(chosen.maps, chosen.weights, shown.error, shown.error, camera)
        return drawn, chosen.likeness if problem.levels.is_exact else objective.likeness_of(shown)

    def _draws_better(self, found: Candidate, grown: Grown) -> bool:
        """Whether what the search found draws a binary image well, and with less error than the grown maps do. The
        grown maps may have a higher likeness even so, because likeness looks at where a code has points at all."""
        problem = self.problem
        if problem.levels.is_graded or self.params.likeness:
            return False
        objective = problem.objective(len(problem.image), found.code, derive(problem.seed, "found"))
        shown, other = (objective.judge(each.maps, each.weights) for each in (found, grown))
        return shown.error < other.error and objective.likeness(shown.image) >= UNLIKE

    def _likeness(self, found: Candidate) -> float:
        """The likeness (F1 within a pixel) of what the search found."""
        problem = self.problem
        if problem.levels.is_exact:
            return self.grower.likeness(found)
        objective = problem.objective(len(problem.image), found.code, derive(problem.seed, "found"),
                                      camera=found.camera)
        return objective.likeness_of(objective.judge(found.maps, found.weights))

    def _explains_rendering(self, found: Candidate) -> bool:
        """Whether what the search found renders a density or a binary image roughly. Its likeness is then no reason to
        grow maps: the likeness looks at where the code has points at all, which is more than such an image shows, and
        grown maps draw everything evenly."""
        problem = self.problem
        if not problem.levels.is_exact:
            return False
        objective = problem.objective(len(problem.image), found.code, derive(problem.seed, "found"))
        return not objective.is_hopeless(objective.judge(found.maps, found.weights).error)

    @property
    def _goal(self) -> float:
        """The likeness at which growth ends; infinite if the number of maps is given."""
        if self.params.maps or self.params.most_maps:
            return float("inf")
        return self.params.likeness or self.params.growth.enough

    def _chosen(self, curve: tuple[Grown, ...]) -> Grown:
        """The first set that reaches the goal, or else the one of highest likeness; of those with the given number of
        maps, if there is one."""
        fitting = [each for each in curve if self.params.maps in (None, len(each.maps))]
        reached = [each for each in fitting if each.likeness >= self._goal]
        return reached[0] if reached else max(fitting, key=lambda each: each.likeness)

    @staticmethod
    def _candidate(grown: Grown) -> Candidate:
        return Candidate(grown.maps, grown.weights, 1 - grown.likeness, 1 - grown.likeness)
