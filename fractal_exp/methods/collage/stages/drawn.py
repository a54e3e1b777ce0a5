"""The stages of a search on a picture that others drew."""

from __future__ import annotations

from dataclasses import replace

import torch

from ....cameras.camera import Camera
from ....cameras.estimate import angle_as_density
from ....cameras.levels import may_be_density
from ....cameras.pens import Drawn
from ....cameras.strokes import as_lines
from ....runtime.seeds import derive
from ..image.camera import Fit, angle_of, in_turns, sharpened
from ..image.gauss_newton import polished
from ..image.objective import ImageObjective, Rendered
from ..maps import WeightedMaps
from ..params.rounding import CanonicalParams
from ..simplify.likeness import likeness_of, without_unseen, worst_error
from ..simplify.needless import without_needless
from ..simplify.parents import flattened, with_fewer_maps
from ..simplify.pruning import Price, pruned
from ..simplify.symmetry import simplest, symmetries
from ..state import Candidate, State
from .base import Stage
from .construction import Construction, is_construction
from .image import ImageMoves
from .measure import Restart
from .plan import Plan
from .problem import SearchProblem
from .rounding import LastDigits

HOPELESS = 0.7   # likeness below which a picture is assumed to show no code, so that no other round begins


class Uncurved(Restart):
    """A restart on the image as a density behind a usual tone curve. The search stays with this measure if the code
    that was found on it explains the image better as a density than the code of the restart before."""

    MEASURED = Camera("tonemapped")

    def __init__(self, problem: SearchProblem, number: int = 0):
        super().__init__(problem, number, 0.5)  # between the first restart and the second

    @staticmethod
    def may_help(problem: SearchProblem) -> bool:
        """Whether an image that others drew may be a density."""
        levels = problem.levels
        return (isinstance(levels, Drawn) and "tonemapped" in levels.kinds and levels.params.curves
                and levels.params.estimate and may_be_density(problem.given))

    def is_wanted(self, state: State) -> bool:
        return True

    def open(self, state: State) -> State:
        opened = super().open(replace(state, measured_through=self.MEASURED))
        return replace(opened, measured_through=state.measured_through)

    def close(self, state: State) -> State:
        found = state.now
        if self._angle(found) >= self._angle(state.leader):
            return state
        return replace(state, best=found, scores=(found.score,), pool=state.pool_with(found.maps),
                       measured_through=self.MEASURED)

    def _angle(self, found: Candidate) -> float:
        problem, seed = self.problem, derive(self.problem.seed, "uncurved")
        return angle_as_density(problem.image, problem.levels, found.code, seed)


class DrawnMoves(ImageMoves):
    """`ImageMoves` for such a picture. The camera is estimated for a code before the code is judged."""

    reached = "the code draws the shape to within a pixel"

    def is_wanted(self, state: State) -> bool:
        """False if `Construction` has explained the picture by tiles or strokes."""
        return state.best is None or self.problem.is_reduced or not is_construction(state.best)

    @property
    def expected_moves(self) -> int:
        return self.params.moves.drawn_count

    @property
    def most_moves(self) -> int:
        return self.expected_moves

    def _first(self, best: Candidate) -> Candidate:
        search = self.search
        return self._seen_anew(search.resume(self._without_doubles(best)))

    def _without_doubles(self, found: Candidate) -> Candidate:
        """The code without maps that only make lines thicker, if at least two others stay."""
        fewer = self.problem.without_doubles(found)
        if len(fewer.maps) == len(found.maps):
            return found
        return self._seen_anew(replace(found, maps=fewer.maps, weights=fewer.weights))

    def _seen_anew(self, found: Candidate) -> Candidate:
        self._search_from(found)
        return self.search.judged(found)

    def _finished(self, found: Candidate) -> Candidate:
        found = self._seen_anew(self._without_doubles(found))
        return self.search.finish(found)

    def _judged_again(self, before: Candidate) -> Candidate:
        return before  # by its own camera

    def _mended(self, wrong: Candidate) -> None:
        """None: it is too early for rounding."""

    def _is_wrong(self, candidate: Candidate) -> bool:
        objective = self.problem.objective(len(self.problem.image), candidate.code, self.problem.seed,
                                           camera=candidate.camera)
        shown = objective.judge(candidate.maps, candidate.weights)
        return HOPELESS <= objective.likeness(shown.image) < self.params.stages.unlike


class DrawnLastDigits(LastDigits):
    """`LastDigits` for such a picture, which determines digits less precisely. Maps that are no
    longer worth their price are removed."""

    @property
    def canonical(self) -> CanonicalParams:
        return self.params.canonical.of_drawn()

    def _objective_for(self, found: Candidate) -> ImageObjective:
        return super()._objective_for(found).hasty()  # the camera is less certain than the points of one rendering

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
        lines = objective.judge(as_lines(found.code).to(found.maps), found.weights)
        return lines if lines.error <= worst_error(objective, found) else found

    def _sharpened(self, start: Rendered) -> Fit:
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
        params, deadline = self.params.canonical, self.problem.deadline
        simple = WeightedMaps(simplest(found.maps, symmetries(objective.image.cpu(), params), params), found.weights)
        single = self.problem.without_doubles(simple)  # mirrored, two maps of a symmetric shape may be one
        other = polished(objective, objective.judge(single.maps, single.weights), params.polish, deadline=deadline)
        if self.params.maps:
            return other
        return with_fewer_maps(objective, other, Price(0.0, self.params.moves.worth), params.polish, deadline)

    def _on_line(self, seen: Fit) -> Fit:
        """The code with similarities in the place of its maps, and the camera that suits it, if the shape lies on a
        line and the similarities explain the picture about as well.

        What maps do across the line may draw a pen's width, because points of a near isometry take long to reach the
        line. The polish of code and camera brings some of it back, so the maps are replaced again after it."""
        flat = flattened(*seen)
        if torch.equal(flat, seen[1].maps):
            return seen
        objective, found = sharpened(seen[0], seen[0].judge(flat, seen[1].weights), self.problem.deadline)
        other = objective, objective.judge(flattened(objective, found), found.weights)
        return other if angle_of(other)**2 <= self.params.canonical.drawn_worse * angle_of(seen)**2 else seen

    def _is_far(self, found: Candidate) -> bool:
        shown = self.objective.judge(found.maps, found.weights)
        return self.objective.likeness(shown.image) < self.params.stages.unlike


class DrawnPlan(Plan):
    """The stages for such a picture. The first round may measure it as a density, and looks for a construction."""

    rounding = DrawnLastDigits

    def search(self, number: int) -> list[Stage]:
        restart, *others = super().search(number)
        curved = [Uncurved(self.problem)] if not number and Uncurved.may_help(self.problem) else []
        return [restart, *curved, *others]

    def moves(self, number: int) -> list[Stage]:
        constructed = [Construction(self.problem)] if not number and Construction.may_help(self.problem) else []
        return [*constructed, DrawnMoves(self.problem, number)]
