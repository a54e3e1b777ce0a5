"""Quick pictures of many codes at once, for training alone: `fractal_exp.rendering.still` draws those that count."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, uint64

from ..ops.chaos.cpu_kernels import GUIDE_BITS, guide_of, next_state, start
from ..ops.histogram.boxes import box_mean
from ..runtime.jit import kernel

WARMUP = 32
MAX_MAPS = 10  # rows of the tables below; the rest have no probability


def thresholds(probabilities: np.ndarray) -> np.ndarray:
    """Cumulative probabilities (B,N) in units of 2^-32, int64, of probabilities (B,N) that sum to 1."""
    cumulative = probabilities.astype(np.float64).cumsum(-1)
    return np.round(cumulative / cumulative[:, -1:] * 2**32).astype(np.int64)


def orbit(maps: np.ndarray, probabilities: np.ndarray, seeds: np.ndarray, count: int) -> np.ndarray:
    """Points (B,count,2) of the codes maps (B,N,6), rows a b c d e f. Two codes of one seed and the same probabilities
    get points of the same addresses."""
    points = np.empty((len(maps), count, 2))
    cumulative = thresholds(probabilities)
    _orbit(maps, cumulative, guide_of(cumulative), seeds, points)
    return points


def draw(maps: np.ndarray, probabilities: np.ndarray, seeds: np.ndarray, points: np.ndarray, resolution: int,
         factor: int) -> np.ndarray:
    """Images (B,R,R) float32 of the canvas: a pixel is the share of its factor² parts that any of points[b] points of
    the code maps[b] (N,6) has hit."""
    images = np.empty((len(maps), resolution, resolution), np.float32)
    cumulative = thresholds(probabilities)
    canvas = np.zeros((len(maps), resolution * factor, resolution * factor), np.uint8)
    _draw(maps, cumulative, guide_of(cumulative), seeds, points, canvas)
    for image, parts in zip(images, canvas, strict=True):
        box_mean(parts, factor, image)
    return images


@njit(inline="always")
def _next(table, cumulative, first, state, x, y):
    state = next_state(state)
    variate = np.int64(state >> uint64(32))
    i = first[variate >> (32 - GUIDE_BITS)]
    while variate >= cumulative[i]:
        i += 1
    return state, table[i, 0] * x + (table[i, 1] * y + table[i, 4]), table[i, 2] * x + (table[i, 3] * y + table[i, 5])


@kernel(parallel=True)
def _orbit(maps, cumulative, guide, seeds, points):
    for code in prange(len(maps)):
        state, x, y = start(seeds[code], 0)
        x, y = float(x), float(y)
        for _ in range(WARMUP):
            state, x, y = _next(maps[code], cumulative[code], guide[code], state, x, y)
        for k in range(points.shape[1]):
            state, x, y = _next(maps[code], cumulative[code], guide[code], state, x, y)
            points[code, k, 0], points[code, k, 1] = x, y


@kernel(parallel=True)
def _draw(maps, cumulative, guide, seeds, points, canvas):
    size = canvas.shape[1]
    half = 0.5 * size
    for code in prange(len(maps)):
        state, x, y = start(seeds[code], 0)
        x, y = float(x), float(y)
        for _ in range(WARMUP):
            state, x, y = _next(maps[code], cumulative[code], guide[code], state, x, y)
        for _ in range(points[code]):
            state, x, y = _next(maps[code], cumulative[code], guide[code], state, x, y)
            column, row = (x + 1.0) * half, (1.0 - y) * half
            if 0 <= column < size and 0 <= row < size:
                canvas[code, int(row), int(column)] = 1
