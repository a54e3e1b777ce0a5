"""The grain of a scatter plot: how far it is from the density of a code, and how far it would be by chance."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from .levels import LEAST_VARIANCE

FINE_PX, COARSE_PX = 3, 8   # sides of cells whose grain is compared; finer ones show how the picture was resized
LARGEST = 1.0               # pixels²: parts of a larger dot lie in several fine cells, which are not independent then
LOCAL_PX = 8, 16            # sides of cells of which none may be far off
FARTHEST = 4.0              # standard deviations by which the farthest of a thousand cells is off by chance


def misfit(image: Tensor, density: Tensor) -> float:
    """How far an image (R,R) of dots is from the density (R,R) of a code, seen with its tone: about 1 for independent
    dots that follow it. It is the larger of two factors. One is how much the `grain` grows from cells to those twice as
    large, where independent dots have the same in both. The other is the deviation of the cell that is farthest off."""
    density = _toned(density, image)
    fine = min(max(_area(image, density, FINE_PX), LEAST_VARIANCE), LARGEST)
    grown = (_area(image, density, COARSE_PX) / fine) ** (1 / math.log2(COARSE_PX / FINE_PX))
    farthest = max(_deviation(image, density, fine, cell) for cell in LOCAL_PX)
    return max(grown, farthest / FARTHEST)


def grain(image: Tensor, density: Tensor, cell: int = FINE_PX) -> float:
    """The area of a dot, pixels², by which independent dots that follow the density (R,R), seen with the image's tone,
    would be as far from it as the image (R,R) is, in cells of this many pixels a side."""
    return _area(image, _toned(density, image), cell)


def _area(image: Tensor, density: Tensor, cell: int) -> float:
    """A dot covers a pixel or does not, so the variance of a pixel is its area times I (1 - I)."""
    left, variance = (avg_pool2d(each[None], cell) for each in (image - density, _variance(density)))
    return float(left.square().sum() / variance.sum() * cell**2)


def _toned(density: Tensor, image: Tensor) -> Tensor:
    """The monotone function of the density that is nearest to the image. A dot that overlaps others adds less, and how
    much less depends on its shape, which the camera does not know."""
    from scipy.optimize import isotonic_regression

    order = density.flatten().argsort()
    toned = torch.empty_like(density).flatten()
    toned[order] = torch.from_numpy(isotonic_regression(image.flatten()[order].double().numpy()).x).to(toned)
    return toned.view_as(density).clamp(0, 1)


def _deviation(image: Tensor, density: Tensor, area: float, cell: int) -> float:
    """The largest deviation of a cell, in standard deviations of dots of this area. A pixel more of variance keeps a
    few stray dots from being far off where none are expected."""
    left, variance = (avg_pool2d(each[None], cell) * cell**2 for each in (image - density, _variance(density)))
    return float((left / (area * (variance + 1)).sqrt()).abs().max())


def _variance(density: Tensor) -> Tensor:
    return (density * (1 - density)).clamp_min(0) + LEAST_VARIANCE
