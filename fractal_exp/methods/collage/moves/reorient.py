"""Replace one map, small ones preferred, by candidates of equal mean and covariance in random orientations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ....cameras.points import attractor_points
from ....ifs.code import PROBABILITY_FLOOR
from ....runtime.seeds import derive
from .. import maps as affine
from ..image.objective import Rendered
from .lines import Light, profiled
from .new_map import small_maps, with_map, with_new_map

if TYPE_CHECKING:
    from .search import ImageSearch


def is_open(search: ImageSearch, shown: Rendered) -> bool:
    """True if another map stays."""
    return len(shown.maps) > 1


def neighbour(search: ImageSearch, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with one map in another orientation; for a line, also in other projections."""
    gone = small_maps(shown, g)
    rest, old = search.objective.without(shown, gone), shown.maps[gone[0]]
    found = [search.polished_last(with_new_map(search, rest, shown, old, g), shown, search.params.moves.polish_new)]
    if search.params.lines.enabled and search.objective.levels.is_graded and _is_line(search, shown, old) \
            and not search.deadline.passed:
        found += _reprojected(search, rest, shown, gone[0])
    return min(found, key=lambda rendered: rendered.error)


def _is_line(search: ImageSearch, shown: Rendered, old: Tensor) -> bool:
    """Whether the image of the map (6,) is thin, and at most `LineParams.widest_px` wide."""
    measure, side = search.corrected_measure(shown).fine, search.objective.image.shape[0]
    widest = search.params.lines.widest_px
    return affine.thinness(old, measure) < search.params.moves.thin and 2 * side * affine.width(old, measure) < widest


def _reprojected(search: ImageSearch, rest: Rendered, shown: Rendered, gone: int) -> list[Rendered]:
    """The rest of the code with the removed map, a line, in other projections that fit the light along it. Hopeful
    codes are polished, the others are left out."""
    params, objective = search.params, search.objective
    volumes = affine.volumes(rest.maps).sum() + PROBABILITY_FLOOR
    share = PROBABILITY_FLOOR / volumes if rest.weights is None else shown.probabilities[gone]
    points = attractor_points(shown.maps, shown.probabilities, params.lines.points, derive(objective.seed, "profile"))
    light = Light(objective.image, rest.image, objective.levels.supersample, params.camera.points_per_pixel)
    tried = [with_map(objective, rest, each, share)
             for each in profiled(shown.maps[gone], float(share), points, light, params.lines)]
    return [search.polished(each, params.lines.polish, [len(each.maps) - 1]) for each in tried
            if each.error < params.moves.hopeful * shown.error]
