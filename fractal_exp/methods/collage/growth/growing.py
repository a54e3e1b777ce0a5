"""The curve of likeness over the number of maps: from few maps to many, each set begun from the one before and anew."""

from __future__ import annotations

import torch
from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive, generator
from .. import maps as affine
from ..measure.levels import Coverage
from ..params import CollageParams
from ..state import Grown
from .coverage import Uncovered, areas, refined
from .paving import paving
from .silhouette import Silhouette, widened


class Grower:
    """Sets of more and more maps for the shape of an image (R,R). The drawn attractor alone decides between them: any
    pixel that it lights is one of the drawing's."""

    def __init__(self, image: Tensor, params: CollageParams, seed: int = 0,
                 deadline: Deadline = NO_DEADLINE):
        self.params, self.seed, self.deadline = params.growth, seed, deadline
        self.levels = Coverage(params.camera)
        self.shape = Silhouette.of(image, params.growth)
        self.loss = Uncovered(self.shape, params.growth)

    def grown(self, count: int, before: Grown | None = None) -> Grown:
        """The best set of so many maps: the set of fewer maps with new ones where it lacks light, or a paving, each
        after all maps were moved together; or the plain paving itself."""
        g, params = generator(self.seed, "growth", count), self.params
        plain = self.plain(count)
        tried = [plain, self.drawn(refined(plain.maps, self.loss, params.steps, g, self.deadline))]
        if before is not None and len(before.maps) < count:
            more = torch.cat([before.maps, self._born(before, count - len(before.maps))])
            tried.append(self.drawn(refined(more, self.loss, params.steps, g, self.deadline)))
        return max(tried, key=lambda each: each.likeness)

    def plain(self, count: int) -> Grown:
        """A plain paving by so many maps."""
        return self.drawn(paving(self.shape, count, derive(self.seed, "growth", count),
                                 largest=self.params.largest))

    def drawn(self, maps: Tensor) -> Grown:
        """The set of maps (N,6), its probabilities in proportion to what the images of the shape cover, so that all of
        it is drawn evenly."""
        g = generator(self.seed, "areas")
        weights = affine.normalized(areas(maps, self.shape, g))
        return Grown(maps, weights, self.likeness(affine.WeightedMaps(maps, weights)))

    def drawing(self, candidate: affine.WeightedMaps) -> Tensor:
        """What is drawn of a code, (R,R)."""
        return self.levels.render(candidate.code, self.shape.side, derive(self.seed, "drawing")).cpu()

    def likeness(self, candidate: affine.WeightedMaps) -> float:
        """The F1 within a pixel of what is drawn of a code."""
        return self.shape.likeness(self.drawing(candidate))

    def _born(self, before: Grown, count: int) -> Tensor:
        """New maps (count,6) that pave what is not drawn; the whole shape where there is too little of that."""
        missing = self.shape.mask & (widened(self.drawing(before) > 0) == 0)
        enough = int(missing.sum()) >= self.params.least_cell * count
        return paving(self.shape, count, derive(self.seed, "born", count), missing if enough else None,
                      largest=self.params.largest)
