"""The simple numbers from which people build fractals, and the simple maps near given ones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import product
from typing import NamedTuple

import torch
from torch import Tensor

from ....cameras.points import attractor_points
from ....ifs import affine
from ....runtime.seeds import derive
from ..image.objective import ImageObjective, Rendered
from ..limits import LARGEST, SMALLER
from .loop import DRAWN_WORSE

RATIOS = (((5**0.5 - 1) / 2) ** 2,)   # further simple ratios of a similarity: the squared inverse of the golden ratio
DEGREES = 15, 18       # a simple similarity rotates by a multiple of one of these angles
LEAST_SIDE = 256       # in a smaller image, `Precision.near_px` counts in pixels of an image of this side
OFF_MIDDLE = 1e-6      # canvas units from the middle of offsets that would be 0: the edge between two pixels has sides
LINE_PX = 1.0          # maximum standard deviation, pixels, across an image that may be a line along an axis
LINE_THIN = 0.1        # maximum ratio of that standard deviation to the one along the image
LINE_FACTORS = 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4   # on the length of a line that are tried: its ends are hardly seen
LINE_SCALES = 3        # simple scales of a line that are tried
LINE_SHIFTS_PX = torch.linspace(-1, 1, 9, dtype=torch.float64).tolist()   # places along the line of each scale
POINTS = 20_000        # that estimate the mean and covariance of an attractor


@dataclass(frozen=True)
class Precision:
    """How precisely an image determines a code. near_px: displacement (rms over the attractor, pixels) within which a
    matrix is near a simple one; denominators: of the proper fractions that count as simple entries, and with their
    square roots as simple ratios of a similarity; worse, symmetric_worse: see `rounding`."""

    near_px: float
    denominators: tuple[int, ...]
    worse: float
    symmetric_worse: float

    @classmethod
    def of(cls, objective: ImageObjective) -> Precision:
        """That of a rendering, or of a picture that others drew."""
        return RENDERED if objective.levels.is_exact else DRAWN


RENDERED = Precision(0.05, (*range(1, 13), 100), worse=1.02, symmetric_worse=1.05)
DRAWN = Precision(0.25, tuple(range(1, 7)), worse=DRAWN_WORSE, symmetric_worse=DRAWN_WORSE)


class _Simple(NamedTuple):
    """Simple matrix entries, and simple ratios and angles (radians) of similarities, each (n,) float64, ascending."""

    entries: Tensor
    ratios: Tensor
    angles: Tensor


@cache
def simple_numbers(denominators: tuple[int, ...]) -> _Simple:
    """The numbers that are simple, for these denominators."""
    fractions = {Fraction(p, q) for q in denominators for p in range(q)}
    return _Simple(_sorted({sign * value for value in fractions for sign in (1, -1)}),
                   _sorted({*fractions, *(math.sqrt(value) for value in fractions), *RATIOS}),
                   _sorted({math.radians(angle) for each in DEGREES for angle in range(-180, 181, each)}))


def _sorted(values: set) -> Tensor:
    return torch.tensor(sorted({float(value) for value in values}), dtype=torch.float64)


def simple_matrices(matrix: Tensor, denominators: tuple[int, ...]) -> Tensor:
    """The nearest simple matrix (2,2) of each kind, (3,2,2) float64: entry by entry, a rotating similarity, and a
    mirroring one."""
    simple, matrix = simple_numbers(denominators), matrix.double().cpu()
    (a, b), (c, d) = matrix
    found = [_nearest(matrix, simple.entries)]
    for sign in (1, -1):
        along, across = (a + sign * d) / 2, (c - sign * b) / 2
        ratio = _nearest(torch.hypot(along, across), simple.ratios)
        angle = _nearest(torch.atan2(across, along), simple.angles)
        x, y = ratio * angle.cos(), ratio * angle.sin()
        found.append(torch.stack([torch.stack([x, -sign * y]), torch.stack([y, sign * x])]))
    return torch.stack(found)


def _nearest(value: Tensor, to: Tensor) -> Tensor:
    return to[(value[..., None] - to).abs().argmin(-1)]


def mirrored_offsets(maps: Tensor, near: float) -> Tensor:
    """Maps (N,6) with exactly mirror-symmetric offsets along each canvas axis along which they are symmetric to within
    `near`, canvas units. Offsets near the middle come to lie at most `OFF_MIDDLE` from it."""
    maps = maps.clone()
    for column in (4, 5):
        signs, sizes = maps[:, column].sign(), maps[:, column].abs()
        order = sizes.argsort()
        group = torch.empty_like(order)
        group[order] = (sizes[order].diff(prepend=sizes[order][:1]) > near).cumsum(0)
        same = group[:, None] == group
        mean, paired = (same * sizes).sum(1) / same.sum(1), (same * signs).sum(1) == 0
        if bool(((mean < near) | paired).all()) and bool(((sizes - mean).abs() < near).all()):
            maps[:, column] = signs * torch.where(mean < near, mean.clamp_max(OFF_MIDDLE), mean)
    return maps


@dataclass(frozen=True)
class Line:
    """A map (6,) that sends one axis of the plane to a line along an axis. scale: the index of its only nonzero matrix
    entry; fixed: the indices of its fixed entries."""

    one: Tensor
    scale: int
    fixed: frozenset[int]

    def moved(self, entry: int, value: float) -> Line:
        one = self.one.clone()
        one[entry] = value
        return replace(self, one=one)


@dataclass(frozen=True)
class Spread:
    """Mean (2,) and covariance (2,2) of an attractor, float64. pixel: a pixel's side. Rounded maps send the mean where
    it was sent before."""

    mean: Tensor
    covariance: Tensor
    pixel: float
    precision: Precision

    @classmethod
    def of(cls, found: Rendered, objective: ImageObjective) -> Spread:
        """The spread of a code's attractor, with the objective's pixels."""
        points = attractor_points(found.maps, found.probabilities, POINTS, derive(objective.seed, "rounding")).double()
        return cls(points.mean(0), points.T.cov(), 2 / objective.side, Precision.of(objective))

    def rounded(self, one: Tensor) -> Tensor | None:
        """The map (6,) with a simple matrix, or None if none is near."""
        old = one[:4].view(2, 2).double()
        simple = simple_matrices(old, self.precision.denominators).to(old)
        moved = (((simple - old) @ self.covariance) * (simple - old)).sum((-2, -1)).sqrt()
        near = self._with(one, simple[moved.argmin()])
        small = float(moved.min()) <= self.precision.near_px * min(self.pixel, 2 / LEAST_SIDE)
        fits = (affine.largest_singular(near) <= LARGEST) & (affine.smaller_singular(near) <= SMALLER)
        return near if small and bool(fits) else None

    def lines(self, one: Tensor) -> Iterator[Line]:
        """If the map's (6,) image is a line along an axis, lines that project either axis of the plane onto it, both
        ways round. If it lies near the middle of the canvas, also lines on either side of the middle."""
        linear = one[:4].view(2, 2).double()
        spread = (linear @ self.covariance @ linear.T).diagonal().sqrt()
        to = int(spread.argmax())
        across = 1 - to
        if float(spread[across]) > min(LINE_PX * self.pixel, LINE_THIN * float(spread[to])):
            return
        for source, sign, factor in product((0, 1), (1, -1), LINE_FACTORS):
            matrix, scale = torch.zeros_like(linear), 2 * to + source
            matrix[to, source] = sign * factor * spread[to] / self.covariance[source, source].sqrt()
            if not float(matrix[to, source].abs()) <= SMALLER:  # also true of NaN, if the attractor has no width
                continue
            line = Line(self._with(one, matrix), scale, frozenset(range(4)) - {scale})
            yield line
            if abs(float(line.one[4 + across])) < LINE_PX * self.pixel:
                for side in (-OFF_MIDDLE, OFF_MIDDLE):
                    yield replace(line.moved(4 + across, side), fixed=line.fixed | {4 + across})

    def rescaled(self, line: Line) -> Iterator[Line]:
        """The line with the simple scales nearest to its own, each shifted along the line by parts of a pixel."""
        along = 4 + line.scale // 2
        matrix = line.one[:4].double().clone()
        entries = simple_numbers(self.precision.denominators).entries
        for value in entries[(entries - float(matrix[line.scale])).abs().argsort()[:LINE_SCALES]]:
            matrix[line.scale] = value
            sent = self._with(line.one, matrix.view(2, 2))
            for shift in LINE_SHIFTS_PX:
                moved = replace(line, one=sent, fixed=line.fixed | {line.scale})
                yield moved.moved(along, float(sent[along]) + shift * self.pixel)

    def _with(self, one: Tensor, matrix: Tensor) -> Tensor:
        """The map with this matrix (2,2) that sends the mean where the map `one` (6,) sends it."""
        image = one[:4].view(2, 2).double() @ self.mean + one[4:]
        return affine.sending(matrix, self.mean, image).to(one)
