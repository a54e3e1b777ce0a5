"""How far a map of the search may stretch."""

from __future__ import annotations

import torch
from torch import Tensor

from ...ifs.affine import largest_singular, to_code
from ...ifs.contraction import NEITHER
from ...ops.collage.reference import contract

LARGEST = 1.75      # of a larger singular value: maps of FractalDB-1k stretch by up to 1.71
SMALLER = 0.9995    # of a smaller one, and of both where the code would not contract otherwise
THIN = 0.1          # a shape's width over its length, standard deviations, below which no map of it may stretch


def largest_for(covariance: Tensor) -> float:
    """The upper limit of the larger singular values of maps for a shape with this covariance (2,2). A shape on a line
    says nothing of what maps do across it, so they may not stretch there."""
    width, length = torch.linalg.eigvalsh(covariance.double()).clamp_min(0).sqrt().tolist()
    return LARGEST if width >= THIN * length else SMALLER


def limited(maps: Tensor, weights: Tensor | None = None, largest: float = LARGEST) -> Tensor:
    """The maps (…,N,6) with singular values at most `largest` and `SMALLER`; at most `SMALLER` both if their code, with
    probabilities in proportion to the weights (N,), would contract not even on average, so that nothing can draw it."""
    maps = contract(maps, largest, SMALLER)
    if bool((largest_singular(maps) < 1).all()) or not bool(torch.isfinite(maps).all()):
        return maps
    if maps.ndim > 2:
        return torch.stack([limited(each, weights, largest) for each in maps])
    return contract(maps, SMALLER) if to_code(maps, weights).contraction.kind == NEITHER else maps
