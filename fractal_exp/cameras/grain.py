"""The grain of a scatter plot: how far it is from the density of a code, beside what dots are by chance."""

from __future__ import annotations

import math
from typing import Any

from scipy.optimize import minimize_scalar
from torch import Tensor
from torch.nn.functional import avg_pool2d, pad

from .levels import LEAST_VARIANCE

FINE_PX, COARSE_PX = 3, 8   # sides of cells whose grain is compared; finer ones show how the picture was resized
LARGEST = 1.0               # pixels²: parts of a larger dot lie in several fine cells, which are not independent then
LOCAL_PX = 8, 16, 32        # sides of cells of which none may be far off
FARTHEST = 4.0              # standard deviations by which the farthest of a thousand cells is off by chance
EXPOSED = 1.5               # doublings of the number of dots, at most, from the one that the camera has


def noise_ratio_of_dots(image: Tensor, density: Tensor) -> float:
    """How far an image (R,R) of dots is from the density (R,R) of a code, exposed to its brightness: about 1 for
    independent dots that follow it, and more for others.

    It is the larger of two factors. One is how much the `grain` grows from cells to those twice as large, where
    independent dots have the same in both. The other is the deviation of the cell that is farthest off.
    """
    density = _exposed(density, float(image.mean()))
    area = min(max(grain(image, density), LEAST_VARIANCE), LARGEST)
    growth = (grain(image, density, COARSE_PX) / area) ** (1 / math.log2(COARSE_PX / FINE_PX))
    return max(growth, *(_deviation(image, density, area, cell) / FARTHEST for cell in LOCAL_PX))


def grain(image: Tensor, density: Tensor, cell: int = FINE_PX) -> float:
    """The area of a dot, pixels², by which independent dots that follow the density (R,R) would be as far from it as
    the image (R,R) is, in cells of this many pixels a side.

    A dot covers a pixel or does not, so the variance of a pixel is that area times I (1 - I).
    """
    return float(_sums(image - density, cell).square().sum() / _sums(_variance(density), cell).sum())


def _exposed(density: Tensor, brightness: float) -> Tensor:
    """The density from more or fewer dots, with this mean, or one as near to it as `EXPOSED` allows."""
    unlit = (1 - density).clamp_min(LEAST_VARIANCE).log()

    def shown(doublings: float) -> Tensor:
        return 1 - (unlit * 2**doublings).exp()

    best: Any = minimize_scalar(lambda doublings: (float(shown(doublings).mean()) - brightness)**2,
                                bounds=(-EXPOSED, EXPOSED), method="bounded", options={"xatol": 1e-3})
    return shown(float(best.x))


def _deviation(image: Tensor, density: Tensor, area: float, cell: int) -> float:
    """The largest deviation of a cell, in standard deviations of dots of this area. A pixel more of variance keeps a
    few stray dots from being far off where none are expected."""
    deviations = _sums(image - density, cell) / (area * (_sums(_variance(density), cell) + 1)).sqrt()
    return float(deviations.abs().max())


def _variance(density: Tensor) -> Tensor:
    return (density * (1 - density)).clamp_min(0) + LEAST_VARIANCE


def _sums(image: Tensor, cell: int) -> Tensor:
    """The sums over cells of an image (R,R); those at two of the edges may be smaller."""
    beyond = -len(image) % cell
    return avg_pool2d(pad(image, (0, beyond, 0, beyond))[None], cell) * cell**2
