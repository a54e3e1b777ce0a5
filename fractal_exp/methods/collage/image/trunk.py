"""The trunk of a tree: strokes where a picture shows what the copies of the whole leave over."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ....runtime.seeds import derive
from .. import maps as affine
from ..measure.strokes import flat_maps
from ..params import CollageParams
from .objective import ImageObjective, Rendered


def with_trunk(objective: ImageObjective, found: Rendered) -> Rendered | None:
    """The copies of a code, which are its maps that are not flat, with flat maps for what they leave over of the
    picture; None if there are fewer than two copies, or if they leave over no line.

    A drawing of a recursion consists of its copies and of the strokes between them. A pixel is left over if no image of
    a lit pixel is near. What is left over is thinned to lines one pixel wide. Segments are found on them one after the
    other, the longest first, by RANSAC (Fischler and Bolles 1981). Each gets a map that flattens the shape along its
    longer axis.
    """
    params = objective.params
    copies = found.maps[~flat_maps(found.code, params.camera)]
    shape = (objective.image > objective.levels.lit_above).cpu()
    if len(copies) < 2 or not bool(shape.any()):
        return None
    points = _centres(shape)
    segments = _segments(_left_over(shape, points, copies, params), params, objective.seed)
    if not segments:
        return None
    trunk = torch.stack([_flattened(points, *map(torch.from_numpy, ends)) for ends in segments]).to(copies)
    return objective.judge(torch.cat([copies, trunk]))


def _centres(shape: Tensor) -> Tensor:
    """Positions (n,2) on the canvas of the pixels of a mask (R,R)."""
    row, column = shape.nonzero().double().T + 0.5
    return torch.stack([2 * column / len(shape) - 1, 1 - 2 * row / len(shape)], 1)


def _left_over(shape: Tensor, points: Tensor, copies: Tensor, params: CollageParams) -> np.ndarray:
    """The pixels (R,R) of the shape that are far from the images of its points under all copies."""
    from scipy.ndimage import distance_transform_edt

    side = len(shape)
    linear = copies[:, :4].unflatten(1, (2, 2)).double().cpu()
    images = (points @ linear.transpose(1, 2) + copies[:, None, 4:].double().cpu()).flatten(0, 1)
    column, row = ((images * images.new_tensor([1, -1]) + 1) * (side / 2)).floor().long().clamp(0, side - 1).unbind(1)
    drawn = torch.zeros(side, side, dtype=torch.bool)
    drawn[row, column] = True
    distance = np.asarray(distance_transform_edt(~drawn.numpy()))
    return shape.numpy() & (distance > params.camera.trunk_beside_px)


def _segments(mask: np.ndarray, params: CollageParams, seed: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Pairs of ends (2,) on the canvas of the segments on a mask (R,R), the longest first."""
    from skimage.measure import LineModelND, ransac
    from skimage.morphology import skeletonize

    camera, found = params.camera, []
    left = np.argwhere(skeletonize(mask)) + 0.5
    while len(left) >= camera.trunk_least_px and len(found) < camera.trunk_strokes:
        _, inliers = ransac(left, LineModelND, min_samples=2, residual_threshold=1.0, max_trials=200,
                            rng=derive(seed, "trunk", len(found)) % 2**32)
        if inliers is None:
            break
        middle = left[inliers].mean(0)
        direction = np.linalg.svd(left[inliers] - middle, full_matrices=False)[2][0]
        along = (left - middle) @ direction
        start, end = _longest_run(np.sort(along[inliers]), camera.trunk_least_px / 2)
        if end - start < camera.trunk_least_px:
            break
        found.append(tuple(_on_canvas(middle + direction * place, len(mask)) for place in (start, end)))
        beside = np.linalg.norm(left - middle - along[:, None] * direction, axis=1)
        left = left[(beside > 2) | (along < start - 1) | (along > end + 1)]
    return found


def _longest_run(places: np.ndarray, gap: float) -> tuple[float, float]:
    """First and last of the most places in ascending order of which none is farther than a gap from the next."""
    runs = np.split(places, np.nonzero(np.diff(places) > gap)[0] + 1)
    most = max(runs, key=len)
    return float(most[0]), float(most[-1])


def _on_canvas(pixel: np.ndarray, side: int) -> np.ndarray:
    """The position on the canvas of a (row, column)."""
    return np.array([2 * pixel[1] / side - 1, 1 - 2 * pixel[0] / side])


def _flattened(points: Tensor, first: Tensor, last: Tensor) -> Tensor:
    """The map (6,) that projects points (n,2) onto their longer axis and takes this axis to a segment."""
    mean = points.mean(0)
    axis = torch.linalg.svd(points - mean, full_matrices=False)[2][0]
    places = points @ axis
    low, high = places.min(), places.max()
    linear = torch.outer((last - first) / (high - low), axis)
    return affine.sending(linear[None], (axis * low)[None], first[None])[0]
