"""Constructions that ended after some steps: copies of one shape, as polygons and turtles draw them.

A picture W^d(B) consists of the images of an initiator B under all words of d maps. B is unknown, but under the true
code each word shows it: pulled back by its word, every part of the picture is the same.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d, grid_sample

from ....ifs.attractor import FRAME_SIDE
from ....ifs.code import IFS
from .. import maps as affine
from .camera_params import CameraParams


def words(maps: Tensor, size: float, most: int) -> Tensor:
    """The shortest words (M,6) of maps (N,6) that shrink the frame to at most `size`, canvas units. Only some of them
    if there are more than `most`, as for maps that hardly contract."""
    done, left = [], torch.eye(3, dtype=torch.float64)[:2].T.reshape(1, 6)[:, [0, 2, 1, 3, 4, 5]]
    maps = maps.double()
    while len(left):
        small = FRAME_SIDE * affine.largest_singular(left) <= size
        done.append(left[small])
        left = left[~small]
        if sum(map(len, done)) + len(left) * len(maps) > most:
            break
        left = affine.compositions(left, maps)
    return torch.cat(done).float()


def tiled(image: Tensor, code: IFS, size: float, resolution: int, fine: int, *, camera: CameraParams) -> Tensor:
    """The picture (resolution, resolution) that the image (R,R) would be if all its parts of this size (canvas units)
    were the same: the covered share of each pixel, from `fine`² subpixels."""
    found = words(affine.from_code(code), size, camera.tile_words)
    fewest, most = camera.tile_cells
    cells = min(most, max(fewest, math.ceil(camera.tile_side * size * resolution * fine / 2)))
    if not len(found):
        return image.new_zeros(resolution, resolution)
    order = torch.randperm(len(found), generator=torch.Generator().manual_seed(0))  # any, but always the same
    places, shown = _initiator(image, found[order[:camera.tile_words_seen]], cells, camera.tile_side)
    lit = shown > camera.tile_lit * shown.max().clamp_min(1e-6)
    points = _images(found, places[lit]).flatten(0, 1)
    side = resolution * fine
    column, row = (((points * points.new_tensor([1, -1]) + 1) * (side / 2)).long().clamp(0, side - 1)).unbind(1)
    occupied = torch.zeros(side * side)
    occupied[row * side + column] = 1
    return avg_pool2d(occupied.view(1, side, side), fine)[0]


def _initiator(image: Tensor, found: Tensor, cells: int, side: float) -> tuple[Tensor, Tensor]:
    """The centres (K,2) of a grid with `cells` per side, which is `side` times the frame's, and the mean level (K,)
    that words (M,6) show there, weighted by their areas."""
    half = side * FRAME_SIDE / 2
    axis = ((torch.arange(cells) + 0.5) / cells * 2 - 1) * half
    places = torch.stack([axis.repeat(cells), axis.repeat_interleave(cells)], 1)
    at = _images(found, places) * places.new_tensor([1, -1])
    levels = grid_sample(image[None, None].float(), at[None], align_corners=False)[0, 0]
    areas = (found[:, 0] * found[:, 3] - found[:, 1] * found[:, 2]).abs() + 1e-12
    return places, (areas / areas.sum()) @ levels


def _images(found: Tensor, points: Tensor) -> Tensor:
    """Where maps (M,6) send points (K,2): (M,K,2)."""
    return points @ found[:, :4].unflatten(1, (2, 2)).transpose(1, 2) + found[:, None, 4:]
