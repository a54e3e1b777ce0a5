"""The operations of collage search: a measure pushed through maps, and maps moved until they tile the measure.

By the collage theorem (Barnsley 1985) a code whose maps send a measure mu to nearly itself, sum_i w_i f_i#mu ~ mu, has
nearly mu as its attractor's measure. No chaos game is needed to see how nearly, so that a batch of codes is improved
in microseconds a step.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from types import ModuleType

import torch
from torch import Tensor

from ..errors import InputError
from . import reference_collage as reference
from .backends import choose
from .reference_collage import Descent

KERNELS = {"cpu": "cpu_collage", "cuda": "cuda_collage", "torch": "reference_collage"}  # modules with both functions

__all__ = ["BinnedMeasure", "Descent", "collage_error", "descend", "pushforward"]


@dataclass(frozen=True)
class BinnedMeasure:
    """A measure of mass 1 on the canvas [-1,1]² as the collage operations take it.

    samples (K,3): x, y, mass; bins (G,G): the same masses shared out bilinearly on a grid of G cells a side, row 0 at
    the top; levels: how many grids of G, G/2, G/4 … a side are compared. float32, on one device. Raises `InputError`
    if the side cannot be halved so often.
    """

    samples: Tensor
    bins: Tensor
    levels: int = 3

    def __post_init__(self) -> None:
        size = self.size
        if self.bins.shape != (size, size) or self.levels < 1 or size % 2 ** (self.levels - 1):
            raise InputError(f"the bins must be square with a side that can be halved {self.levels - 1} times, got "
                             f"{tuple(self.bins.shape)}")
        if self.samples.ndim != 2 or self.samples.shape[1] != 3 or len(self.samples) == 0:
            raise InputError(f"samples must have shape (K, 3) with K >= 1, got {tuple(self.samples.shape)}")
        points, mass = self.samples[:, :2], self.samples[:, 2:]
        mean = (points * mass).sum(0)
        off = points - mean
        object.__setattr__(self, "mean", mean)                                    # (2,)
        object.__setattr__(self, "covariance", (off * mass).T @ off)              # (2,2)
        grids = [self.bins]
        for _ in range(self.levels - 1):
            grids.append(torch.nn.functional.avg_pool2d(grids[-1][None, None], 2)[0, 0] * 4)
        roots = torch.cat([(grid + reference.FLOOR).sqrt().flatten() for grid in grids])
        object.__setattr__(self, "roots", roots)

    @property
    def size(self) -> int:
        """G, the cells a side."""
        return self.bins.shape[0]


def pushforward(maps: Tensor, weights: Tensor, samples: Tensor, size: int, *, backend: str = "auto") -> Tensor:
    """The measures sum_i w_i f_i#mu in bilinear bins: (B,N,6), (B,N) and samples (K,3) of x, y, mass -> (B,G,G).

    A map is a row a b c d e f, (x, y) -> (a x + b y + e, c x + d y + f); one of weight 0 is absent. What falls beyond
    the canvas is counted in its edge cells. Raises `InputError` on other shapes.
    """
    _check(maps, weights)
    return _backend(backend, maps).pushforward(maps, weights, samples, size)


def collage_error(bins: Tensor, measure: BinnedMeasure) -> Tensor:
    """How far bins (B,G,G) are from the measure, (B,): squared Hellinger distance sum (sqrt(q) - sqrt(m))², the mean
    over the measure's grids. 0 where they agree; the square root makes counting noise equal everywhere."""
    return reference.collage_error(bins, measure.roots, measure.levels)


def descend(maps: Tensor, weights: Tensor, measure: BinnedMeasure, how: Descent, *, backgrounds: Tensor | None = None,
            chosen: Tensor | None = None, backend: str = "auto") -> tuple[Tensor, Tensor, Tensor]:
    """Move maps (B,N,6) and weights (B,N) towards the least collage error: the new ones and their error (B,).

    Every code of the batch goes its own way, by Adam as `how` says. backgrounds (C,G,G) is a measure that is there
    already, chosen (B,) int64 says which one of them for each code. Raises `InputError` on other shapes.
    """
    _check(maps, weights)
    if backgrounds is None:
        backgrounds = torch.zeros(1, measure.size, measure.size, device=maps.device)
    if chosen is None:
        chosen = torch.zeros(len(maps), dtype=torch.int64, device=maps.device)
    if backgrounds.shape[1:] != measure.bins.shape or chosen.shape != (len(maps),):
        raise InputError(f"backgrounds must have shape (C, {measure.size}, {measure.size}) and chosen ({len(maps)},), "
                         f"got {tuple(backgrounds.shape)} and {tuple(chosen.shape)}")
    return _backend(backend, maps).descend(maps, weights, measure.samples, measure.roots, measure.mean,
                                           measure.covariance, backgrounds.flatten(1), chosen, measure.size,
                                           measure.levels, how)


def _backend(name: str, tensor: Tensor) -> ModuleType:
    return import_module(f"{__package__}.{KERNELS[choose(name, tensor)]}")


def _check(maps: Tensor, weights: Tensor) -> None:
    if maps.ndim != 3 or maps.shape[-1] != 6 or weights.shape != maps.shape[:2]:
        raise InputError(f"maps must have shape (B, N, 6) and weights (B, N), got {tuple(maps.shape)} and "
                         f"{tuple(weights.shape)}")
