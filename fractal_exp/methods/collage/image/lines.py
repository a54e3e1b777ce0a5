"""Maps whose images are lines: told by how the light runs along the line.

Mean and covariance do not determine the projection of a map that is nearly of rank 1: across the line there is nothing
to see, and along it grey levels saturate where a subpixel is hit more than once. But how many subpixels of a row a line
lights up follows from the measure projected onto one direction, so all directions and ends can be gone through without
a rendering.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from .params import LineParams


class _Laid(NamedTuple):
    """A map (6,) to the line, the angle of its projection, where its image begins and ends, and its error."""

    error: float
    angle: float
    begin: Tensor
    end: Tensor
    map: Tensor


@dataclass(frozen=True)
class CanvasLine:
    """A straight line on the canvas: where the coordinate number `main` (0 for x, 1 for y) is t, the other one is
    height + slope · t, |slope| <= 1. Its rows are those of the pixels along `main`."""

    main: int
    slope: float
    height: float

    @classmethod
    def of(cls, line: Tensor, points: Tensor) -> CanvasLine:
        """That on which a map (6,) lays points (P,2), but for the width of their image."""
        image = points @ line[:4].view(2, 2).T + line[4:]
        middle = image.mean(0)
        along = torch.linalg.svd(image - middle, full_matrices=False)[2][0]
        main = int(along.abs().argmax())
        slope = float(along[1 - main] / along[main])
        return cls(main, slope, float(middle[1 - main]) - slope * float(middle[main]))

    def map(self, row: Tensor, start: Tensor) -> Tensor:
        """The map (6,) that sends a point x to where t = row·x + start on the line."""
        rows = torch.stack([row, self.slope * row])
        shift = torch.stack([start, self.height + self.slope * start])
        return torch.cat([(rows if self.main == 0 else rows.flip(0)).flatten(),
                          shift if self.main == 0 else shift.flip(0)])

    def pixels(self, image: Tensor, aside: int) -> Tensor:
        """The image's (R,R) pixels on the line and so many on each side of it, (R,1 + 2 aside), a row each, in
        ascending order of t; those beyond its edge are dark."""
        size = image.shape[0]
        rows = image.T if self.main == 0 else image.flip(0)
        centers = (2 * torch.arange(size) + 1) / size - 1
        across = self.height + self.slope * centers
        place = ((1 + (across if self.main == 1 else -across)) / 2 * size).floor().long()
        columns = place[:, None] + torch.arange(-aside, aside + 1)
        inside = (columns >= 0) & (columns < size)
        return rows[torch.arange(size)[:, None], columns.clamp(0, size - 1)] * inside


@dataclass(frozen=True)
class Light:
    """What an image shows of a line: the target (R,R), a rendering (R,R) of the code without it, subpixels a side of a
    pixel, and how many points of the chaos game fall on the canvas for each pixel."""

    target: Tensor
    rest: Tensor
    supersample: int
    points_per_pixel: float


def profiled(line: Tensor, share: float, points: Tensor, shown: Light, params: LineParams) -> Tensor:
    """Maps (K,6), `params.count` at most, to the line on which a map (6,) lays the measure, but in other ways along it.

    They are those whose light fits best among all ends, in each direction of projection that is better than its
    neighbours, best first; none where the image is a point.

    share: of the points, that the map has; points (P,2): of the measure.
    """
    given, supersample = line, shown.supersample
    line, points, target, rest = (each.double().cpu() for each in (line, points, shown.target, shown.rest))
    course = CanvasLine.of(line, points)
    wanted, there = (course.pixels(each, params.aside_px) for each in (target, rest))
    light, variance = _missing(wanted, there, supersample)
    cells = supersample * (1 + abs(course.slope))  # subpixels of a row that the line crosses
    thrown = shown.points_per_pixel * target.numel() * share
    own = points @ line[:4].view(2, 2)[course.main] + line[4 + course.main]
    low, length = own.min(), own.max() - own.min()
    if not length > 0:
        return given.new_zeros(0, 6)
    edges = torch.linspace(-1, 1, len(target) + 1, dtype=torch.float64)

    def best(angle: float, begins: Tensor, ends: Tensor) -> _Laid:
        begins, ends = (each.flatten() for each in torch.meshgrid(begins, ends, indexing="ij"))
        long = ends - begins > params.shortest * length
        begins, ends = begins[long], ends[long]
        direction = points.new_tensor([math.cos(angle), math.sin(angle)])
        projected = points @ direction
        places = (edges - begins[:, None]) / (ends - begins)[:, None]
        hits = thrown * _cumulated(projected, places, params.bins).diff()
        lit = cells / supersample**2 * (1 - (-hits / cells).exp())
        lengths = (ends - begins) / (projected.max() - projected.min())  # of the row
        errors = ((lit - light).square() / variance).sum(1)
        errors = errors.masked_fill(lengths * math.hypot(1, course.slope) > params.largest, torch.inf)
        k = errors.argmin()
        row = direction * lengths[k]
        return _Laid(float(errors[k]), angle, begins[k], ends[k], course.map(row, begins[k] - (points @ row).min()))

    def finer(coarse: _Laid) -> _Laid:
        around = torch.linspace(-1, 1, params.finer, dtype=torch.float64)
        return min((best(coarse.angle + turn * float(offset), coarse.begin + step * around, coarse.end + step * around)
                    for offset in around), key=lambda laid: laid.error)

    turn, step = 2 * math.pi / params.directions, (1 + 2 * params.reach) / (params.ends - 1) * length
    places = torch.linspace(-params.reach, 1 + params.reach, params.ends, dtype=torch.float64) * length + low
    laid = [best(turn * k, places, places) for k in range(params.directions)]
    errors = [each.error for each in laid]
    lowest = [k for k, error in enumerate(errors)
              if error < math.inf and error <= min(errors[k - 1], errors[(k + 1) % params.directions])]
    chosen = sorted(lowest, key=errors.__getitem__)[:params.count]
    return torch.stack([finer(laid[k]).map for k in chosen]).to(given) if chosen else given.new_zeros(0, 6)


def _missing(wanted: Tensor, there: Tensor, supersample: int) -> tuple[Tensor, Tensor]:
    """The light (R,), in pixels, that rows of pixels (R,n) lack beside what is there (R,n), where only dark subpixels
    show it, and the variance (R,) of its counting error."""
    least = 1 / supersample**2
    dark = (1 - there).clamp_min(least)
    counted = (there * (1 - there) + wanted * (1 - wanted)).clamp_min(least) * least
    return ((wanted - there) / dark).sum(1), (counted / dark.square()).sum(1)


def _cumulated(values: Tensor, places: Tensor, bins: int) -> Tensor:
    """The part of the values (P,) below each place, of which 0 is the least value and 1 the largest."""
    low, high = values.min(), values.max()
    counts = torch.histc((values - low) / (high - low).clamp_min(1e-12), bins, 0, 1) / len(values)
    below = torch.cat([counts.new_zeros(1), counts.cumsum(0)])
    places = (places * bins).clamp(0, bins)
    index = places.long().clamp(max=bins - 1)
    return below[index] + (places - index) * (below[index + 1] - below[index])
