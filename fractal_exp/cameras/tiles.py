"""Constructions that ended after some steps: copies of one shape, as polygons and turtles draw them.

A picture W^d(B) consists of the images of an initiator B under all words of d maps. B is unknown, but under the true
code each word shows it: pulled back by its word, every part of the picture is the same.
"""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from ..ifs import affine
from ..ifs.attractor import FRAME_SIDE
from ..ifs.code import IFS
from .tile_kernels import collect, mark

MOST_WORDS = 6000   # under which a tile is drawn
WORDS_SEEN = 800    # that show the shape of a tile: enough for its mean
SIDE = 1.13         # of the grid on which this shape is estimated, relative to the frame's: a tile may exceed it
CELLS = 12, 160     # least and greatest number of cells per side of this grid; between them, one for each subpixel
LIT = 0.5           # share of the highest level on this grid above which a cell belongs to a tile
USUAL = 0.65        # quantile of the levels of these cells that tells a thin grey line from a white area


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


def tiled(image: Tensor, code: IFS, size: float, resolution: int, fine: int) -> Tensor:
    """The picture (resolution, resolution) that the image (R,R) would be if all its parts of this size (canvas units)
    were the same: the covered share of each pixel, from `fine`² subpixels."""
    found = words(affine.from_code(code).cpu(), size, MOST_WORDS)
    fewest, most = CELLS
    cells = min(most, max(fewest, math.ceil(SIDE * size * resolution * fine / 2)))
    if not len(found):
        return image.new_zeros(resolution, resolution)
    order = torch.randperm(len(found), generator=torch.Generator().manual_seed(0))  # any, but always the same
    places, shown = _initiator(image, found[order[:WORDS_SEEN]], cells)
    lit = _inked(shown)
    occupied = np.zeros((resolution * fine,) * 2, np.float32)
    mark(found.numpy(), places[lit].numpy(), occupied)
    return avg_pool2d(torch.from_numpy(occupied).to(image.device)[None], fine)[0]


def _inked(levels: Tensor) -> Tensor:
    """The cells (K,) that a tile covers, from the mean level (K,) of each.

    Cells above a share of the highest level belong to the tile. If the tile is white inside, it covers all of them. A
    line thinner than a pixel is grey. Of its cells, the brightest are covered, and their share is the usual level.
    """
    order = levels.argsort(descending=True, stable=True)
    inside = int((levels > LIT * levels.max().clamp_min(1e-6)).sum())
    usual = float(levels[order[min(int((1 - USUAL) * inside), inside - 1)]].clamp(0, 1))
    lit = torch.zeros(len(levels), dtype=torch.bool)
    lit[order[:math.ceil(usual * inside)]] = True
    return lit


def _initiator(image: Tensor, found: Tensor, cells: int) -> tuple[Tensor, Tensor]:
    """The centres (K,2) of a grid with `cells` per side, which is `SIDE` times the frame's, and the mean level (K,)
    that words (M,6) show there, weighted by their areas."""
    half = SIDE * FRAME_SIDE / 2
    axis = ((torch.arange(cells) + 0.5) / cells * 2 - 1) * half
    places = torch.stack([axis.repeat(cells), axis.repeat_interleave(cells)], 1)
    areas = (found[:, 0] * found[:, 3] - found[:, 1] * found[:, 2]).abs() + 1e-12
    levels = np.zeros(len(places))
    collect(image.cpu().float().numpy(), found.numpy(), (areas / areas.sum()).numpy(), places.numpy(), levels)
    return places, torch.from_numpy(levels).float()
