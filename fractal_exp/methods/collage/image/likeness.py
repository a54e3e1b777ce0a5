"""How like a picture that others drew a code is, whatever the camera."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from ....ifs.code import IFS
from ..measure.levels import Levels
from ..state import Candidate
from .objective import ImageObjective


def likeness_of(candidate: Candidate, objective: ImageObjective) -> float:
    """F1 within a pixel of the candidate's drawing, but no more than of its attractor."""
    drawn = objective.likeness(objective.judge(candidate.maps, candidate.weights).image)
    return min(drawn, likeness_of_attractor(candidate.code, objective.image, objective.levels))


def likeness_of_attractor(code: IFS, image: Tensor, levels: Levels) -> float:
    """F1 of two shares: of the attractor that lies within a pixel of the shape in an image (R,R), and of the shape that
    lies near the attractor: within a pixel of what the camera's pen draws there, or half the size of the tiles that it
    takes the picture to be made of. Tiles are drawn after the picture itself, and alone would make a wrong code look
    right."""
    from scipy.ndimage import distance_transform_edt

    side = len(image)
    attractor = levels.occupied(code, side, 1, levels.points(side), 0, False).numpy() > 0
    shape = (image > levels.camera.threshold).cpu().numpy()
    if not attractor.any() or not shape.any():
        return 0.0
    lengths = {name: value * side / 2 for name, value in zip(levels.lengths, levels.values, strict=False)}
    near = max(1.5 + lengths.get("pen_px", 0.0), lengths.get("tile_px", 0.0) / 2)
    off, away = (np.asarray(distance_transform_edt(~mask), np.float32) for mask in (shape, attractor))
    precision, recall = float((off[attractor] < 1.5).mean()), float((away[shape] < near).mean())
    return 2 * precision * recall / max(precision + recall, 1e-9)
