"""The stage in which a code that draws its picture comes to fill the picture's frame as well."""

from __future__ import annotations

from dataclasses import replace

from ..seeds import derive
from . import maps as affine
from .frame import Frame
from .picture import Picture
from .picture_search import DRAWINGS
from .polish import FRAMED
from .search import Tiling
from .stages import WRONG, Stage, Work, picture_search

MISSED_PX = 0.5   # of the frame: worth a search


class Framing(Stage):
    """Where a code draws the picture nearly as well as the true one would, and yet its attractor misses the frame, a
    tip too faint to be seen is wrong: moves are judged with the frame then. What comes of them is kept only if the
    picture is drawn as well as before, in drawings that neither code was fitted to, and half of what was missed is
    gone: a frame that is not the attractor's, as in picture files that were centred by what is lit, bends every code.
    """

    name, ends = "frame", 0.97

    def open(self, work: Work) -> None:
        self.search = picture_search(self.problem, work.result.code, "frame")
        self.search.late = lambda: self.problem.part() >= self.ends  # what follows on a large picture matters more
        self.frame = Frame.of(self.search.picture.image)
        self.wanted = (self.frame is not None and self._missed(work.result) > MISSED_PX
                       and self.search.noises(self.search.judged(work.result)) < WRONG)
        if self.wanted:
            self.search.picture = self.search.picture.within(self.frame)

    def begin(self, work: Work) -> Tiling:
        return self.search.polished(work.result) if self.wanted else work.result

    def settled(self, now: Tiling, moves: int) -> bool:
        return not self.wanted or self.search.settled(now, moves)

    def close(self, work: Work) -> Work:
        best = work.result
        if self.wanted:
            found = self.search.finish(work.tiling)
            if self._missed(found) < self._missed(best) / 2 and self._seen(found) < FRAMED * self._seen(best):
                self.search.picture = self.search.picture.within(None)
                best = self.search.judged(found)
        return replace(work.done(best), before=None)

    def _missed(self, tiling: Tiling) -> float:
        """By how much the attractor misses the frame, pixels."""
        return float(self.frame.misfit(tiling.maps, affine.normalized(tiling.weights)).abs().max())

    def _seen(self, tiling: Tiling) -> float:
        """The score of other drawings than those that were polished."""
        picture = self.search.picture
        other = Picture(picture.image, picture.levels, derive(picture.seed, "others"), DRAWINGS)
        return other.judge(tiling.maps, tiling.chances).error + self.search.price * len(tiling.maps)
