"""Round entries near simple numbers, if the image allows it.

An image determines a matrix to about 0.01 px, but barely constrains how a line was projected. If simple numbers are
that near and render the image as well, they are likelier than the found ones (the shorter description; Rissanen 1978).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.frame import Frame
from ..image.gauss_newton import fitted_into_frame, polished
from ..image.jacobian import FromPoints, FromRenderings, Jacobian
from ..image.objective import ImageObjective, Rendered
from ..params.rounding import RoundingParams
from .simple_maps import Line, Spread, mirrored_offsets

Fixed = frozenset[tuple[int, int]]   # entries (map, column) that are simple


@dataclass(frozen=True)
class _Standing:
    """The state of the rounding: the code, its simple entries (`fixed`), the frame that it must fill, and the lowest
    error of a code with simple numbers so far."""

    code: Rendered
    fixed: Fixed
    frame: Frame | None
    least: float


class Rounding:
    """Rounds codes whose rendering is close to the objective's image."""

    def __init__(self, objective: ImageObjective, deadline: Deadline = NO_DEADLINE,
                 params: RoundingParams | None = None):
        self.objective, self.deadline, self.params = objective, deadline, params or objective.params.rounding

    def __call__(self, start: Rendered) -> Rendered:
        """Fill the frame exactly, round simple numbers, and make nearly symmetric offsets symmetric. Each change is
        undone if it makes the rendering worse."""
        now = self._simplified(self._filled(self._from(start)))
        now = self._symmetric(now)
        return self._symmetric(self._filled(now)).code if now.fixed else now.code

    def simplified(self, start: Rendered) -> tuple[Rendered, Fixed]:
        """The code with simple numbers rounded, unless that makes the rendering worse; and the rounded entries."""
        now = self._simplified(self._from(start))
        return now.code, now.fixed

    def _from(self, start: Rendered) -> _Standing:
        own, firm = self.objective.own_frame(), self.objective.firm_frame()
        frame = firm if own is None and firm is not None and self._is_meant(start, firm) else own
        return _Standing(start, frozenset(), frame, start.error)

    def _simplified(self, now: _Standing) -> _Standing:
        now = first = self._matrices(replace(now, least=now.code.error))
        for i in range(len(now.code.maps)):
            now = self._line(now, i)
        return now if now.fixed == first.fixed else self._matrices(now)

    def _filled(self, now: _Standing) -> _Standing:
        """Fill the frame exactly if it is meant to be filled, unless that makes the rendering notably worse."""
        best, fixed, frame = now.code, now.fixed, now.frame
        if not self.params.fill or self.deadline.passed or frame is None or not self._is_meant(best, frame):
            return now
        exact = replace(frame, sigma_px=self.params.exact_px)
        within = self.objective.within(exact)
        fixed |= {(i, 4 + axis) for i, axis in _in_the_middle(best.maps, self.params.off_middle)
                  if {(i, 2 * axis), (i, 2 * axis + 1)} <= fixed}
        filled = polished(within, within.judge(best.maps, best.weights), self.params.polish,
                          patience=self.objective.params.gauss_newton.last_patience, deadline=self.deadline,
                          fixed=fixed)
        seen = self.objective.error(filled.image)
        if seen > self.params.filled_worse * best.error:
            return now
        return replace(now, code=replace(filled, error=seen), frame=exact)

    def _symmetric(self, now: _Standing) -> _Standing:
        """Make nearly symmetric offsets symmetric, unless that makes the rendering worse or misses the frame. Offsets
        in the middle of the canvas go to the better side of it. If the frame is meant to be filled, all offsets are
        scaled to fill it."""
        best, frame = now.code, now.frame
        edge = self.params.off_middle
        maps = mirrored_offsets(best.maps, 2 / self.objective.side * self.params.symmetric_px, edge)
        if not self.params.symmetric or self.deadline.passed or bool((maps == best.maps).all()):
            return now
        within = self.objective.within(frame)
        found = within.judge(maps, best.weights)
        for i, axis in _in_the_middle(maps, edge):
            other = found.maps.clone()
            other[i, 4 + axis] = edge if other[i, 4 + axis] <= 0 else -edge
            found = min(found, within.judge(other, best.weights), key=lambda found: found.error)
        if frame is not None and self._is_meant(found, frame):
            linear, offset = found.maps[:, :4], found.maps[:, 4:] * frame.enlargement(found.maps, found.probabilities)
            sizes = [torch.cat([linear, offset * (1 + nudge)], 1) for nudge in self.params.nudges]
            found = min(found, *(within.judge(size, best.weights) for size in sizes), key=lambda found: found.error)
        if found.error > self.params.symmetric_worse * within.judge(best.maps, best.weights).error:
            return now
        return replace(now, code=replace(found, error=self.objective.error(found.image)))

    def _is_meant(self, found: Rendered, frame: Frame) -> bool:
        """Whether the code nearly fills the frame, so that it is meant to."""
        return bool(frame.misfit(found.maps, found.probabilities).abs().max() < self.params.framed_px)

    def _matrices(self, now: _Standing) -> _Standing:
        """Round matrices near simple ones. Repeat while this brings further matrices near simple ones."""
        while self.params.matrices and not self.deadline.passed:
            spread, maps, fixed = Spread.of(now.code, self.objective, self.params), now.code.maps.clone(), now.fixed
            for i, one in enumerate(now.code.maps):
                simple = None if _matrix(i) <= fixed else spread.rounded(one)
                if simple is not None:
                    maps[i], fixed = simple, fixed | _matrix(i)
            tried = self._tried(now, maps, fixed, self.params.worse) if fixed > now.fixed else None
            if tried is None:
                break
            now = tried
        return now

    def _line(self, now: _Standing, i: int) -> _Standing:
        """Make one map a line along an axis, if it nearly is one."""
        best, fixed = now.code, now.fixed
        if not self.params.axis_lines or self.deadline.passed or _matrix(i) <= fixed:
            return now
        spread, hasty = Spread.of(best, self.objective, self.params), self.objective.hasty()
        likely = [(self._polished(hasty, found, line, fixed, i), line)
                  for found, line in _likeliest(hasty, best, i, spread.lines(best.maps[i]), self.params.lines_tried)]
        if not likely:
            return now
        rough, line = min(likely, key=_error)
        again = self.objective.judge(rough.maps, rough.weights)
        found = self._polished(self.objective, again, line, fixed, i, FromRenderings)
        tried = self._tried(now, found.maps, fixed | {(i, j) for j in line.fixed}, self.params.line_worse)
        return now if tried is None else self._scaled(tried, i, line)

    def _scaled(self, now: _Standing, i: int, line: Line) -> _Standing:
        """Round the scale of a map that is a line."""
        if self.deadline.passed:
            return now
        spread, line = Spread.of(now.code, self.objective, self.params), replace(line, one=now.code.maps[i])
        (found, _), *_ = _likeliest(self.objective, now.code, i, spread.rescaled(line), 1)
        return self._tried(now, found.maps, now.fixed | _matrix(i), self.params.worse) or now

    def _polished(self, objective: ImageObjective, found: Rendered, line: Line, fixed: Fixed, i: int,
                  jacobian: type[Jacobian] = FromPoints) -> Rendered:
        """Polish the line alone."""
        return polished(objective, found, self.params.line_steps, [i], deadline=self.deadline, jacobian=jacobian,
                        fixed=fixed | {(i, j) for j in line.fixed})

    def _tried(self, now: _Standing, maps: Tensor, fixed: Fixed, worse: float) -> _Standing | None:
        """Take these maps and polish all entries that are not fixed. None if the error then exceeds `worse` times the
        lowest so far."""
        start = self.objective.judge(maps, now.code.weights)
        fitted = fitted_into_frame(self.objective, start, self.params.polish, now.frame, deadline=self.deadline,
                                   fixed=fixed)
        found = self._symmetric(replace(now, code=fitted, fixed=fixed))
        return replace(found, least=min(now.least, found.code.error)) if found.code.error <= worse * now.least else None


def _likeliest(objective: ImageObjective, best: Rendered, i: int, lines: Iterable[Line], count: int
               ) -> list[tuple[Rendered, Line]]:
    """The `count` lines that give the nearest renderings in the place of map i."""
    tried = []
    for line in lines:
        maps = best.maps.clone()
        maps[i] = line.one
        tried.append((objective.judge(maps, best.weights), line))
    return sorted(tried, key=_error)[:count]


def _in_the_middle(maps: Tensor, edge: float) -> list[list[int]]:
    """The pairs [map, axis] of offsets that are zero up to about `edge`, where they were put."""
    return (maps[:, 4:].abs() < 2 * edge).nonzero().tolist()


def _matrix(i: int) -> Fixed:
    return frozenset((i, j) for j in range(4))


def _error(found: tuple[Rendered, object]) -> float:
    return found[0].error
