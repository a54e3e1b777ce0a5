"""The curve of likeness over the number of maps. Each set starts both from the set before it and from scratch."""

from __future__ import annotations

import torch
from torch import Tensor

from ....cameras.levels import Coverage
from ....ifs import affine
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive, generator
from ..params import CollageParams
from ..state import Grown, WeightedMaps
from .coverage import Uncovered, areas, covering
from .paving import paving
from .silhouette import Silhouette, widened

LEAST_CELL = 4   # missing pixels per new map below which new maps are placed anywhere on the shape


class Grower:
    """Sets of more and more maps for the shape of an image (R,R). Only the drawn attractor decides between sets; every
    pixel that it lights counts as drawn."""

    def __init__(self, image: Tensor, params: CollageParams, seed: int = 0,
                 deadline: Deadline = NO_DEADLINE):
        self.params, self.seed, self.deadline = params.growth, seed, deadline
        self.levels = Coverage(params.camera)
        self.shape = Silhouette.of(image)
        self.loss = Uncovered(self.shape)

    def grown(self, count: int, before: Grown | None = None) -> Grown:
        """The best set of `count` maps. Three are compared: `before` with new maps where light is missing and a plain
        paving, each after all its maps have moved together, and the plain paving itself."""
        g, params = generator(self.seed, "growth", count), self.params
        plain = self.plain(count)
        tried = [plain, self.drawn(covering(plain.maps, self.loss, params.steps, g, self.deadline))]
        if before is not None and len(before.maps) < count:
            more = torch.cat([before.maps, self._born(before, count - len(before.maps))])
            tried.append(self.drawn(covering(more, self.loss, params.steps, g, self.deadline)))
        return max(tried, key=lambda each: each.likeness)

    def plain(self, count: int) -> Grown:
        """A plain paving by `count` maps."""
        return self.drawn(paving(self.shape, count, derive(self.seed, "growth", count)))

    def drawn(self, maps: Tensor) -> Grown:
        """The set of maps (N,6) with its likeness. Probabilities are proportional to the areas that the images of the
        shape cover, so the whole shape is drawn evenly."""
        g = generator(self.seed, "areas")
        weights = affine.normalized(areas(maps, self.shape, g))
        return Grown(maps, weights, self.likeness(WeightedMaps(maps, weights)))

    def drawing(self, candidate: WeightedMaps) -> Tensor:
        """The drawing (R,R) of a code."""
        return self.levels.render(candidate.code, self.shape.side, derive(self.seed, "drawing")).cpu()

    def likeness(self, candidate: WeightedMaps) -> float:
        """The F1 within a pixel of a code's drawing."""
        return self.shape.likeness(self.drawing(candidate))

    def _born(self, before: Grown, count: int) -> Tensor:
        """New maps (count,6) that pave the undrawn part of the shape, or the whole shape if that part is too small."""
        missing = self.shape.mask & (widened(self.drawing(before) > 0) == 0)
        enough = int(missing.sum()) >= LEAST_CELL * count
        return paving(self.shape, count, derive(self.seed, "born", count), missing if enough else None)
