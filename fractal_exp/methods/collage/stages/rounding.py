"""The stage that gives a nearly right code simple numbers, its symmetry and its exact frame."""

from __future__ import annotations

from dataclasses import replace

import torch

from ....runtime.deadline import Deadline
from ....runtime.seeds import derive
from ..camera.strokes import as_lines
from ..camera.tones import camera_of
from ..image.camera import Seen, angle_of, in_turns, sharpened
from ..image.gauss_newton import polished
from ..image.objective import ImageObjective, Rendered
from ..maps import WeightedMaps
from ..params.rounding import RoundingParams
from ..simplify.likeness import likeness_of, without_unseen, worst_error
from ..simplify.needless import without_needless
from ..simplify.parents import flattened, with_fewer_maps
from ..simplify.pruning import Price, pruned
from ..simplify.rounding import Rounding as Rounder
from ..simplify.symmetry import simplest, symmetries
from ..state import Candidate, State
from .base import Stage


class Rounding(Stage):
    """Round a nearly right code to simple numbers and make it fill the frame exactly."""

    name, ends_at = "rounding", "rounding_share"

    @property
    def deadline(self) -> Deadline:
        return self.problem.deadline.until(self.params.stages.rounding_share)

    @property
    def rounding(self) -> RoundingParams:
        return self.params.rounding

    def open(self, state: State) -> None:
        large = self.problem.full_side > self.params.stages.largest_side
        renderings = 1 if large else self.params.image.last_renderings
        self.objective = self.problem.objective(self.problem.full_side, state.found.code,
                                                derive(self.problem.seed, "rounding"), renderings,
                                                state.found.camera)

    def begin(self, state: State) -> Candidate:
        found = state.found
        if self._is_far(found):
            return found
        last = self._rounded(self.objective.judge(found.maps, found.weights))
        weights = None if last.weights is None else last.probabilities
        return Candidate(last.maps, weights, last.error, last.error, camera_of(self.objective.levels))

    def _rounded(self, start: Rendered) -> Rendered:
        return Rounder(self.objective, self.problem.deadline, self.rounding)(start)

    def _is_far(self, found: Candidate) -> bool:
        """Whether the code is too far off for simple numbers to mean anything."""
        hasty = self.objective.hasty()
        shown = hasty.judge(found.maps, found.weights)
        return shown.error > max(self.params.frame.far * hasty.noise(found.code), self.params.rounding.near_error)

    def close(self, state: State) -> State:
        return replace(state, best=state.current, before=None)


class DrawnRounding(Rounding):
    """`Rounding` for a picture that others drew, which determines digits less precisely. Maps that are no
    longer worth their price are removed."""

    @property
    def rounding(self) -> RoundingParams:
        return self.params.rounding.of_drawn()

    def open(self, state: State) -> None:
        super().open(state)
        self.objective = self.objective.hasty()  # the camera is less certain than the points of one rendering

    def _rounded(self, start: Rendered) -> Rendered:
        before = self.objective
        seen = self._on_line(self._sharpened(start))
        self.objective, needed = without_needless(seen, self.params.maps or 0, self.problem.deadline)
        if needed is not seen[1]:
            self.objective, needed = in_turns(self.objective, needed, self.problem.deadline)
        last = pruned(self.objective, super()._rounded(needed), Price(0.0, self.params.moves.worth),
                      self.params.maps or 0, deadline=self.problem.deadline)
        last = self._without_width(last)
        if likeness_of(last, self.objective) >= min(self.params.stages.unlike, likeness_of(start, before)):
            return last
        self.objective = before  # tiles may draw the picture of a code whose attractor is another shape
        return start

    def _without_width(self, found: Rendered) -> Rendered:
        """The code with strokes that have no width. A drawing by strokes does not tell their widths."""
        objective = self.objective
        if objective.levels.is_whole:
            return found
        lines = objective.judge(as_lines(found.code, self.params.camera).to(found.maps), found.weights)
        return lines if lines.error <= worst_error(objective, found) else found

    def _sharpened(self, start: Rendered) -> Seen:
        """The simplest code with the camera that suits it, unless the code so far explains the picture notably better.
        If its error is higher with the camera of the code so far, it must be lower with its own."""
        objective, params, deadline = self.objective, self.params, self.problem.deadline
        found = without_unseen(objective, start, params.maps or 0, deadline)
        objective, found = without_needless((objective, found), params.maps or 0, deadline, contained=True)
        simple = self._simplest(objective, found)
        if simple.error <= worst_error(objective, found):
            return sharpened(objective, simple, deadline)
        if objective.likeness(simple.image) >= params.stages.unlike:
            seen = sharpened(objective, simple, deadline)
            if angle_of(seen) <= objective.angle(found.error):
                return seen
        return sharpened(objective, found, deadline)

    def _simplest(self, objective: ImageObjective, found: Rendered) -> Rendered:
        """The simplest code for the shape. Codes may differ by symmetries of the shape, by doubles, and by parents in
        the place of maps."""
        params, deadline = self.params.rounding, self.problem.deadline
        simple = WeightedMaps(simplest(found.maps, symmetries(objective.image.cpu(), params), params), found.weights)
        single = self.problem.without_doubles(simple)  # mirrored, two maps of a symmetric shape may be one
        other = polished(objective, objective.judge(single.maps, single.weights), params.polish, deadline=deadline)
        if self.params.maps:
            return other
        return with_fewer_maps(objective, other, Price(0.0, self.params.moves.worth), params.polish, deadline)

    def _on_line(self, seen: Seen) -> Seen:
        """The code with similarities in the place of its maps, and the camera that suits it, if the shape lies on a
        line and the similarities explain the picture about as well.

        What maps do across the line may draw a pen's width, because points of a near isometry take long to reach the
        line. The polish of code and camera brings some of it back, so the maps are replaced again after it."""
        flat = flattened(*seen)
        if torch.equal(flat, seen[1].maps):
            return seen
        objective, found = sharpened(seen[0], seen[0].judge(flat, seen[1].weights), self.problem.deadline)
        other = objective, objective.judge(flattened(objective, found), found.weights)
        return other if angle_of(other)**2 <= self.params.rounding.drawn_worse * angle_of(seen)**2 else seen

    def _is_far(self, found: Candidate) -> bool:
        shown = self.objective.judge(found.maps, found.weights)
        return self.objective.likeness(shown.image) < self.params.stages.unlike
