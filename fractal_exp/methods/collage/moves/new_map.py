"""How a code gets a new map: the best of many candidates, judged first by the measure and finally by renderings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ....ops.collage import BinnedMeasure, Descent, descend, pushforward
from .. import maps as affine
from ..bins import binned, grid_for, halve
from ..image.objective import ImageObjective, Rendered
from ..measure.births import candidates, mirrored, narrowed, reoriented, visible_weights
from ..measure.saturation import correction

if TYPE_CHECKING:
    from .search import ImageSearch


@dataclass(frozen=True)
class CorrectedMeasure:
    """The image's measure on a fine and a coarse grid, corrected for saturation with the code of these maps; the
    correction (R,R), and the sum of the corrected masses."""

    maps: Tensor
    fine: BinnedMeasure
    coarse: BinnedMeasure
    correction: Tensor
    total: Tensor

    @classmethod
    def of(cls, masses: Tensor, shown: Rendered, objective: ImageObjective, seed: int) -> CorrectedMeasure:
        """The corrected measure of an image's masses (R,R)."""
        params = objective.params
        factors = correction(masses, shown.code, objective.levels, params.saturation, seed)
        corrected = masses * factors
        size = grid_for(masses.shape[0], params.moves.grid)
        return cls(shown.maps, binned(corrected, size), binned(corrected, size // 2), factors, corrected.sum())

    def explained(self, rendered: Rendered, volume: Tensor, objective: ImageObjective) -> Tensor:
        """The part (G,G) of the measure that maps of a code of this volume tile, or that their rendering shows. If a
        map is missing, its copies are missing in the rendering too, but the other maps will show them once it is there.
        And where maps tile the measure unlike the grey levels suggest, the difference must not be filled."""
        measure = self.fine
        shares = affine.volumes(rendered.maps) / volume if rendered.weights is None else rendered.weights
        tiled = pushforward(rendered.maps[None], shares[None], measure.samples, measure.size)[0]
        seen = objective.levels.measure(rendered.image) * self.correction
        if bool(seen.any()):
            shown = binned(seen, measure.size)
            tiled = torch.maximum(tiled, shown.bins * (seen.sum() / self.total))
        return torch.minimum(tiled, measure.bins)


def with_new_map(search: ImageSearch, rest: Rendered, shown: Rendered, old: Tensor | None, g: torch.Generator
                 ) -> Rendered:
    """`rest`, a part of the code `shown`, with the best of many new maps. They are born where mass is missing or, if
    the map `old` (6,) is given, which `rest` lacks, they are `old` in other orientations."""
    params, objective = search.params.moves, search.objective
    corrected = search.corrected_measure(shown)
    measure, coarse = corrected.fine, corrected.coarse
    volume = affine.volumes(shown.maps).sum()
    explained = corrected.explained(rest, volume, objective)
    renderings = []
    if old is not None:
        born = reoriented(old, measure, params, g, reflections=search.params.births.reflections)
        if affine.thinness(old, measure) < params.thin:  # no grid shows how a line was projected
            lines = narrowed(born, measure, params.widths[-1])
            renderings += [with_map(objective, rest, each, affine.volumes(each[None])[0] / volume) for each in lines]
    else:
        born = _born(search, measure, explained, g)
    background, coarsely = explained[None], halve(explained[None], coarse.size)
    lacking = (measure.bins - explained).clamp_min(0).sum()
    weights = (affine.volumes(born) / volume).clamp_max(lacking).clamp_min(1e-6)
    weights = visible_weights(born, weights, coarse, coarsely, params.visible_shares)
    rough, fine = (Descent(**how.model_dump(), prior=0.0) for how in (params.rough, params.fine))
    born, weights, errors = descend(born[:, None], weights[:, None], coarse, rough, backgrounds=coarsely)
    best = errors.argsort()[:params.kept]
    born, weights, errors = descend(born[best], weights[best], measure, fine, backgrounds=background)
    best = errors.argsort()[:params.rendered]
    renderings += _rendered(search, rest, measure, born[best, 0], weights[best, 0])
    likeliest = min(renderings, key=_error).maps[-1]
    models = [model for model in (likeliest, old) if model is not None] if params.mirrored else []
    for model in models:
        renderings += [with_map(objective, rest, each, weights[best[0], 0]) for each in mirrored(model, measure)]
    return min(renderings, key=_error)


def with_map(objective: ImageObjective, rest: Rendered, born: Tensor, weight: Tensor) -> Rendered:
    """The code with one map (6,) more."""
    return objective.judge(torch.cat([rest.maps, born[None]]),
                           None if rest.weights is None else torch.cat([rest.weights, weight[None]]))


def small_maps(shown: Rendered, g: torch.Generator, count: int = 1) -> list[int]:
    """Indices of random maps, small ones preferred."""
    return torch.multinomial(1 / affine.volumes(shown.maps).cpu(), count, generator=g).tolist()


def _born(search: ImageSearch, measure: BinnedMeasure, explained: Tensor, g: torch.Generator) -> Tensor:
    params, births = search.params.moves, search.params.births
    wanted = (measure.bins.clamp_min(0).sqrt() - explained.clamp_min(0).sqrt()).square() + 1e-12
    place = wanted if births.residual else measure.bins
    return candidates(place, wanted, measure, params.sizes, params.candidates, int(params.candidates * params.blobs),
                      births, g)


def _rendered(search: ImageSearch, rest: Rendered, measure: BinnedMeasure, born: Tensor, weights: Tensor
              ) -> list[Rendered]:
    """The code with each of these maps (n,6): the first at several widths, the others at the width that suits it."""
    widths = search.params.moves.widths
    first = torch.cat([narrowed(born[:1], measure, width) for width in widths])
    tried = [with_map(search.objective, rest, each, weights[0]) for each in first]
    width = min(range(len(widths)), key=lambda k: tried[k].error)
    return [*tried, *(with_map(search.objective, rest, each, weight) for each, weight in
                      zip(narrowed(born[1:], measure, widths[width]), weights[1:], strict=True))]


def _error(rendered: Rendered) -> float:
    return rendered.error
