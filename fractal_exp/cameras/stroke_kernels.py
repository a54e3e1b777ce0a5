"""The numba kernel of `strokes`."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..runtime.jit import kernel


@njit
def _near(x: float, y: float, along: float, down: float, row: int, far: float) -> tuple[float, float]:
    """The first and the last column that may be nearer than `far` to a segment, in this row. The segment begins at
    (x, y)."""
    start, end = 0.0, 1.0
    if abs(down) > 1e-9:
        start, end = (row - far - y) / down, (row + far - y) / down
        start, end = max(min(start, end), 0.0), min(max(start, end), 1.0)
    return x + min(start * along, end * along) - far, x + max(start * along, end * along) + far


@kernel()
def outline(ends: np.ndarray, radius: float, fine: int, off: np.ndarray) -> None:
    """Lower `off` (S,S) to the distances to the outline of the segments `ends` (M,2,2), drawn with a round pen.

    A segment is a pair of points (x, y) on the canvas. Distances are in pixels, each of `fine`² cells, from the centres
    of the cells, and negative within the outline. Cells more than a cell's width outside it are left alone.
    """
    side = off.shape[0]
    half, far = side / 2, radius * fine + 1
    for i in range(ends.shape[0]):
        x, y = (ends[i, 0, 0] + 1) * half - 0.5, (1 - ends[i, 0, 1]) * half - 0.5
        along, down = (ends[i, 1, 0] - ends[i, 0, 0]) * half, (ends[i, 0, 1] - ends[i, 1, 1]) * half
        square = along * along + down * down
        top, bottom = min(y, y + down) - far, max(y, y + down) + far
        for row in range(max(0, math.ceil(top)), min(side - 1, math.floor(bottom)) + 1):
            left, right = _near(x, y, along, down, row, far)
            for column in range(max(0, math.ceil(left)), min(side - 1, math.floor(right)) + 1):
                right_of, below = column - x, row - y
                share = min(max((right_of * along + below * down) / square, 0.0), 1.0) if square > 0 else 0.0
                distance = math.hypot(right_of - share * along, below - share * down) / fine - radius
                if distance < off[row, column]:
                    off[row, column] = distance
