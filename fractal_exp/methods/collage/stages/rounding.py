"""The stage that gives a nearly right code simple numbers, its symmetry and its exact frame."""

from __future__ import annotations

from dataclasses import replace

from ....runtime.seeds import derive
from ..image.frame import FAR
from ..image.objective import ImageObjective
from ..simplify.loop import Draft
from ..simplify.rounding import begun, rounded
from ..state import Candidate, State
from .base import Stage

ENDS = 0.99        # share of the time limit from which codes are not rounded
NEAR_ERROR = 0.5   # error up to which codes are rounded whatever the noise ratio: noise is low in large images


class Rounding(Stage):
    """Round a nearly right code to simple numbers and make it fill the frame exactly."""

    name, ends_at = "rounding", ENDS

    def open(self, state: State) -> State:
        self.objective = self._objective_for(state.found)
        return state.begun(lambda: self._unless_far(state.found))

    def _objective_for(self, found: Candidate) -> ImageObjective:
        large = self.problem.full_side > self.params.stages.largest_side
        renderings = 1 if large else self.params.image.last_renderings
        return self.problem.objective(self.problem.full_side, found.code, derive(self.problem.seed, "last digits"),
                                      renderings, found.camera)

    def _unless_far(self, found: Candidate) -> Candidate:
        if self._is_far(found):
            return found
        last = self._rounded(Draft(self.objective, self.objective.judge(found.maps, found.weights)))
        shown = last.shown
        weights = None if shown.weights is None else shown.probabilities
        return Candidate(shown.maps, weights, shown.error, shown.error, last.objective.levels.camera)

    def _rounded(self, start: Draft) -> Draft:
        return rounded(begun(start.objective, start.shown), self.problem.deadline)

    def _is_far(self, found: Candidate) -> bool:
        """Whether the code is too far off for simple numbers to mean anything."""
        hasty = self.objective.hasty()
        shown = hasty.judge(found.maps, found.weights)
        return shown.error > max(FAR * hasty.noise(found.code), NEAR_ERROR)

    def close(self, state: State) -> State:
        return replace(state, best=state.current, before=None)
