"""The trunk of a tree: strokes where a picture shows what the copies of the whole leave over."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor

from ....cameras.strokes import extent, flat_maps, onto_segment
from ....ifs import affine, attractor
from ....ifs.canvas import canvas_to_pixel, pixel_to_canvas
from ....ops.collage.reference import contract
from ....runtime.seeds import derive
from ..image.objective import ImageObjective, Rendered
from ..limits import SMALLER

Segment = tuple[Tensor, Tensor]   # two ends (2,) on the canvas
LIT = 0.1          # grey level, as a share of the highest, above which a pixel belongs to a shape: thin lines are faint
DIRECTIONS = 180   # in which the extent of a shape is measured
BESIDE_PX = 2.5    # greatest distance from the images of the shape at which a lit pixel counts as drawn by them
LEAST_PX = 8.0     # length of a stroke
LINE_PX = 1.0      # distance at which a pixel counts as beside a line
GAP_PX = 4.0       # longest gap in a stroke
TRIALS = 200       # lines that are tried for each stroke


def with_trunk(objective: ImageObjective, found: Rendered, most: int) -> Rendered | None:
    """The copies of a code, which are its maps that are not flat, with at most so many flat maps for what they leave
    over of the picture. If they leave over no line, the code as it is, or None if it has no flat map. None if it has
    fewer than two copies.

    A drawing of a recursion consists of its copies and of the strokes between them. A lit pixel is left over if no
    image of a lit pixel is near. Segments are sought in the middle of what is left over, on the pixels that are at
    least as far from its outline as all of their neighbours. The longest is taken first.
    """
    params = objective.params
    flat = flat_maps(found.code)
    copies = contract(found.maps[~flat], SMALLER)
    shape = lit_shape(objective)
    if len(copies) < 2 or not bool(shape.any()):
        return None
    points = positions(shape)
    most = min(most, (params.most_maps or len(copies) + most) - len(copies))
    segments = _segments(_left_over(shape, points, copies), shape, most, objective.seed)
    if not segments:
        return found if bool(flat.any()) else None
    trunk = flat_maps_onto(segments, copies, points)
    return objective.judge(torch.cat([copies, trunk.to(copies)]))


def lit_shape(objective: ImageObjective) -> Tensor:
    """The mask (R,R) of what a picture shows."""
    return (objective.image > LIT * objective.image.max()).cpu()


def middle_of(shape: Tensor) -> Tensor:
    """The mask (R,R) of the pixels of a shape that are at least as far from its outline as all of their neighbours."""
    from scipy.ndimage import distance_transform_edt, maximum_filter

    inside = np.asarray(distance_transform_edt(np.pad(shape.numpy(), 1)))[1:-1, 1:-1]
    return shape & torch.from_numpy(inside >= maximum_filter(inside, 3))


def positions(shape: Tensor) -> Tensor:
    """Positions (n,2) on the canvas of the pixels of a mask (R,R)."""
    return pixel_to_canvas(shape.nonzero().double() + 0.5, len(shape))


def _left_over(shape: Tensor, points: Tensor, copies: Tensor) -> Tensor:
    """The pixels (R,R) of the shape that are far from the images of its points (n,2) under all copies."""
    from scipy.ndimage import distance_transform_edt

    side = len(shape)
    images = affine.images(copies.double().cpu(), points).flatten(0, 1)
    row, column = canvas_to_pixel(images[(images.abs() < 1).all(1)], side).long().unbind(1)
    drawn = torch.zeros(side, side, dtype=torch.bool)
    drawn[row, column] = True
    if not bool(drawn.any()):
        return shape
    return shape & torch.from_numpy(np.asarray(distance_transform_edt(~drawn.numpy())) > BESIDE_PX)


def _segments(mask: Tensor, shape: Tensor, most: int, seed: int) -> list[Segment]:
    """At most so many segments on a mask (R,R) of parts of a shape (R,R), the longest first, by RANSAC (Fischler and
    Bolles 1981): of the lines through random pairs of pixels, that with the longest run of pixels beside it."""
    from scipy.ndimage import maximum_filter

    rng, found, near = np.random.default_rng(derive(seed, "trunk")), [], maximum_filter(shape.numpy(), 3)
    left = np.argwhere(middle_of(mask).numpy()) + 0.5
    while len(left) >= 2 and len(found) < most:
        pairs = [rng.choice(len(left), 2, replace=False) for _ in range(TRIALS)]
        runs = (_run(left, near, left[first], left[second] - left[first]) for first, second in pairs)
        run = left[max(runs, key=lambda each: each[1])[0]]
        middle = run.mean(0)
        direction = np.linalg.svd(run - middle, full_matrices=False)[2][0]
        along = (run - middle) @ direction
        start, end = along.min(), along.max()
        if end - start < LEAST_PX:
            break
        ends = torch.from_numpy(np.stack([middle + place * direction for place in (start, end)]))
        found.append(tuple(pixel_to_canvas(ends, len(mask))))
        place = (left - middle) @ direction
        beside = np.linalg.norm(left - middle - place[:, None] * direction, axis=1)
        width = 2 * LINE_PX
        left = left[(beside > width) | (place < start - width) | (place > end + width)]
    return found


def _run(places: np.ndarray, lit: np.ndarray, origin: np.ndarray, direction: np.ndarray
         ) -> tuple[np.ndarray, float]:
    """Indices of the places (n,2) beside a line that form its longest run, and the length of this run. Two pieces are
    one run if the gap between them is small, or if it is shorter than both and the picture is `lit` (R,R) there: a
    branch may hide a part of its trunk."""
    direction = direction / np.linalg.norm(direction)
    along = (places - origin) @ direction
    beside = np.linalg.norm(places - origin - along[:, None] * direction, axis=1) <= LINE_PX

    def length(run: np.ndarray) -> float:
        return float(along[run[-1]] - along[run[0]])

    order = np.flatnonzero(beside)[along[beside].argsort()]
    pieces = np.split(order, np.flatnonzero(np.diff(along[order]) > GAP_PX) + 1)
    runs = pieces[:1]
    for before, piece in pairwise(pieces):
        gap = along[piece[0]] - along[before[-1]]
        is_bridged = gap <= min(length(before), length(piece)) and _is_lit(lit, places[before[-1]], places[piece[0]])
        runs = [*runs[:-1], np.concatenate([runs[-1], piece])] if is_bridged else [*runs, piece]
    longest = max(runs, key=length)
    return longest, length(longest)


def _is_lit(lit: np.ndarray, start: np.ndarray, end: np.ndarray) -> bool:
    """Whether all pixels between two places are lit."""
    row, column = np.linspace(start, end, math.ceil(np.abs(end - start).max()) + 1).astype(int).T
    return bool(lit[row, column].all())


def flat_maps_onto(segments: Sequence[Segment], copies: Tensor, points: Tensor) -> Tensor:
    """Maps (S,6) that project the attractor onto the axis in which the points (n,2) extend farthest, and take this axis
    to the segments, in the direction that turns it less."""
    angles = torch.arange(DIRECTIONS).double() * (torch.pi / DIRECTIONS)
    axes = torch.stack([angles.cos(), angles.sin()])
    places = points @ axes
    reach = places.amax(0) - places.amin(0)
    axis = axes[:, reach.argmax()]
    turned = [ends if (ends[1] - ends[0]) @ axis >= 0 else ends[::-1] for ends in segments]
    low, high = (points @ axis).aminmax()
    for _ in range(2):  # of the points, then of the attractor that has these strokes
        maps = torch.stack([onto_segment(axis, float(low), float(high), *ends) for ends in turned])
        maps = contract(maps, SMALLER)
        low, high = extent(attractor.support_function(affine.to_code(torch.cat([copies.double().cpu(), maps]))), axis)
    return maps
