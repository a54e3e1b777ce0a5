"""The numba kernels of `tiles`. Maps are rows a b c d e f of words (M,6), places (K,2) are points of an initiator."""

from __future__ import annotations

import math

import numpy as np

from ..runtime.jit import kernel


@kernel()
def mark(words: np.ndarray, places: np.ndarray, occupied: np.ndarray) -> None:
    """Set the cells (S,S) of the canvas that the places reach under any of the words to 1."""
    side = occupied.shape[0]
    half, last = side / 2, side - 1.0
    for i in range(words.shape[0]):
        a, b, c, d, e, f = words[i, 0], words[i, 1], words[i, 2], words[i, 3], words[i, 4], words[i, 5]
        for k in range(places.shape[0]):
            x, y = places[k, 0], places[k, 1]
            column = min(max((a * x + b * y + e + 1) * half, 0.0), last)
            row = min(max((1 - (c * x + d * y + f)) * half, 0.0), last)
            occupied[int(row), int(column)] = 1


@kernel()
def collect(image: np.ndarray, words: np.ndarray, shares: np.ndarray, places: np.ndarray, levels: np.ndarray) -> None:
    """Add to the levels (K,) what an image (R,R) shows, in bilinear interpolation, where the words send the places,
    times the share (M,) of each word. Beside the image it is black."""
    side = image.shape[0]
    for i in range(words.shape[0]):
        a, b, c, d, e, f = words[i, 0], words[i, 1], words[i, 2], words[i, 3], words[i, 4], words[i, 5]
        for k in range(places.shape[0]):
            x, y = places[k, 0], places[k, 1]
            column = ((a * x + b * y + e + 1) * side - 1) / 2
            row = ((1 - (c * x + d * y + f)) * side - 1) / 2
            if not (-1 < column < side and -1 < row < side):
                continue
            left, top = math.floor(column), math.floor(row)
            right, below = column - left, row - top
            level = 0.0
            for down in range(2):
                for across in range(2):
                    r, s = top + down, left + across
                    if 0 <= r < side and 0 <= s < side:
                        level += (below if down else 1 - below) * (right if across else 1 - right) * image[r, s]
            levels[k] += shares[i] * level
