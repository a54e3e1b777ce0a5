"""The stages of a search on a picture that others drew."""

from __future__ import annotations

from dataclasses import replace

from ....cameras.camera import Camera
from ....cameras.levels import may_be_density, may_be_dots
from ....cameras.pens import Dots, ToneMapped
from ....likeness import UNLIKE
from ..image.objective import ImageObjective
from ..simplify.drawn import simplified_in_every_way
from ..simplify.loop import Draft
from ..simplify.removal import without_doubles
from ..state import Candidate, State
from .base import SearchProblem, Stage
from .construction import Construction, is_construction
from .growth import Promise, Sketch
from .image import ImageMoves, Rounding
from .measure import Restart
from .plan import Plan

HOPELESS = 0.7   # likeness below which a picture is assumed to show no code, so that no other round begins


class AsDensity(Restart):
    """A restart on the image as a density that a camera of this kind sees. The search stays with this measure if the
    code that was found on it explains the image better as a density than the best code before. copy: from 0; each has
    random numbers of its own."""

    def __init__(self, problem: SearchProblem, kind: str, restart: float, copy: int = 0):
        super().__init__(problem, 0, restart)
        self.measured, self.copy = Camera(kind), copy

    @staticmethod
    def all_of(problem: SearchProblem) -> list[AsDensity]:
        """Those that may help, between the first restart and the second, on an image that others drew."""
        levels, image = problem.levels, problem.image
        kinds = {Dots.kind: may_be_dots(image), ToneMapped.kind: levels.params.curves and may_be_density(image)}
        wanted = [kind for kind, may_be in kinds.items()
                  if may_be and kind in levels.kinds and kind != levels.kind and levels.params.estimate]
        each = [(kind, copy) for copy in range(problem.split) for kind in wanted]
        return [AsDensity(problem, kind, (k + 1) / (len(each) + 1), copy) for k, (kind, copy) in enumerate(each)]

    @property
    def stream(self) -> tuple[str | int, ...]:
        return (*super().stream, *([self.copy] if self.copy else []))

    def is_wanted(self, state: State) -> bool:
        return True

    def open(self, state: State) -> State:
        opened = super().open(replace(state, measured_through=self.measured))
        return replace(opened, measured_through=state.measured_through)

    def close(self, state: State) -> State:
        found = state.now
        angle = self.problem.angle_as_density
        if angle(found.code) >= angle(state.leader.code):
            return state
        return replace(state, best=found, scores=(found.score,), pool=state.pool_with(found.maps),
                       measured_through=self.measured)


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
        fewer = without_doubles(found, self.params, len(self.problem.image), self.problem.seed)
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
        return HOPELESS <= objective.likeness(shown.image) < UNLIKE


class DrawnRounding(Rounding):
    """`Rounding` for such a picture, which determines digits less precisely. The code may also become simpler in other
    ways."""

    def _objective_for(self, found: Candidate) -> ImageObjective:
        return super()._objective_for(found).hasty()  # the camera is less certain than the points of one rendering

    def _rounded(self, start: Draft) -> Draft:
        return simplified_in_every_way(start, self.problem.deadline)

    def _is_far(self, found: Candidate) -> bool:
        shown = self.objective.judge(found.maps, found.weights)
        return self.objective.likeness(shown.image) < UNLIKE


class DrawnPlan(Plan):
    """The stages for such a picture. The first round may measure it as a density, and looks for a construction, unless
    the picture is grey inside: a photograph would take minutes of that."""

    rounding = DrawnRounding

    def search(self, number: int) -> list[Stage]:
        restart, *others = super().search(number)
        found = [restart, *([] if number else AsDensity.all_of(self.problem)), *others]
        return [Sketch(self.problem), *found, Promise(self.problem)] if not number and Sketch.may_help(
            self.problem) else found

    def moves(self, number: int) -> list[Stage]:
        wanted = not number and Construction.may_help(self.problem) and not Sketch.may_help(self.problem)
        return [*([Construction(self.problem)] if wanted else []), DrawnMoves(self.problem, number)]
