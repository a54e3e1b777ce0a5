"""Entries near to simple numbers are rounded, if the image allows it.

An image determines a matrix to about 0.01 px, but barely constrains how a line was projected. Where simple numbers are
that near and render the image as well, they are likelier than those found (the shorter description; Rissanen 1978).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import torch
from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.frame import Frame
from ..image.gauss_newton import fitted_into_frame, polished
from ..image.jacobian import FromPoints, FromRenderings, Jacobian
from ..image.objective import ImageObjective, Rendered
from .simple_maps import EDGE, Line, Spread, mirrored_offsets

Fixed = frozenset[tuple[int, int]]   # entries (map, column) that are simple


class Rounding:
    """Of codes whose rendering is near to the image of the objective."""

    def __init__(self, objective: ImageObjective, deadline: Deadline = NO_DEADLINE):
        self.objective, self.deadline, self.params = objective, deadline, objective.params.canonical
        self.frame: Frame | None = objective.own_frame()
        self._least = float("inf")

    def __call__(self, start: Rendered) -> Rendered:
        """The code with the frame filled exactly, all that is simple rounded and what is nearly its own mirror image
        made so, each unless the image is rendered worse for it."""
        best, fixed = self.simplified(self._filled(start, frozenset()))
        best = self._symmetric(best)
        return self._symmetric(self._filled(best, fixed)) if fixed else best

    def simplified(self, start: Rendered) -> tuple[Rendered, Fixed]:
        """The code with all that is simple rounded, unless the image is rendered worse for it, and what was rounded."""
        self._least = start.error
        best, fixed = self._matrices(start, frozenset())
        first = fixed
        for i in range(len(best.maps)):
            best, fixed = self._line(best, fixed, i)
        return (best, fixed) if fixed == first else self._matrices(best, fixed)

    def _filled(self, best: Rendered, fixed: Fixed) -> Rendered:
        """With the frame filled exactly, if it is meant to be, unless the image is rendered notably worse for it."""
        if not self.params.fill or self.deadline.passed or not self._is_meant(best):
            return best
        exact = replace(self.frame, sigma_px=self.params.exact_px)
        within = self.objective.within(exact)
        fixed |= {(i, 4 + axis) for i, axis in _in_the_middle(best.maps) if {(i, 2 * axis), (i, 2 * axis + 1)} <= fixed}
        filled = polished(within, within.judge(best.maps, best.weights), self.params.polish, patience=2,
                          deadline=self.deadline, fixed=fixed)
        seen = self.objective.error(filled.image)
        if seen > self.params.filled_worse * best.error:
            return best
        self.frame = exact
        return replace(filled, error=seen)

    def _symmetric(self, best: Rendered) -> Rendered:
        """With offsets made symmetric that nearly are, unless it is rendered worse or misses the frame; those in the
        middle of the canvas on its better side, and all at a size that fills the frame if it is meant to be."""
        maps = mirrored_offsets(best.maps, 2 / self.objective.side * self.params.symmetric_px)
        if not self.params.symmetric or self.deadline.passed or bool((maps == best.maps).all()):
            return best
        within = self.objective.within(self.frame)
        found = within.judge(maps, best.weights)
        for i, axis in _in_the_middle(maps):
            other = found.maps.clone()
            other[i, 4 + axis] = EDGE if other[i, 4 + axis] <= 0 else -EDGE
            found = min(found, within.judge(other, best.weights), key=lambda found: found.error)
        if self._is_meant(found):
            linear, offset = found.maps[:, :4], found.maps[:, 4:] * self.frame.growth(found.maps, found.probabilities)
            sizes = [torch.cat([linear, offset * (1 + nudge)], 1) for nudge in self.params.nudges]
            found = min(found, *(within.judge(size, best.weights) for size in sizes), key=lambda found: found.error)
        if found.error > self.params.symmetric_worse * within.judge(best.maps, best.weights).error:
            return best
        return replace(found, error=self.objective.error(found.image))

    def _is_meant(self, found: Rendered) -> bool:
        """Whether the frame is meant to be filled, which it nearly is."""
        return self.frame is not None and bool(
            self.frame.misfit(found.maps, found.probabilities).abs().max() < self.params.framed_px)

    def _matrices(self, best: Rendered, fixed: Fixed) -> tuple[Rendered, Fixed]:
        """With matrices near simple ones rounded, as often as others come near by that."""
        while not self.deadline.passed:
            spread, maps, new = Spread.of(best, self.objective), best.maps.clone(), fixed
            for i, one in enumerate(best.maps):
                simple = None if _matrix(i) <= fixed else spread.rounded(one)
                if simple is not None:
                    maps[i], new = simple, new | _matrix(i)
            tried = self._tried(best, maps, new) if new > fixed else None
            if tried is None:
                break
            best, fixed = tried, new
        return best, fixed

    def _line(self, best: Rendered, fixed: Fixed, i: int) -> tuple[Rendered, Fixed]:
        """With one map made a line along an axis, if it is nearly one."""
        if self.deadline.passed or _matrix(i) <= fixed:
            return best, fixed
        spread, hasty = Spread.of(best, self.objective), self.objective.hasty()
        likely = [(self._polished(hasty, found, line, fixed, i), line)
                  for found, line in _likeliest(hasty, best, i, spread.lines(best.maps[i]), self.params.lines_tried)]
        if not likely:
            return best, fixed
        rough, line = min(likely, key=_error)
        again = self.objective.judge(rough.maps, rough.weights)
        found = self._polished(self.objective, again, line, fixed, i, FromRenderings)
        new = fixed | {(i, j) for j in line.fixed}
        tried = self._tried(best, found.maps, new, worse=1.0)
        return (best, fixed) if tried is None else self._scaled(tried, new, i, line)

    def _scaled(self, best: Rendered, fixed: Fixed, i: int, line: Line) -> tuple[Rendered, Fixed]:
        """With the scale of a map that is a line rounded."""
        if self.deadline.passed:
            return best, fixed
        spread, line = Spread.of(best, self.objective), replace(line, one=best.maps[i])
        (found, _), *_ = _likeliest(self.objective, best, i, spread.rescaled(line), 1)
        tried = self._tried(best, found.maps, fixed | _matrix(i))
        return (best, fixed) if tried is None else (tried, fixed | _matrix(i))

    def _polished(self, objective: ImageObjective, found: Rendered, line: Line, fixed: Fixed, i: int,
                  jacobian: type[Jacobian] = FromPoints) -> Rendered:
        """With the line by itself polished."""
        return polished(objective, found, self.params.line_steps, [i], deadline=self.deadline, jacobian=jacobian,
                        fixed=fixed | {(i, j) for j in line.fixed})

    def _tried(self, best: Rendered, maps: Tensor, fixed: Fixed, worse: float | None = None) -> Rendered | None:
        """All that is not fixed polished, or None if it is rendered worse."""
        start = self.objective.judge(maps, best.weights)
        fitted = fitted_into_frame(self.objective, start, self.params.polish, self.frame, deadline=self.deadline,
                                   fixed=fixed)
        return self._accepted(self._symmetric(fitted), worse)

    def _accepted(self, found: Rendered, worse: float | None) -> Rendered | None:
        """The code, or None if its error is higher than so many times the least so far."""
        if found.error > (self.params.worse if worse is None else worse) * self._least:
            return None
        self._least = min(self._least, found.error)
        return found


def _likeliest(objective: ImageObjective, best: Rendered, i: int, lines: Iterable[Line], count: int
               ) -> list[tuple[Rendered, Line]]:
    """The lines in the place of a map with the nearest renderings, so many."""
    tried = []
    for line in lines:
        maps = best.maps.clone()
        maps[i] = line.one
        tried.append((objective.judge(maps, best.weights), line))
    return sorted(tried, key=_error)[:count]


def _in_the_middle(maps: Tensor) -> list[list[int]]:
    """The pairs [map, axis] of offsets that are zero but for about `EDGE`."""
    return (maps[:, 4:].abs() < 2 * EDGE).nonzero().tolist()


def _matrix(i: int) -> Fixed:
    return frozenset((i, j) for j in range(4))


def _error(found: tuple[Rendered, object]) -> float:
    return found[0].error
