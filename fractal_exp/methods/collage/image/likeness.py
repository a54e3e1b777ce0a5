"""How like a picture that others drew a code is, whatever the camera."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from ....ifs.code import IFS
from ....runtime.deadline import NO_DEADLINE, Deadline
from ..measure.levels import Levels
from .gauss_newton import polished
from .objective import ImageObjective, Rendered, error_of


def likeness_of(shown: Rendered, objective: ImageObjective) -> float:
    """F1 within a pixel of a code's drawing, but no more than of its attractor."""
    return min(objective.likeness(shown.image),
               likeness_of_attractor(shown.code, objective.image, objective.levels))


def without_unseen(objective: ImageObjective, shown: Rendered, least: int, deadline: Deadline = NO_DEADLINE
                   ) -> Rendered:
    """The code without maps whose loss lowers the likeness by no more than `MoveParams.unseen`, polished, at least so
    many stay: those that make up for a camera that is only nearly right, the widths of a tree's branches for one. Never
    a code whose error is more than `CanonicalParams.drawn_worse` times the first one's."""
    params, worst = objective.params, objective.params.canonical.drawn_worse * shown.error
    goal = likeness_of(shown, objective) - params.moves.unseen
    while len(shown.maps) > max(2, least) and not deadline.passed:
        fewer = [objective.without(shown, [i]) for i in range(len(shown.maps))]
        alike = [each for each in fewer if each.error <= worst and likeness_of(each, objective) >= goal]
        if not alike:
            break
        shown = polished(objective, min(alike, key=error_of), params.canonical.polish, deadline=deadline)
    return shown


def likeness_of_attractor(code: IFS, image: Tensor, levels: Levels) -> float:
    """F1 of two shares: of the attractor that lies within a pixel of the shape in an image (R,R), and of the shape that
    lies near the attractor: within a pixel of what the camera's pen draws there, or half the size of the tiles that it
    takes the picture to be made of. Where these are small (`CameraParams.small_tile_px`), half their size counts for
    the attractor as well: of a tree of few steps, it fills what the picture shows as a lattice. Tiles are drawn after
    the picture itself, and large ones alone would make a wrong code look right."""
    from scipy.ndimage import distance_transform_edt

    side = len(image)
    attractor = levels.occupied(code, side, 1, levels.points(side), 0, False).numpy() > 0
    shape = (image > levels.camera.threshold).cpu().numpy()
    if not attractor.any() or not shape.any():
        return 0.0
    lengths = {name: value * side / 2 for name, value in zip(levels.lengths, levels.values, strict=False)}
    pen, tile = lengths.get("pen_px", 0.0), lengths.get("tile_px", 0.0)
    near, inside = max(1.5 + pen, tile / 2), max(1.5, min(tile, levels.camera.small_tile_px) / 2)
    off, away = (np.asarray(distance_transform_edt(~mask), np.float32) for mask in (shape, attractor))
    precision, recall = float((off[attractor] < inside).mean()), float((away[shape] < near).mean())
    return 2 * precision * recall / max(precision + recall, 1e-9)
