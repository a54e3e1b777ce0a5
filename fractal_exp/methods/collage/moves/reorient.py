"""Replace one map, small ones preferred, by candidates of equal mean and covariance in random orientations.

For a map whose image is a line, other projections are tried too. Mean and covariance do not determine the projection of
a map of nearly rank 1: across the line there is nothing to see, and along it grey levels saturate where a subpixel is
hit more than once. But the measure, projected onto one direction, determines how many subpixels of each row the line
lights up. So all directions and ends can be tried without rendering.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor

from ....cameras.points import attractor_points
from ....ifs import affine
from ....ifs.code import PROBABILITY_FLOOR
from ....runtime.seeds import derive
from ..image.jacobian import WIDEST_PX
from ..image.objective import Rendered, error_of
from ..measure.births import extents, thinness
from .single import THIN, small_maps, with_map, with_new_map
from .tools import HOPEFUL, Tools

POINTS = 50_000   # of the attractor that are projected onto a line
STEPS = 3         # Gauss-Newton steps of each projection
DIRECTIONS = 48   # of projection that are tried
ENDS = 24         # places that are tried for each end of a line
REACH = 0.5       # how far these places extend beyond the line's own ends, as a share of its length
FINER = 9         # angles, and places for each end, that are tried between the neighbours of the best
SHORTEST = 0.2    # length that is tried, as a share of the line's own
BINS = 256        # of a projected measure
ASIDE_PX = 1      # pixels on each side of a line that may show its light
LARGEST = 0.98    # upper limit of the larger singular value of such a map


def with_reorientation(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with one map in another orientation; for a line, also in other projections."""
    gone = small_maps(shown, g)
    rest, old = tools.objective.without(shown, gone), shown.maps[gone[0]]
    found = [tools.polished_last(with_new_map(tools, rest, shown, old, g), shown)]
    measure, side = tools.corrected_measure(shown).fine, tools.objective.image.shape[0]
    is_line = thinness(old, measure) < THIN and 2 * side * extents(old, measure)[0] < WIDEST_PX
    if is_line and tools.params.lines.enabled and tools.objective.levels.is_graded and not tools.deadline.passed:
        found += _reprojected(tools, rest, shown, gone[0])
    return min(found, key=error_of)


def _reprojected(tools: Tools, rest: Rendered, shown: Rendered, gone: int) -> list[Rendered]:
    """The rest of the code with the removed map, a line, in other projections that fit the light along it. Hopeful
    codes are polished, the others are left out."""
    params, objective = tools.params, tools.objective
    volumes = affine.volumes(rest.maps).sum() + PROBABILITY_FLOOR
    share = PROBABILITY_FLOOR / volumes if rest.weights is None else shown.probabilities[gone]
    points = attractor_points(shown.maps, shown.probabilities, POINTS, derive(objective.seed, "profile"))
    light = Light(objective.image, rest.image, objective.levels.supersample, params.camera.points_per_pixel)
    tried = [with_map(objective, rest, each, share)
             for each in profiled(shown.maps[gone], float(share), points, light, params.lines.count)]
    return [tools.polished(each, STEPS, [len(each.maps) - 1]) for each in tried if each.error < HOPEFUL * shown.error]


class _Laid(NamedTuple):
    """A map (6,) onto the line, the angle of its projection, where its image begins and ends, and its error."""

    error: float
    angle: float
    begin: Tensor
    end: Tensor
    map: Tensor


@dataclass(frozen=True)
class CanvasLine:
    """A straight line on the canvas: if coordinate `main` (0 for x, 1 for y) is t, the other one is height + slope · t,
    with |slope| <= 1. Its rows are the rows of pixels along `main`."""

    main: int
    slope: float
    height: float

    @classmethod
    def of(cls, line: Tensor, points: Tensor) -> CanvasLine:
        """The line onto which a map (6,) sends points (P,2), ignoring the width of their image."""
        image = points @ line[:4].view(2, 2).T + line[4:]
        middle = image.mean(0)
        along = torch.linalg.svd(image - middle, full_matrices=False)[2][0]
        main = int(along.abs().argmax())
        slope = float(along[1 - main] / along[main])
        return cls(main, slope, float(middle[1 - main]) - slope * float(middle[main]))

    def map(self, row: Tensor, start: Tensor) -> Tensor:
        """The map (6,) that sends a point x to the point of the line at t = row·x + start."""
        rows = torch.stack([row, self.slope * row])
        shift = torch.stack([start, self.height + self.slope * start])
        return torch.cat([(rows if self.main == 0 else rows.flip(0)).flatten(),
                          shift if self.main == 0 else shift.flip(0)])

    def pixels(self, image: Tensor, aside: int) -> Tensor:
        """The pixels of an image (R,R) on the line and `aside` to each side: (R,1 + 2 aside), a row each, in ascending
        order of t. Pixels beyond the image's edge are dark."""
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
    """What an image shows of a line: the target (R,R), a rendering (R,R) of the code without the line, subpixels per
    side of a pixel, and chaos game points per pixel of the canvas."""

    target: Tensor
    rest: Tensor
    supersample: int
    points_per_pixel: float


def profiled(line: Tensor, share: float, points: Tensor, shown: Light, count: int) -> Tensor:
    """Maps (K,6) onto the same line as the map `line` (6,), but with other projections; best first, at most
    `count`.

    For each direction of projection that fits the light better than its neighbours, this is the map with the best ends.
    Empty if the image is a point. share: the map's share of the points; points (P,2): of the measure.
    """
    given, supersample = line, shown.supersample
    line, points, target, rest = (each.double().cpu() for each in (line, points, shown.target, shown.rest))
    course = CanvasLine.of(line, points)
    wanted, there = (course.pixels(each, ASIDE_PX) for each in (target, rest))
    light, variance = _missing(wanted, there, supersample)
    cells = supersample * (1 + abs(course.slope))  # subpixels that the line crosses in a row
    thrown = shown.points_per_pixel * target.numel() * share
    own = points @ line[:4].view(2, 2)[course.main] + line[4 + course.main]
    low, length = own.min(), own.max() - own.min()
    if not length > 0:
        return given.new_zeros(0, 6)
    edges = torch.linspace(-1, 1, len(target) + 1, dtype=torch.float64)

    def best(angle: float, begins: Tensor, ends: Tensor) -> _Laid:
        begins, ends = (each.flatten() for each in torch.meshgrid(begins, ends, indexing="ij"))
        long = ends - begins > SHORTEST * length
        begins, ends = begins[long], ends[long]
        direction = points.new_tensor([math.cos(angle), math.sin(angle)])
        projected = points @ direction
        places = (edges - begins[:, None]) / (ends - begins)[:, None]
        hits = thrown * _cumulated(projected, places, BINS).diff()
        lit = cells / supersample**2 * (1 - (-hits / cells).exp())
        lengths = (ends - begins) / (projected.max() - projected.min())  # of the row
        errors = ((lit - light).square() / variance).sum(1)
        errors = errors.masked_fill(lengths * math.hypot(1, course.slope) > LARGEST, torch.inf)
        k = errors.argmin()
        row = direction * lengths[k]
        return _Laid(float(errors[k]), angle, begins[k], ends[k], course.map(row, begins[k] - (points @ row).min()))

    def finer(coarse: _Laid) -> _Laid:
        around = torch.linspace(-1, 1, FINER, dtype=torch.float64)
        return min((best(coarse.angle + turn * float(offset), coarse.begin + step * around, coarse.end + step * around)
                    for offset in around), key=lambda laid: laid.error)

    turn, step = 2 * math.pi / DIRECTIONS, (1 + 2 * REACH) / (ENDS - 1) * length
    places = torch.linspace(-REACH, 1 + REACH, ENDS, dtype=torch.float64) * length + low
    laid = [best(turn * k, places, places) for k in range(DIRECTIONS)]
    errors = [each.error for each in laid]
    lowest = [k for k, error in enumerate(errors)
              if error < math.inf and error <= min(errors[k - 1], errors[(k + 1) % DIRECTIONS])]
    chosen = sorted(lowest, key=errors.__getitem__)[:count]
    return torch.stack([finer(laid[k]).map for k in chosen]).to(given) if chosen else given.new_zeros(0, 6)


def _missing(wanted: Tensor, there: Tensor, supersample: int) -> tuple[Tensor, Tensor]:
    """The light (R,), in pixels, that is missing in each row when `wanted` (R,n) is compared with `there` (R,n), and
    the variance (R,) of its counting error. Only dark subpixels can show it."""
    least = 1 / supersample**2
    dark = (1 - there).clamp_min(least)
    counted = (there * (1 - there) + wanted * (1 - wanted)).clamp_min(least) * least
    return ((wanted - there) / dark).sum(1), (counted / dark.square()).sum(1)


def _cumulated(values: Tensor, places: Tensor, bins: int) -> Tensor:
    """The share of the values (P,) below each place, where place 0 is the minimum of the values and 1 the maximum."""
    low, high = values.min(), values.max()
    counts = torch.histc((values - low) / (high - low).clamp_min(1e-12), bins, 0, 1) / len(values)
    below = torch.cat([counts.new_zeros(1), counts.cumsum(0)])
    places = (places * bins).clamp(0, bins)
    index = places.long().clamp(max=bins - 1)
    return below[index] + (places - index) * (below[index + 1] - below[index])
