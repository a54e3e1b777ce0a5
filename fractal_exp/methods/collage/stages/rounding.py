"""The stage that gives a nearly right code simple numbers, its symmetry and its exact frame."""

from __future__ import annotations

from dataclasses import replace

from ....runtime.deadline import Deadline
from ....runtime.seeds import derive
from ..camera.tones import camera_of
from ..image.frame import FAR
from ..simplify.drawn import simplest
from ..simplify.loop import Draft
from ..simplify.rounding import begun, rounded
from ..state import Candidate, State
from .base import Stage

NEAR_ERROR = 0.5   # error up to which codes are rounded whatever the noise ratio: noise is low in large images


class Rounding(Stage):
    """Round a nearly right code to simple numbers and make it fill the frame exactly."""

    name, ends_at = "rounding", "rounding_share"

    @property
    def deadline(self) -> Deadline:
        return self.problem.deadline.until(self.params.stages.rounding_share)

    def open(self, state: State) -> None:
        large = self.problem.full_side > self.params.stages.largest_side
        renderings = 1 if large else self.params.image.last_renderings
        self.objective = self.problem.objective(self.problem.full_side, state.found.code,
                                                derive(self.problem.seed, "last digits"), renderings,
                                                state.found.camera)

    def begin(self, state: State) -> Candidate:
        found = state.found
        if self._is_far(found):
            return found
        last = self._rounded(Draft(self.objective, self.objective.judge(found.maps, found.weights)))
        shown = last.shown
        weights = None if shown.weights is None else shown.probabilities
        return Candidate(shown.maps, weights, shown.error, shown.error, camera_of(last.objective.levels))

    def _rounded(self, start: Draft) -> Draft:
        return rounded(begun(start.objective, start.shown), self.problem.deadline)

    def _is_far(self, found: Candidate) -> bool:
        """Whether the code is too far off for simple numbers to mean anything."""
        hasty = self.objective.hasty()
        shown = hasty.judge(found.maps, found.weights)
        return shown.error > max(FAR * hasty.noise(found.code), NEAR_ERROR)

    def close(self, state: State) -> State:
        return replace(state, best=state.current, before=None)


class DrawnRounding(Rounding):
    """`Rounding` for a picture that others drew, which determines digits less precisely. The code may also become
    simpler in other ways."""

    def open(self, state: State) -> None:
        super().open(state)
        self.objective = self.objective.hasty()  # the camera is less certain than the points of one rendering

    def _rounded(self, start: Draft) -> Draft:
        return simplest(start, self.problem.deadline)

    def _is_far(self, found: Candidate) -> bool:
        shown = self.objective.judge(found.maps, found.weights)
        return self.objective.likeness(shown.image) < self.params.stages.unlike
