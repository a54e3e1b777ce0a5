"""Points of a splat, sorted into the square tiles that their footprints reach."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import int64, njit, prange

from ...runtime.jit import kernel


class Sorted(NamedTuple):
    """Points (B,P) by tile: the list of tile t is entries[starts[t]:starts[t + 1]], point numbers in rising order.
    nearest (B,P,2): the column and row of the pixel nearest to a point; offset (B,P,2): how far to the right of and
    below its centre the point lies, in pixels. A point that is not seen has a pixel out of reach and is in no list.
    """

    starts: np.ndarray
    entries: np.ndarray
    nearest: np.ndarray
    offset: np.ndarray


@njit(inline="always")
def pixel(x, y, side):
    """A point's column and row as real numbers, in double precision: float32 would lose 1e-4 of a pixel."""
    return (float(x) + 1) * (0.5 * side) - 0.5, (1 - float(y)) * (0.5 * side) - 0.5


@njit(inline="always")
def _tiles_reached(column, row, side, tile, reach):
    """The ranges of tiles (x0, x1, y0, y1), ends excluded, that a footprint touches; empty for what is not seen."""
    if not (-reach <= column < side + reach and -reach <= row < side + reach):
        return 0, 0, 0, 0
    per_pixel = 1 / tile  # halves of pixels are far enough from the tiles' borders for the product to round as it likes
    return (int64((max(column - reach, 0) + 0.5) * per_pixel),
            int64((min(column + reach, side - 1) + 0.5) * per_pixel) + 1,
            int64((max(row - reach, 0) + 0.5) * per_pixel),
            int64((min(row + reach, side - 1) + 0.5) * per_pixel) + 1)


@njit(inline="always")
def _locate(place, side, reach):
    """The nearest pixel along one axis, and how far beyond its centre the place is."""
    place = place if place >= -reach - 0.5 else -reach - 1.0  # also NaN
    place = min(place, side + reach + 0.0)
    pixel = math.floor(place + 0.5)
    return pixel, place - pixel


@kernel(parallel=True)
def sort(points, side, tile, reach, parts):
    """The arrays of `Sorted`, by a counting sort of `parts` parts of each code."""
    codes, count, _ = points.shape
    across = (side + tile - 1) // tile
    tiles = across * across
    nearest, offset = np.empty((codes, count, 2), np.int32), np.empty((codes, count, 2), np.float32)
    cursor = np.zeros((codes * parts, tiles), np.int64)
    for job in prange(codes * parts):
        code, part = job // parts, job % parts
        for k in range(count * part // parts, count * (part + 1) // parts):
            x, y = pixel(points[code, k, 0], points[code, k, 1], side)
            nearest[code, k, 0], offset[code, k, 0] = _locate(x, side, reach)
            nearest[code, k, 1], offset[code, k, 1] = _locate(y, side, reach)
        for k in range(count * part // parts, count * (part + 1) // parts):
            x0, x1, y0, y1 = _tiles_reached(nearest[code, k, 0], nearest[code, k, 1], side, tile, reach)
            for ty in range(y0, y1):
                for tx in range(x0, x1):
                    cursor[job, ty * across + tx] += 1
    starts = np.empty(codes * tiles + 1, np.int64)
    total = 0
    for code in range(codes):
        for t in range(tiles):
            starts[code * tiles + t] = total
            for job in range(code * parts, (code + 1) * parts):
                found = cursor[job, t]
                cursor[job, t] = total
                total += found
    starts[codes * tiles] = total
    entries = np.empty(total, np.int32)
    for job in prange(codes * parts):
        code, part = job // parts, job % parts
        for k in range(count * part // parts, count * (part + 1) // parts):
            x0, x1, y0, y1 = _tiles_reached(nearest[code, k, 0], nearest[code, k, 1], side, tile, reach)
            for ty in range(y0, y1):
                for tx in range(x0, x1):
                    entries[cursor[job, ty * across + tx]] = k
                    cursor[job, ty * across + tx] += 1
    return starts, entries, nearest, offset
