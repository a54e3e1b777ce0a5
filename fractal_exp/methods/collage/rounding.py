"""Entries near to simple numbers are rounded, if the picture allows it.

A picture tells a matrix to some hundredths of a pixel, and how a line came to be next to not. Where simple numbers are
so near and draw the picture as well, they are likelier than those found (the shorter description; Rissanen 1978).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import torch
from torch import Tensor

from .frame import Frame
from .jacobian import Jacobian, Played, Redrawn
from .picture import Drawn, Picture
from .polish import fitted_into_frame, never, polished
from .simple_maps import EDGE, Line, Spread, mirrored_offsets

WORSE = 1.02              # times the least error so far, that rounding may cost: what was found follows its picture's
                          # noise. Making a line must cost nothing, since of many one is chosen,
MIRRORED = 1.05           # making a code symmetric may cost more, since it fixes many numbers at once, and filling the
FILLED = 1.2              # frame exactly yet more, since of tips that no picture shows nothing else tells
LIKELY, STEPS = 3, 3      # lines that are polished, in so many steps,
POLISH = 8                # and of all maps, what is not rounded
FRAMED_PX, EXACT_PX = 0.5, 0.002   # misfit of a frame that is meant to be filled, and sigma of one that is
NUDGES = 0, 1e-6, -1e-6, 1e-5, -1e-5, 5e-5, -5e-5   # of the size of a shape that may end at edges of pixels

Held = frozenset[tuple[int, int]]   # entries (map, column) that are simple


class Rounding:
    """Of codes that nearly draw the picture; late: whether time is up."""

    def __init__(self, picture: Picture, late: Callable[[], bool] = never):
        self.picture, self.late, self.frame = picture, late, Frame.of(picture.image)
        self._least = float("inf")

    def __call__(self, start: Drawn) -> Drawn:
        """The drawing with the frame filled exactly, all that is simple rounded and what is nearly its own mirror image
        made so, each unless it is drawn worse."""
        best, held = self.simplified(self._filled(start, frozenset()))
        best = self._symmetric(best)
        return self._symmetric(self._filled(best, held)) if held else best

    def simplified(self, start: Drawn) -> tuple[Drawn, Held]:
        """The drawing with all that is simple rounded, unless it is drawn worse, and what was."""
        self._least = start.error
        best, held = self._matrices(start, frozenset())
        first = held
        for i in range(len(best.maps)):
            best, held = self._line(best, held, i)
        return (best, held) if held == first else self._matrices(best, held)

    def _filled(self, best: Drawn, held: Held) -> Drawn:
        """With the frame filled exactly, if it is meant to be, unless the picture is drawn notably worse for it."""
        if self.late() or not self._is_meant(best):
            return best
        exact = replace(self.frame, sigma_px=EXACT_PX)
        within = self.picture.within(exact)
        held |= {(i, 4 + axis) for i, axis in _in_the_middle(best.maps) if {(i, 2 * axis), (i, 2 * axis + 1)} <= held}
        filled = polished(within, within.judge(best.maps, best.weights), POLISH, patience=2, late=self.late, held=held)
        seen = self.picture.error(filled.image)
        if seen > FILLED * best.error:
            return best
        self.frame = exact
        return replace(filled, error=seen)

    def _symmetric(self, best: Drawn) -> Drawn:
        """With offsets made symmetric that nearly are, unless it is drawn worse or misses the frame; those in the
        middle of the canvas on its better side, and all at a size that fills the frame if it is meant to be."""
        maps = mirrored_offsets(best.maps, 2 / self.picture.side)
        if self.late() or bool((maps == best.maps).all()):
            return best
        within = self.picture.within(self.frame)
        found = within.judge(maps, best.weights)
        for i, axis in _in_the_middle(maps):
            other = found.maps.clone()
            other[i, 4 + axis] = EDGE if other[i, 4 + axis] <= 0 else -EDGE
            found = min(found, within.judge(other, best.weights), key=lambda drawn: drawn.error)
        if self._is_meant(found):
            linear, offset = found.maps[:, :4], found.maps[:, 4:] * self.frame.growth(found.maps, found.chances)
            sizes = [torch.cat([linear, offset * (1 + nudge)], 1) for nudge in NUDGES]
            found = min(found, *(within.judge(size, best.weights) for size in sizes), key=lambda drawn: drawn.error)
        if found.error > MIRRORED * within.judge(best.maps, best.weights).error:
            return best
        return replace(found, error=self.picture.error(found.image))

    def _is_meant(self, drawn: Drawn) -> bool:
        """Whether the frame is meant to be filled, which it nearly is."""
        return self.frame is not None and bool(
            self.frame.misfit(drawn.maps, drawn.chances).abs().max() < FRAMED_PX)

    def _matrices(self, best: Drawn, held: Held) -> tuple[Drawn, Held]:
        """With matrices near simple ones rounded, as often as others come near by that."""
        while not self.late():
            spread, maps, new = Spread.of(best, self.picture), best.maps.clone(), held
            for i, one in enumerate(best.maps):
                simple = None if _matrix(i) <= held else spread.rounded(one)
                if simple is not None:
                    maps[i], new = simple, new | _matrix(i)
            tried = self._tried(best, maps, new) if new > held else None
            if tried is None:
                break
            best, held = tried, new
        return best, held

    def _line(self, best: Drawn, held: Held, i: int) -> tuple[Drawn, Held]:
        """With one map made a line along an axis, if it is nearly one."""
        if self.late() or _matrix(i) <= held:
            return best, held
        spread, hasty = Spread.of(best, self.picture), self.picture.hasty()
        likely = [(self._polished(hasty, drawn, line, held, i), line)
                  for drawn, line in _likeliest(hasty, best, i, spread.lines(best.maps[i]), LIKELY)]
        if not likely:
            return best, held
        rough, line = min(likely, key=_error)
        again = self.picture.judge(rough.maps, rough.weights)
        drawn = self._polished(self.picture, again, line, held, i, Redrawn)
        new = held | {(i, j) for j in line.held}
        tried = self._tried(best, drawn.maps, new, worse=1)
        return (best, held) if tried is None else self._scaled(tried, new, i, line)

    def _scaled(self, best: Drawn, held: Held, i: int, line: Line) -> tuple[Drawn, Held]:
        """With the scale of a map that is a line rounded."""
        if self.late():
            return best, held
        spread, line = Spread.of(best, self.picture), replace(line, one=best.maps[i])
        (drawn, _), *_ = _likeliest(self.picture, best, i, spread.rescaled(line), 1)
        tried = self._tried(best, drawn.maps, held | _matrix(i))
        return (best, held) if tried is None else (tried, held | _matrix(i))

    def _polished(self, picture: Picture, drawn: Drawn, line: Line, held: Held, i: int,
                  slopes: type[Jacobian] = Played) -> Drawn:
        """With the line by itself polished."""
        return polished(picture, drawn, STEPS, [i], late=self.late, slopes=slopes,
                        held=held | {(i, j) for j in line.held})

    def _tried(self, best: Drawn, maps: Tensor, held: Held, worse: float = WORSE) -> Drawn | None:
        """All that is not held polished, or None if it is drawn worse."""
        start = self.picture.judge(maps, best.weights)
        fitted = fitted_into_frame(self.picture, start, POLISH, self.frame, late=self.late, held=held)
        return self._accepted(self._symmetric(fitted), worse)

    def _accepted(self, drawn: Drawn, worse: float = WORSE) -> Drawn | None:
        """The drawing, or None if its error is higher than so many times the least so far."""
        if drawn.error > worse * self._least:
            return None
        self._least = min(self._least, drawn.error)
        return drawn


def _likeliest(picture: Picture, best: Drawn, i: int, lines: Iterable[Line], count: int) -> list[tuple[Drawn, Line]]:
    """The lines in the place of a map that draw the picture best, so many."""
    drawings = []
    for line in lines:
        maps = best.maps.clone()
        maps[i] = line.one
        drawings.append((picture.judge(maps, best.weights), line))
    return sorted(drawings, key=_error)[:count]


def _in_the_middle(maps: Tensor) -> list[list[int]]:
    """The pairs [map, axis] of offsets that are zero but for about `EDGE`."""
    return (maps[:, 4:].abs() < 2 * EDGE).nonzero().tolist()


def _matrix(i: int) -> Held:
    return frozenset((i, j) for j in range(4))


def _error(found: tuple[Drawn, object]) -> float:
    return found[0].error
