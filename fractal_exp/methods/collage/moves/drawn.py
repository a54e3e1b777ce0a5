"""The search by renderings for the code of a picture that others drew."""

from __future__ import annotations

from ....evaluation.inside import f1_dark
from ....likeness import ALIKE, ALIKE_DARK
from ..image.objective import Rendered
from ..simplify.parents import fewer
from ..state import Candidate
from .search import ImageSearch

LEAST_MOVES = 8   # after which a code may be settled


class DrawnSearch(ImageSearch):
    """`ImageSearch` for such a picture: no camera draws quite like it, so a likeness says when to stop, and its noise
    is no reason to polish on."""

    def first_pruned(self, first: Rendered) -> Rendered:
        """The best of the code pruned, with roots, and with parents: at the price of a map in such a picture, pruning
        may remove maps that a root needs."""
        return min(super().first_pruned(first), self.rooted(first), self.simpler(first, fewer), key=self.score)

    def last_polished(self, now: Candidate) -> Candidate:
        return self.cleaned(now)

    def is_settled(self, now: Candidate, moves: int) -> bool:
        """Whether the code's rendering is so like the picture that this is no accident. What is dark inside the shape
        counts too: a filled square lies within a pixel of a T-square."""
        if moves < LEAST_MOVES or len(now.maps) < (self.params.maps or 0):
            return False
        objective, drawn = self.objective, self.shown(now).image
        if objective.likeness(drawn) < ALIKE:
            return False
        dark = f1_dark(drawn, objective.image, objective.levels.lit_above)
        return dark is None or dark >= ALIKE_DARK
