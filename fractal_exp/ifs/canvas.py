"""Where the pixels of a square image are on the canvas [-1,1]².

A position in an image is (row, column), in pixels from its upper left corner. So pixel (r, c) covers r to r + 1 and
c to c + 1, and its centre is at (r + 0.5, c + 0.5). A position on the canvas is (x, y), x to the right and y up.
"""

from __future__ import annotations

import torch
from torch import Tensor


def pixel_to_canvas(places: Tensor, side: int) -> Tensor:
    """Positions (…,2) on the canvas of places (…,2), (row, column), in an image of `side` pixels a side."""
    row, column = places.unbind(-1)
    return torch.stack([2 * column / side - 1, 1 - 2 * row / side], -1)


def canvas_to_pixel(points: Tensor, side: int) -> Tensor:
    """Places (…,2), (row, column), of points (…,2) of the canvas in an image of `side` pixels a side. Their integer
    parts are the pixel, for points on the canvas."""
    x, y = points.unbind(-1)
    return torch.stack([(1 - y) * (side / 2), (x + 1) * (side / 2)], -1)
