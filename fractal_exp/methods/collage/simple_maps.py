"""The simple numbers that people build fractals of, and the maps made of them that are near to given ones."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, product

import torch
from torch import Tensor

from ...runtime.seeds import derive
from . import maps as affine
from .jacobian import LARGEST, played
from .picture import Drawn, Picture

NEAR_PX = 0.05             # root mean square over the attractor of what a matrix moves by rounding, at most that
LEAST_SIDE = 256           # of a picture of so many pixels a side: in coarser ones many a matrix is near a simple one
LINE_PX, THIN = 1.0, 0.1   # standard deviation across of an image that may be a line along an axis; times its length
SYMMETRIC_PX = 0.1         # between offsets that may be the same
EDGE = 1e-6                # off the middle, canvas units: on either side of the edge of pixels that lies there
FACTORS = (0.7, 0.8, 0.9, 1, 1.1, 1.25, 1.4)           # times its length, at which a line is tried; once it is found,
SCALES, SHIFTS_PX = 3, [k / 4 for k in range(-4, 5)]   # so many simple scales, each in so many places
POINTS = 20_000            # that tell an attractor's spread
GOLDEN = (math.sqrt(5) - 1) / 2


def _sorted(values: set) -> Tensor:
    return torch.tensor(sorted({float(value) for value in values}), dtype=torch.float64)


FRACTIONS = {Fraction(p, q) for q in (*range(1, 13), 100) for p in range(q)}
ENTRIES = _sorted({sign * value for value in FRACTIONS for sign in (1, -1)})
RATIOS = _sorted({*FRACTIONS, *(math.sqrt(value) for value in FRACTIONS), GOLDEN**2})
ANGLES = _sorted({math.radians(degrees) for degrees in chain(range(-180, 181, 15), range(-180, 181, 18))})


def simple_matrices(matrix: Tensor) -> Tensor:
    """The simple ones nearest to a matrix (2,2) of each kind, (3,2,2) float64: entry by entry, as a similarity that
    turns, and as one that mirrors."""
    matrix = matrix.double().cpu()
    (a, b), (c, d) = matrix
    found = [_nearest(matrix, ENTRIES)]
    for sign in (1, -1):
        along, across = (a + sign * d) / 2, (c - sign * b) / 2
        ratio, angle = _nearest(torch.hypot(along, across), RATIOS), _nearest(torch.atan2(across, along), ANGLES)
        x, y = ratio * angle.cos(), ratio * angle.sin()
        found.append(torch.stack([torch.stack([x, -sign * y]), torch.stack([y, sign * x])]))
    return torch.stack(found)


def _nearest(value: Tensor, to: Tensor) -> Tensor:
    return to[(value[..., None] - to).abs().argmin(-1)]


def mirrored_offsets(maps: Tensor, pixel: float) -> Tensor:
    """Maps (N,6) with their offsets made exactly symmetric along each axis of the canvas along which they nearly are:
    those of a shape that is its own mirror image."""
    maps, near = maps.clone(), SYMMETRIC_PX * pixel
    for column in (4, 5):
        signs, sizes = maps[:, column].sign(), maps[:, column].abs()
        order = sizes.argsort()
        group = torch.empty_like(order)
        group[order] = (sizes[order].diff(prepend=sizes[order][:1]) > near).cumsum(0)
        same = group[:, None] == group
        mean, paired = (same * sizes).sum(1) / same.sum(1), (same * signs).sum(1) == 0
        if bool(((mean < near) | paired).all()) and bool(((sizes - mean).abs() < near).all()):
            maps[:, column] = signs * torch.where(mean < near, mean.clamp_max(EDGE), mean)
    return maps


@dataclass(frozen=True)
class Line:
    """A map (6,) that sends one axis of the plane to a line along one, by its entry `scale`, and which of its entries
    are no longer free."""

    one: Tensor
    scale: int
    held: frozenset[int]

    def moved(self, entry: int, value: float) -> Line:
        """With another value of an entry."""
        one = self.one.clone()
        one[entry] = value
        return replace(self, one=one)


@dataclass(frozen=True)
class Spread:
    """Mean (2,) and covariance (2,2) of an attractor, float64; pixel: a pixel's side. What is rounded here sends the
    mean where it was sent before."""

    mean: Tensor
    covariance: Tensor
    pixel: float

    @classmethod
    def of(cls, drawn: Drawn, picture: Picture) -> Spread:
        points = played(drawn.maps, drawn.chances, POINTS, derive(picture.seed, "rounding")).double()
        return cls(points.mean(0), points.T.cov(), 2 / picture.side)

    def rounded(self, one: Tensor) -> Tensor | None:
        """The map (6,) with a simple matrix, or None if none is near."""
        old = one[:4].view(2, 2).double()
        simple = simple_matrices(old).to(old)
        moved = (((simple - old) @ self.covariance) * (simple - old)).sum((-2, -1)).sqrt()
        near = self._with(one, simple[moved.argmin()])
        small = float(moved.min()) <= NEAR_PX * min(self.pixel, 2 / LEAST_SIDE)
        return near if small and float(affine.largest_singular(near)) <= LARGEST else None

    def lines(self, one: Tensor) -> Iterator[Line]:
        """If the map's (6,) image is a line along an axis, maps that make it of an axis of the plane, either way round;
        where it lies near the middle of the canvas, also in the very middle."""
        linear = one[:4].view(2, 2).double()
        spread = (linear @ self.covariance @ linear.T).diagonal().sqrt()
        to = int(spread.argmax())
        across = 1 - to
        if float(spread[across]) > min(LINE_PX * self.pixel, THIN * float(spread[to])):
            return
        for source, sign, factor in product((0, 1), (1, -1), FACTORS):
            matrix, scale = torch.zeros_like(linear), 2 * to + source
            matrix[to, source] = sign * factor * spread[to] / self.covariance[source, source].sqrt()
            if not float(matrix[to, source].abs()) <= LARGEST:  # nor if the attractor has no width at all
                continue
            line = Line(self._with(one, matrix), scale, frozenset(range(4)) - {scale})
            yield line
            if abs(float(line.one[4 + across])) < LINE_PX * self.pixel:
                for side in (-EDGE, EDGE):
                    yield replace(line.moved(4 + across, side), held=line.held | {4 + across})

    def rescaled(self, line: Line) -> Iterator[Line]:
        """The line with the simple scales nearest to its own, moved along itself by parts of a pixel."""
        along = 4 + line.scale // 2
        matrix = line.one[:4].double().clone()
        for value in ENTRIES[(ENTRIES - float(matrix[line.scale])).abs().argsort()[:SCALES]]:
            matrix[line.scale] = value
            sent = self._with(line.one, matrix.view(2, 2))
            for shift in SHIFTS_PX:
                moved = replace(line, one=sent, held=line.held | {line.scale})
                yield moved.moved(along, float(sent[along]) + shift * self.pixel)

    def _with(self, one: Tensor, matrix: Tensor) -> Tensor:
        """Another map of this matrix (2,2), that sends the mean where the map (6,) sends it."""
        image = one[:4].view(2, 2).double() @ self.mean + one[4:]
        return affine.sending(matrix, self.mean, image).to(one)
