"""The numba kernel of data sets: it plays, frames and draws a picture in one go, on one thread without the GIL. Threads
and forked processes may so draw side by side."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, uint64

from ..ops.histogram.pool import pick, random_bits, step
from ..runtime.jit import kernel

POINTS, PATCHES, DENSITY = range(3)
GREY = 127      # of a dot, as in FractalDB
MARGIN = 6      # pixels from the outermost points to the edges
FAR = 1e30      # where a game that runs away ends


@kernel()
def draw(maps, thresholds, guide, seed, kind, tone, xs, ys, image):
    """Draw a code into image (S,S) uint8, all 0, y upwards; how many points it took: fewer than P if it ran away.

    maps (N,6) rows a b c d e f, float64; thresholds and guide: of `choice`; seed uint64; tone: see `_expose`. xs and ys
    (P,) float64 are room for the points.
    """
    count, state = play(maps, thresholds, guide, seed, xs, ys)
    mark(xs[:count], ys[:count], state, kind, tone, image)
    return count


@njit
def play(maps, thresholds, guide, state, xs, ys):
    """One chaos game into xs and ys (P,), from the origin on, which is the first point as in FractalDB. How many points
    there are, and the state of the random numbers after them."""
    x = y = 0.0
    for k in range(len(xs)):
        if not abs(x) + abs(y) < FAR:
            return k, state
        xs[k], ys[k] = x, y
        state, bits = random_bits(state)
        x, y = step(maps, pick(bits, thresholds, guide), x, y)
    return len(xs), state


@njit
def mark(xs, ys, state, kind, tone, image):
    """Draw points (P,) into image (S,S): both coordinates are stretched so that the extremes lie at the margin."""
    size = len(image)
    low_x, high_x, low_y, high_y = xs[0], xs[0], ys[0], ys[0]
    for k in range(len(xs)):
        low_x, high_x = min(low_x, xs[k]), max(high_x, xs[k])
        low_y, high_y = min(low_y, ys[k]), max(high_y, ys[k])
    counts = np.zeros((size, size) if kind == DENSITY else (0, 0), np.uint32)
    for k in range(len(xs)):
        column, row = _pixel(xs[k], low_x, high_x, size), size - 1 - _pixel(ys[k], low_y, high_y, size)
        if kind == POINTS:
            image[row, column] = GREY
        elif kind == PATCHES:
            state, bits = random_bits(state)
            _patch(image, row, column, uint64(1) + ((bits >> uint64(32)) * uint64(511) >> uint64(32)))
        else:
            counts[row, column] += 1
    if kind == DENSITY:
        _expose(counts, tone, image)


@njit(inline="always")
def _pixel(x, low, high, size):
    inner = size - 2 * MARGIN
    if high == low:
        return size // 2
    return int((x - low) / (high - low) * inner + MARGIN)  # in the order of FractalDB, to the last bit


@njit(inline="always")
def _patch(image, row, column, mask):
    """The nine bits of a mask, at least one of them set, to the right of and above a point, over what was there."""
    for i in range(3):
        for j in range(3):
            image[row - 1 - i, column + 1 + j] = GREY * (mask >> uint64(3 * i + j) & uint64(1))


@njit
def _expose(counts, tone, image):
    """The level of n points in a pixel is 1 - exp(-n tone)."""
    for row in range(len(image)):
        for column in range(len(image)):
            if counts[row, column]:
                image[row, column] = int(-255 * math.expm1(-tone * counts[row, column]) + 0.5)
