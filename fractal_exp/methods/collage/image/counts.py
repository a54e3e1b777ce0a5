"""The Jacobian of an image whose grey levels are proportional to counts, for `gauss_newton`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from ....cameras.blur import blurred
from ....cameras.linear import Linear
from ....ops.collage import orbit_bins, pushforward
from .jacobian import LOG_STEP, STEP_PX, WEIGHT, Jacobian
from .objective import ImageObjective, Rendered

BILINEAR = 1 / 12          # variance, cells², that bilinear bins add, compared with sharp bins
LEAST_WEIGHT = 1e-3        # lower limit of a probability that moves, as a share of the largest
LETTERS = 8                # terms of the series of a probability's effect that are summed
MARGIN = 1 / 8             # of the canvas's side, by which the grid of a linear image extends beyond each edge: blur


class FromCounts(Jacobian):
    """For grey levels proportional to counts: like `FromPoints`, but under the blur of the image, and free
    probabilities move with the maps. For map i, they change the invariant measure mu = T mu by
    d mu = f_i#mu - mu + T d mu. This series ends once the maps have contracted its terms below a cell."""

    def weight_units(self, moving: Sequence[int]) -> list[tuple[int, int, float]]:
        return [] if self.weights is None else [(i, WEIGHT, LOG_STEP) for i in moving]

    def weighed(self, step: Tensor) -> Tensor | None:
        if self.weights is None:
            return None
        moved = self.weights.log()
        for value, (i, j, unit) in zip(step.tolist(), self.units, strict=True):
            if j == WEIGHT:
                moved[i] += value * unit
        return (moved - moved.max()).exp().clamp_min(LEAST_WEIGHT)

    def grids(self, objective: ImageObjective, rendered: Rendered) -> Iterator[tuple[Tensor | slice, Tensor]]:
        levels, side, step = objective.levels, self.side, STEP_PX
        assert isinstance(levels, Linear)
        margin = math.ceil(side * MARGIN)
        size = side + 2 * margin  # points just off the canvas are blurred into it
        scale = rendered.maps.new_tensor([1, 1, 1, 1, side / size, side / size])
        entries = [k for k, (_, j, _) in enumerate(self.units) if j != WEIGHT]
        moved = torch.stack([rendered.maps, *(self.nudged(k, step) for k in entries)]) * scale
        bins = orbit_bins(moved, rendered.probabilities, size, seed=self.seed, **self.game)
        known, columns = bins[0], list((bins[1:] - bins[0]) / step)
        for i, j, unit in self.units:
            if j == WEIGHT:
                shifted = _shifted(known, rendered.maps * scale, rendered.probabilities, i)
                columns.append(unit * rendered.probabilities[i] * shifted)
        canvas = slice(margin, margin + side)
        sigma = max(0.0, levels.blur_px(side) ** 2 - BILINEAR) ** 0.5
        bins = blurred(torch.stack([known, *columns]), sigma)[:, canvas, canvas]
        shown, total = bins[0], bins[0].sum().clamp_min(1e-12)
        columns = (bins[1:] - shown * (bins[1:].sum((1, 2), keepdim=True) / total)) * levels.exposure(shown)
        if levels.known is not None:
            columns = columns * levels.known.mask(side).to(columns)
        for k, grey in enumerate(objective.grids(rendered.image)):
            if k:
                columns = avg_pool2d(columns, 2, ceil_mode=True)
            yield slice(None), (columns * levels.stabilizing_slope(grey, objective.subpixels * 4**k)).flatten(1).T


def _shifted(measure: Tensor, maps: Tensor, probabilities: Tensor, chosen: int) -> Tensor:
    """The change of a code's invariant measure (G,G) with the probability of one map, relative to the others, through
    words of `LETTERS` letters."""
    step = _pushed(measure, maps[chosen, None], probabilities.new_ones(1)) - measure
    change = step.clone()
    for _ in range(LETTERS - 1):
        step = _pushed(step, maps, probabilities)
        change += step
    return change


def _pushed(bins: Tensor, maps: Tensor, weights: Tensor) -> Tensor:
    """The weighted sum of the images under maps (N,6) of a measure (G,G), or of a difference of two measures."""
    size = bins.shape[0]
    row, column = bins.nonzero().unbind(1)
    samples = torch.stack([(2 * column + 1) / size - 1, 1 - (2 * row + 1) / size, bins[row, column]], 1)
    return pushforward(maps[None].contiguous(), weights[None].contiguous(), samples, size)[0]
