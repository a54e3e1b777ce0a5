"""The stage that gives a nearly right code simple numbers, its symmetry and its exact frame."""

from __future__ import annotations

from dataclasses import replace

from ....runtime.seeds import derive
from ..image.objective import ImageObjective, Rendered
from ..params.rounding import CanonicalParams
from ..simplify.rounding import Rounding
from ..state import Candidate, State
from .base import Stage

DIGITS_END = 0.99   # share of the time limit from which the last digits are left as they are


class LastDigits(Stage):
    """Round a nearly right code to simple numbers and make it fill the frame exactly."""

    name, ends_at = "last digits", DIGITS_END

    @property
    def canonical(self) -> CanonicalParams:
        return self.params.canonical

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
        last = self._rounded(self.objective.judge(found.maps, found.weights))
        weights = None if last.weights is None else last.probabilities
        return Candidate(last.maps, weights, last.error, last.error, self.objective.levels.camera)

    def _rounded(self, start: Rendered) -> Rendered:
        return Rounding(self.objective, self.problem.deadline, self.canonical)(start)

    def _is_far(self, found: Candidate) -> bool:
        """Whether the code is too far off for simple numbers to mean anything."""
        hasty = self.objective.hasty()
        shown = hasty.judge(found.maps, found.weights)
        return shown.error > max(self.params.frame.far * hasty.noise(found.code), self.params.canonical.near_error)

    def close(self, state: State) -> State:
        return replace(state, best=state.current, before=None)
