"""Replace one map, small ones preferred, by candidates of equal mean and covariance in random orientations."""

from __future__ import annotations

import torch
from torch import Tensor

from ....cameras.points import attractor_points
from ....ifs.code import PROBABILITY_FLOOR
from ....runtime.seeds import derive
from .. import maps as affine
from ..image.objective import Rendered
from .lines import Light, profiled
from .new_map import THIN, small_maps, with_map, with_new_map
from .tools import HOPEFUL, Tools

WIDEST_PX = 2.0   # width of a line, pixels, taken as four standard deviations
POINTS = 50_000   # of the attractor that are projected onto a line
STEPS = 3         # Gauss-Newton steps of each projection


def is_open(tools: Tools, shown: Rendered) -> bool:
    """True if another map stays."""
    return len(shown.maps) > 1


def neighbour(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with one map in another orientation; for a line, also in other projections."""
    gone = small_maps(shown, g)
    rest, old = tools.objective.without(shown, gone), shown.maps[gone[0]]
    found = [tools.polished_last(with_new_map(tools, rest, shown, old, g), shown)]
    if tools.params.lines.enabled and tools.objective.levels.is_graded and _is_line(tools, shown, old) \
            and not tools.deadline.passed:
        found += _reprojected(tools, rest, shown, gone[0])
    return min(found, key=lambda rendered: rendered.error)


def _is_line(tools: Tools, shown: Rendered, old: Tensor) -> bool:
    """Whether the image of the map (6,) is thin, and at most `WIDEST_PX` wide."""
    measure, side = tools.corrected_measure(shown).fine, tools.objective.image.shape[0]
    return affine.thinness(old, measure) < THIN and 2 * side * affine.width(old, measure) < WIDEST_PX


def _reprojected(tools: Tools, rest: Rendered, shown: Rendered, gone: int) -> list[Rendered]:
    """The rest of the code with the removed map, a line, in other projections that fit the light along it. Hopeful
    codes are polished, the others are left out."""
    params, objective = tools.params, tools.objective
    volumes = affine.volumes(rest.maps).sum() + PROBABILITY_FLOOR
    share = PROBABILITY_FLOOR / volumes if rest.weights is None else shown.probabilities[gone]
    points = attractor_points(shown.maps, shown.probabilities, POINTS, derive(objective.seed, "profile"))
    light = Light(objective.image, rest.image, objective.levels.supersample, params.camera.points_per_pixel)
    tried = [with_map(objective, rest, each, share)
             for each in profiled(shown.maps[gone], float(share), points, light, params.lines.count)]
    return [tools.polished(each, STEPS, [len(each.maps) - 1]) for each in tried
            if each.error < HOPEFUL * shown.error]
