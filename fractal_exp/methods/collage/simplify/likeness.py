"""The likeness of a code to a picture that others drew, whatever the camera."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from ....ifs.code import IFS
from ..camera.levels import Levels
from ..image.objective import ImageObjective, Rendered

ALIKE = 0.985   # likeness from which the code of a picture that others drew is settled, and at which tiles explain it


def likeness_of(shown: Rendered, objective: ImageObjective) -> float:
    """The likeness of a code's drawing (F1 within a pixel), or of its attractor if that is lower and the image shows
    the whole attractor."""
    return min(likenesses(shown, objective)) if objective.levels.is_whole else objective.likeness(shown.image)


def likenesses(shown: Rendered, objective: ImageObjective) -> tuple[float, float]:
    """The likeness of a code's drawing, and that of its attractor."""
    return objective.likeness(shown.image), likeness_of_attractor(shown.code, objective.image, objective.levels)


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
