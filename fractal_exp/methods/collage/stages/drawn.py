"""The stages of a search on a picture that others drew."""

from __future__ import annotations

from dataclasses import replace

from ..state import Candidate, State
from .base import Stage
from .construction import Recursion, is_construction
from .image import ImageMoves
from .measure import Uncurved
from .plan import Plan
from .rounding import DrawnLastDigits

HOPELESS = 0.7   # likeness below which a picture is assumed to show no code, so that no other round begins


class DrawnMoves(ImageMoves):
    """`ImageMoves` for such a picture. The camera is estimated for a code before the code is judged."""

    reached = "the code draws the shape to within a pixel"

    def is_wanted(self, state: State) -> bool:
        """False if `Recursion` has explained the picture by tiles or strokes."""
        tiled = self.params.camera.tiled_maps
        return state.best is None or self.problem.is_reduced or not is_construction(state.best, tiled)

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


class DrawnPlan(Plan):
    """The stages for such a picture. The first round may measure it as a density, and looks for a construction."""

    rounding = DrawnLastDigits

    def search(self, number: int) -> list[Stage]:
        restart, *others = super().search(number)
        curved = [Uncurved(self.problem)] if not number and Uncurved.may_help(self.problem) else []
        return [restart, *curved, *others]

    def moves(self, number: int) -> list[Stage]:
        constructed = [Recursion(self.problem)] if not number and Recursion.may_help(self.problem) else []
        return [*constructed, DrawnMoves(self.problem, number)]
