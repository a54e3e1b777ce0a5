"""The measure of a picture that shows a part of a shape, and the search on it.

Copies of what the picture does not show may lie where it shows something. So the measure of a code goes on beyond the
window as the code's own attractor does: what is seen and what is inferred are pushed through the maps together. Errors
count fully where something is seen, and slightly where it is inferred: otherwise a wrong map could hide its image
there. The true code agrees with the measure that it completes itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ....cameras.points import attractor_points
from ....images.known import Known
from ....ops.collage import BinnedMeasure, pushforward
from ....runtime.seeds import derive
from ..bins import binned, hats
from ..limits import SMALLER
from ..params import CollageParams
from ..state import Candidate, WeightedMaps
from .search import NEIGHBOUR, MeasureSearch, Regime

POINTS = 10_000     # of the attractor, that complete a measure
MOST_UNSEEN = 4.0   # mass, relative to what is seen, that may be inferred
FARTHEST = 20.0     # canvas units, from whose middle on no mass is inferred
LEAST_SEEN = 1e-3   # mass of an attractor in the window, below which it is not scaled up to what is seen
INFERRED = 0.05     # share of inferred mass that is compared, in the place of all that is seen


def seen(masses: Tensor, size: int, known: Known | None, grids: int = BinnedMeasure.grids) -> BinnedMeasure:
    """`binned`, with the cells that are known: those that only known pixels share."""
    if known is None:
        return binned(masses, size, grids)
    shares, pixels = hats(len(masses), size).to(masses), known.mask(len(masses)).to(masses)
    unknown = shares.T @ (1 - pixels) @ shares
    measure = binned(masses * pixels, size, grids)
    return replace(measure, known=(unknown <= 0).to(measure.bins))


def completed(measures: Sequence[BinnedMeasure], found: WeightedMaps, resolution: int, known: Known | None, seed: int
              ) -> list[BinnedMeasure]:
    """Measures of an image (R,R), each on a grid of its own, that go on beyond what is known as the attractor of a code
    does. Where all is known, they stay as they are."""
    if known is None:
        return list(measures)
    points = attractor_points(found.maps, found.probabilities, POINTS, seed)
    inside = known.holds(points, resolution)
    beyond = points[~inside & (points.abs() < FARTHEST).all(1)]
    mass = min(MOST_UNSEEN, len(beyond) / max(1, int(inside.sum())))
    return [_extended(each, gathered(beyond, each.size, mass)) for each in measures]


def _extended(measure: BinnedMeasure, inferred: Tensor) -> BinnedMeasure:
    """A measure with inferred samples (K,3) in the cells that are not known; mass off the canvas in its edge cells."""
    assert measure.known is not None
    identity, one = inferred.new_tensor([[[1.0, 0, 0, 1, 0, 0]]]), inferred.new_ones(1, 1)
    bins, unknown = measure.bins, 1 - measure.known
    if len(inferred):
        bins = bins + pushforward(identity, one, inferred, measure.size)[0] * unknown
    return replace(measure, samples=torch.cat([measure.samples, inferred]), bins=bins,
                   known=measure.known + INFERRED * unknown)


def gathered(points: Tensor, size: int, mass: float) -> Tensor:
    """Points (P,2) that have this mass together, as samples (K,3) of x, y and mass: the centroids of cells as large as
    those of a grid of this size."""
    place = ((points + FARTHEST) * (size / 2)).floor().long()
    _, cell, counts = (place[:, 0] * round(FARTHEST * size + 1) + place[:, 1]).unique(return_inverse=True,
                                                                                      return_counts=True)
    sums = torch.zeros(len(counts), 2).to(points).index_add_(0, cell, points)
    return torch.cat([sums / counts[:, None], (mass / max(1, len(points)) * counts)[:, None]], 1)


class WindowSearch(MeasureSearch):
    """`MeasureSearch` on such a measure. Each set is judged on the measure that it completes itself."""

    def __init__(self, masses: Tensor, known: Known, regime: Regime, params: CollageParams, seed: int = 0,
                 smaller_limit: float = SMALLER):
        self.known, self.resolution = known, len(masses)
        super().__init__(masses, regime, params, seed, smaller_limit)
        self.seen = self.measure, self.coarse

    def _binned(self, masses: Tensor, size: int) -> BinnedMeasure:
        return seen(masses, size, self.known)

    def _complete(self, found: WeightedMaps) -> None:
        self._aim_at(*completed(self.seen, found, self.resolution, self.known, derive(self.seed, "unseen")))

    def judged(self, maps: Tensor, weights: Tensor, error: float) -> Candidate:
        self._complete(WeightedMaps(maps, weights))
        return super().judged(maps, weights, self._error(maps, weights))

    def _attractor(self, maps: Tensor, weights: Tensor) -> Tensor:
        """The measure (G,G) of the attractor, with the mass in the window that is seen there."""
        bins, seen = super()._attractor(maps, weights), self.seen[0]
        assert seen.known is not None
        return bins * ((seen.bins * seen.known).sum() / (bins * seen.known).sum().clamp_min(LEAST_SEEN))

    def resume(self, found: Candidate) -> Candidate:
        self._complete(found)
        return super().resume(found)

    def mixed(self, pool: Tensor, best: Candidate) -> Candidate:
        self._complete(best)
        return super().mixed(pool, best)

    def step(self, now: Candidate, number: int) -> Candidate:
        self._complete(now)
        return super().step(now, number)

    def pruned(self, maps: Tensor, weights: Tensor, error: float) -> Candidate:
        self._complete(WeightedMaps(maps, weights))
        return super().pruned(maps, weights, error)

    def _neighbours(self, sets: list[tuple[Tensor, Tensor]]) -> list[tuple[Tensor, Tensor, float]]:
        return [self._settled(maps, weights) for maps, weights, _ in super()._neighbours(sets)]

    def _settled(self, maps: Tensor, weights: Tensor) -> tuple[Tensor, Tensor, float]:
        """A set after its second descent, on what it completes itself, and its error there."""
        self._complete(WeightedMaps(maps, weights))
        maps, weights, _ = self.descend_one(maps, weights, NEIGHBOUR)
        self._complete(WeightedMaps(maps, weights))
        return maps, weights, self._error(maps, weights)


def search_on(masses: Tensor, known: Known | None, regime: Regime, params: CollageParams, seed: int,
              smaller_limit: float = SMALLER) -> MeasureSearch:
    """The search on the masses (R,R) of an image that shows a part of the canvas, None: all of it."""
    if known is None:
        return MeasureSearch(masses, regime, params, seed, smaller_limit)
    return WindowSearch(masses, known, regime, params, seed, smaller_limit)
