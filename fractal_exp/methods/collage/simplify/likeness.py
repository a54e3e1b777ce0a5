"""The likeness of a code to a picture that others drew, whatever the camera."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from ....ifs.code import IFS
from ....runtime.deadline import NO_DEADLINE, Deadline
from ..camera.levels import Levels
from ..image.gauss_newton import polished
from ..image.objective import ImageObjective, Rendered, error_of


def likeness_of(shown: Rendered, objective: ImageObjective) -> float:
    """The likeness of a code's drawing (F1 within a pixel), or of its attractor if that is lower and the image shows
    the whole attractor."""
    drawing = objective.likeness(shown.image)
    if not objective.levels.is_whole:
        return drawing
    return min(drawing, likeness_of_attractor(shown.code, objective.image, objective.levels))


def without_unseen(objective: ImageObjective, shown: Rendered, least: int, deadline: Deadline = NO_DEADLINE
                   ) -> Rendered:
    """Remove maps that nobody sees, one at a time, and polish the others.

    Such maps compensate for an imperfect camera, for instance for the widths of a tree's branches. A map is removed if
    the likeness stays within `MoveParams.unseen` of the initial one, and the error within `worst_error`. At least
    `least` maps stay.
    """
    params, worst = objective.params, worst_error(objective, shown)
    if params.moves.unseen is None:
        return shown
    goal = likeness_of(shown, objective) - params.moves.unseen
    while len(shown.maps) > max(2, least) and not deadline.passed:
        fewer = [objective.without(shown, [i]) for i in range(len(shown.maps))]
        alike = [each for each in fewer if each.error <= worst and likeness_of(each, objective) >= goal]
        if not alike:
            break
        shown = polished(objective, min(alike, key=error_of), params.rounding.polish, deadline=deadline)
    return shown


def worst_error(objective: ImageObjective, shown: Rendered) -> float:
    """The highest error with which a simpler code may replace a code of a picture that others drew."""
    rounding = objective.params.rounding
    return rounding.drawn_worse * max(shown.error, objective.error_at(rounding.drawn_noise))


def likeness_of_attractor(code: IFS, image: Tensor, levels: Levels) -> float:
    """Agreement of a code's attractor with the shape in an image (R,R), as the F1 of a precision and a recall.

    Precision is the share of the attractor within a pixel of the shape. Recall is the share of the shape within a pixel
    of what the camera's pen draws around the attractor, or within half a tile or twig of the attractor.

    Precision also allows for half a tile: the attractor of a dragon fills what a drawing of few steps shows as a
    lattice. Large tiles look like the picture itself, and would make a wrong code look right. So the allowance is at
    most half of `CameraParams.small_tile_px`, except for a code of `CameraParams.tiled_maps` or fewer.
    """
    from scipy.ndimage import distance_transform_edt

    side = len(image)
    attractor = levels.occupied(code, side, 1, levels.points(side), 0, False).numpy() > 0
    shape = (image > levels.lit_above).cpu().numpy()
    if not attractor.any() or not shape.any():
        return 0.0
    pen, tile = levels.pen * side / 2, levels.smallest_part(code, side) * side / 2
    beside = levels.camera.beside_px
    largest = tile if len(code) <= levels.camera.tiled_maps else levels.camera.small_tile_px
    near, inside = max(beside + pen, tile / 2), max(beside, min(tile, largest) / 2)
    off, away = (np.asarray(distance_transform_edt(~mask), np.float32) for mask in (shape, attractor))
    precision, recall = float((off[attractor] < inside).mean()), float((away[shape] < near).mean())
    return 2 * precision * recall / max(precision + recall, 1e-9)
