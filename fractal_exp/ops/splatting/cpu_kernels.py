"""numba kernels of the splat: points are sorted into square tiles, and each tile is one thread's alone.

A tile's transmittance prod (1 - alpha) is multiplied up in a buffer that stays in the cache, in the order of the
points, so that the result depends neither on the threads nor on the tiles. The Gaussian is separable: a point costs
two rows of exponentials. Supersampled pixels are called pixels here, the image's own are called cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numba import float32, int64, njit, prange

from ...runtime.jit import FAST, kernel
from ..scale import factors
from .reference import ALPHA_MAX, ALPHA_MIN, cutoff_radius

TILE = 160              # pixels: 100 kB of float32, at home in the second-level cache
FEWEST_TILES = 8        # along a small image's side, so that there is work for every thread
LANES = 8               # footprints are padded to full vectors
TILE_COST = 1 / 256     # of a pixel of a tile that is not empty, in points
FLOOR = 1e-30           # keeps the transmittance out of the denormal numbers, which are slow
LARGEST = 80            # gradients of an image are computed in units in which the largest is about 2^80: their products
FAINTEST = float32(2.0**-80)  # with the floor are no denormal numbers either, and what is fainter than this is 0
ALPHA_MIN = float32(ALPHA_MIN)
ALPHA_MAX = float32(ALPHA_MAX)


class Grid(NamedTuple):
    """The supersampled image: `side` pixels, cells of `cell` pixels, tiles of `tile` pixels; a splat reaches `reach`
    pixels from the one nearest to its centre."""

    side: int
    cell: int
    tile: int
    reach: int
    sigma: float


def grid_of(resolution: int, supersample: int, sigma_px: float) -> Grid:
    """The grid for an image; tiles hold whole cells and are no smaller than a footprint."""
    side = resolution * supersample
    reach = math.floor(cutoff_radius(sigma_px) + 0.5)
    tile = max(min(TILE, side // FEWEST_TILES), 2 * reach + 1)
    return Grid(side, supersample, -(-tile // supersample) * supersample, reach, sigma_px)


def forward(points: np.ndarray, grid: Grid, differentiable: bool) -> tuple[np.ndarray, ...]:
    """points (B,P,2) -> images (B,R,R), and for `backward` the transmittance (B,S,S) and the tiles' lists of points."""
    codes, count, _ = points.shape
    threads = numba.get_num_threads()
    starts, entries = _sort(points, grid.side, grid.tile, grid.reach, max(1, 4 * threads // codes))
    image = np.zeros((codes, grid.side // grid.cell, grid.side // grid.cell), np.float32)
    # Only tiles that hold points are ever written or read; the other pages of memory are never touched.
    transmittance = np.empty((codes, grid.side, grid.side) if differentiable else (0, 0, 0), np.float32)
    _forward(points, starts, entries, _shares(starts, grid, threads), grid, image, transmittance)
    return image, transmittance, starts, entries


def backward(points: np.ndarray, transmittance: np.ndarray, starts: np.ndarray, entries: np.ndarray,
             grad_image: np.ndarray, grid: Grid) -> np.ndarray:
    """The gradient of the points (B,P,2) from that of the images (B,R,R)."""
    grad = np.zeros_like(points)
    shares = _shares(starts, grid, numba.get_num_threads())
    _backward(points, starts, entries, shares, grid, transmittance, grad_image, factors(grad_image, LARGEST), grad)
    return grad


def _shares(starts: np.ndarray, grid: Grid, threads: int) -> np.ndarray:
    """The first tile of every thread and the end, so that each has about the same to do."""
    cost = np.diff(starts) + (np.diff(starts) > 0) * (grid.tile**2 * TILE_COST)
    done = np.cumsum(cost)
    bounds = np.searchsorted(done, done[-1] * np.arange(1, threads) / threads)
    return np.concatenate([[0], bounds, [len(cost)]])


@njit(inline="always")
def pixel(x, y, side):
    """A point's column and row as real numbers, in double precision: float32 would lose 1e-4 of a pixel."""
    return (float(x) + 1) * (0.5 * side) - 0.5, (1 - float(y)) * (0.5 * side) - 0.5


@njit(inline="always")
def _pixel(points, k, side):
    return pixel(points[k, 0], points[k, 1], side)


@njit(inline="always")
def _tiles_reached(points, k, side, tile, reach):
    """The ranges of tiles (x0, x1, y0, y1), ends excluded, that a footprint touches; empty for what is not seen."""
    x, y = _pixel(points, k, side)
    low, high = -reach - 0.5, side + reach - 0.5
    if not (x >= low and x < high and y >= low and y < high):  # also NaN and infinity
        return 0, 0, 0, 0
    column, row = int64(math.floor(x + 0.5)), int64(math.floor(y + 0.5))
    return (max(column - reach, 0) // tile, min(column + reach, side - 1) // tile + 1,
            max(row - reach, 0) // tile, min(row + reach, side - 1) // tile + 1)


@kernel(parallel=True)
def _sort(points, side, tile, reach, parts):
    """Counting sort: the list of tile t is entries[starts[t]:starts[t + 1]], point numbers in rising order."""
    codes, count, _ = points.shape
    across = (side + tile - 1) // tile
    tiles = across * across
    cursor = np.zeros((codes * parts, tiles), np.int64)
    for job in prange(codes * parts):
        part = job % parts
        for k in range(count * part // parts, count * (part + 1) // parts):
            x0, x1, y0, y1 = _tiles_reached(points[job // parts], k, side, tile, reach)
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
        part = job % parts
        for k in range(count * part // parts, count * (part + 1) // parts):
            x0, x1, y0, y1 = _tiles_reached(points[job // parts], k, side, tile, reach)
            for ty in range(y0, y1):
                for tx in range(x0, x1):
                    entries[cursor[job, ty * across + tx]] = k
                    cursor[job, ty * across + tx] += 1
    return starts, entries


@njit(inline="always")
def _exp(x):
    """exp on [-5.6, 0] to 4e-7, as Taylor's polynomial of x / 8 to the eighth; unlike the library's, a vector's work.

    What lies below is set to -5.6, whose exponential is under 1/255 and so is not drawn.
    """
    x = max(x, float32(-5.6)) * float32(0.125)
    p = float32(1 / 5040) * x + float32(1 / 720)
    p = p * x + float32(1 / 120)
    p = p * x + float32(1 / 24)
    p = p * x + float32(1 / 6)
    p = p * x + float32(1 / 2)
    p = p * x + float32(1)
    p = p * x + float32(1)
    p *= p
    p *= p
    return p * p


@njit(inline="always")
def _footprint(x, y, reach, sigma, dx, dy, gauss_x, gauss_y):
    """Fill the distances to the pixels and their Gaussians along both axes, and return the first column and row."""
    column, row = int64(math.floor(x + 0.5)) - reach, int64(math.floor(y + 0.5)) - reach
    fx, fy = float32(column - x), float32(row - y)
    scale = float32(-0.5 / (sigma * sigma))
    for j in range(len(dx)):
        dx[j] = fx + float32(j)
        dy[j] = fy + float32(j)
        gauss_x[j] = _exp(dx[j] * dx[j] * scale)
        gauss_y[j] = _exp(dy[j] * dy[j] * scale)
    return column, row


@kernel(parallel=True, fastmath=FAST)
def _forward(points, starts, entries, shares, grid, image, transmittance):
    side, cell, tile, reach, sigma = grid
    across = (side + tile - 1) // tile
    width = (2 * reach + LANES) // LANES * LANES
    for worker in prange(len(shares) - 1):
        buffer = np.empty((tile, tile + 2 * width), np.float32)  # room for footprints that begin or end outside
        dx, dy = np.empty(width, np.float32), np.empty(width, np.float32)
        gauss_x, gauss_y = np.empty(width, np.float32), np.empty(width, np.float32)
        sums = np.empty(tile, np.float32)
        for t in range(shares[worker], shares[worker + 1]):
            if starts[t] == starts[t + 1]:
                continue
            code = t // (across * across)
            top, left = t // across % across * tile, t % across * tile
            for r in range(tile):
                row = buffer[r]
                for c in range(len(row)):
                    row[c] = float32(1)
            for e in range(starts[t], starts[t + 1]):
                x, y = _pixel(points[code], entries[e], side)
                column, row0 = _footprint(x - left, y - top, reach, sigma, dx, dy, gauss_x, gauss_y)
                for r in range(max(0, -row0), min(2 * reach + 1, tile - row0)):
                    line = buffer[row0 + r, column + width:column + 2 * width]
                    factor = gauss_y[r]
                    for j in range(len(line)):
                        alpha = factor * gauss_x[j]
                        alpha = min(alpha, ALPHA_MAX) if alpha >= ALPHA_MIN else float32(0)
                        line[j] = max(line[j] * (float32(1) - alpha), float32(FLOOR))
            high, wide = min(tile, side - top), min(tile, side - left)
            _downsample(buffer[:high, width:width + wide], cell, sums,
                        image[code, top // cell:(top + high) // cell, left // cell:(left + wide) // cell])
            if len(transmittance) > 0:
                for r in range(high):
                    source, target = buffer[r, width:width + wide], transmittance[code, top + r, left:left + wide]
                    for c in range(wide):
                        target[c] = source[c]


@njit
def _downsample(transmittance, cell, sums, image):
    """The mean of 1 - T over each cell; summed as such, faint cells keep their digits."""
    mean = float32(1 / (cell * cell))
    for i in range(len(image)):
        for c in range(transmittance.shape[1]):
            sums[c] = float32(0)
        for r in range(cell):
            row = transmittance[i * cell + r]
            for c in range(len(row)):
                sums[c] += float32(1) - row[c]
        for j in range(image.shape[1]):
            total = float32(0)
            for c in range(cell):
                total += sums[j * cell + c]
            image[i, j] = total * mean


@kernel(parallel=True, fastmath=FAST)
def _backward(points, starts, entries, shares, grid, transmittance, grad_image, factors, grad):
    side, cell, tile, reach, sigma = grid
    across = (side + tile - 1) // tile
    width = (2 * reach + LANES) // LANES * LANES
    scale = 0.5 * side / (sigma * sigma)
    for worker in prange(len(shares) - 1):
        # dL/dI · T in the tile and around it, as far as footprints whose centre is in the tile may reach.
        buffer = np.empty((tile + 2 * reach, tile + 2 * width), np.float32)
        dx, dy = np.empty(width, np.float32), np.empty(width, np.float32)
        gauss_x, gauss_y = np.empty(width, np.float32), np.empty(width, np.float32)
        weights = np.empty(buffer.shape[1], np.float32)
        along_x, along_y = np.empty(width, np.float32), np.empty(width, np.float32)
        for t in range(shares[worker], shares[worker + 1]):
            if starts[t] == starts[t + 1]:
                continue
            code = t // (across * across)
            top, left = t // across % across * tile, t % across * tile
            _weigh(transmittance[code], grad_image[code], factors[code], top - reach, left - width, cell, weights,
                   buffer)
            for e in range(starts[t], starts[t + 1]):
                x, y = _pixel(points[code], entries[e], side)
                # The tile of the centre, or the nearest to it, is the one that sums up.
                if (min(max(int64(math.floor(x + 0.5)), 0), side - 1) // tile * tile != left
                        or min(max(int64(math.floor(y + 0.5)), 0), side - 1) // tile * tile != top):
                    continue
                column, row0 = _footprint(x, y, reach, sigma, dx, dy, gauss_x, gauss_y)
                for j in range(width):
                    along_x[j] = along_y[j] = float32(0)
                for r in range(max(0, -row0), min(2 * reach + 1, side - row0)):
                    first = column - left + width
                    line = buffer[row0 + r - top + reach, first:first + width]
                    factor, distance = gauss_y[r], dy[r]
                    for j in range(len(line)):
                        alpha = factor * gauss_x[j]
                        others = line[j] * alpha / (float32(1) - min(alpha, ALPHA_MAX))
                        others = others if alpha >= ALPHA_MIN else float32(0)
                        along_x[j] += others
                        along_y[j] += others * distance
                gx = gy = float32(0)
                for j in range(width):
                    gx += along_x[j] * dx[j]
                    gy += along_y[j]
                grad[code, entries[e], 0] = gx * scale / factors[code]
                grad[code, entries[e], 1] = -gy * scale / factors[code]


@njit
def _weigh(transmittance, grad_image, factor, top, left, cell, weights, buffer):
    """Fill the buffer, whose corner is pixel (top, left), with factor · dL/dI · T per pixel, and 0 beyond the image."""
    side = len(transmittance)
    mean = float32(1 / (cell * cell))
    for r in range(len(buffer)):
        row = buffer[r]
        for c in range(len(row)):
            row[c] = float32(0)
    first, last = max(0, left), min(side, left + buffer.shape[1])
    for r in range(max(0, top), min(side, top + len(buffer))):
        if r % cell == 0 or r == top:
            cells = grad_image[r // cell]
            for j in range(first // cell, (last + cell - 1) // cell):
                weight = float32(cells[j] * factor) * mean
                for c in range(max(j * cell, first), min((j + 1) * cell, last)):
                    weights[c - first] = weight
        target, source = buffer[r - top, first - left:last - left], transmittance[r, first:last]
        for c in range(len(target)):
            value = weights[c] * source[c]
            target[c] = float32(0) if abs(value) < FAINTEST else value  # not NaN
