"""Affine maps with weights, and on a measure. Maps are rows a b c d e f of tensors (…,6), see `ifs.affine`."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ...ifs.affine import (  # noqa: F401
    composed,
    compositions,
    from_code,
    inverse,
    largest_singular,
    normalized,
    preceded,
    random_matrices,
    root,
    rotations,
    sending,
    smaller_singular,
    to_code,
    volumes,
)
from ...ifs.code import IFS
from ...ops.collage import BinnedMeasure


@dataclass(frozen=True)
class WeightedMaps:
    """Maps (N,6) with weights.

    weights (N,): relative; the probability of a map is its weight over their sum. None: they are tied to |det| + 0.01.
    """

    maps: Tensor
    weights: Tensor | None

    @property
    def probabilities(self) -> Tensor:
        """(N,), summing to 1."""
        return normalized(volumes(self.maps) if self.weights is None else self.weights)

    @property
    def own_weights(self) -> Tensor:
        """`weights`, where they are not tied, as in all sets on the image's measure."""
        assert self.weights is not None
        return self.weights

    @property
    def code(self) -> IFS:
        """The code of the maps."""
        return to_code(self.maps, self.weights)



def distances(a: Tensor, b: Tensor, measure: BinnedMeasure) -> Tensor:
    """Root mean square over the measure of |f(x) - g(x)|, canvas units: maps (n,6) and (m,6) -> (n,m)."""
    difference = a[:, None] - b[None]
    linear = difference[..., :4].unflatten(-1, (2, 2))
    shift = linear @ measure.mean + difference[..., 4:]
    return (((linear @ measure.covariance) * linear).sum((-2, -1)) + shift.square().sum(-1)).sqrt()



def thinness(one: Tensor, measure: BinnedMeasure) -> float:
    """Width over length of a map's (6,) image of the measure, both as standard deviations."""
    width, length = _extents(one, measure)
    return width / max(length, 1e-6)



def width(one: Tensor, measure: BinnedMeasure) -> float:
    """The standard deviation of a map's (6,) image of the measure across its length, canvas units."""
    return _extents(one, measure)[0]



def _extents(one: Tensor, measure: BinnedMeasure) -> tuple[float, float]:
    linear = one[:4].view(2, 2).double()
    spread = torch.linalg.eigvalsh(linear @ measure.covariance.double() @ linear.T)
    return tuple(spread.clamp_min(0).sqrt().tolist())
