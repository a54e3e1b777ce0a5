"""numba kernels of the splat: points are sorted into square tiles, and each tile is one thread's alone.

A tile's transmittance prod (1 - alpha) is multiplied up in a buffer that stays in the cache, in the order of the
points, so that the result depends neither on the threads nor on the tiles. The Gaussian is separable: a point costs
two rows of exponentials. Supersampled pixels are called pixels here, the image's own are called cells.

A footprint is drawn block by block: LANES columns, and the rows in which the disc may reach into them. Which blocks
there are depends on sigma alone, so that every point takes the same branches, and a processor guesses them. The
exponentials of BATCH points come first, those of one do not wait for each other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numba
import numpy as np
from numba import float32, njit, prange

from ...runtime.jit import FUSED, kernel
from ...runtime.vectors import LANES, at_least, at_most, count_up, load, no_less, repeat, store, total, zeros
from ..scale import factors
from .cpu_tiles import Sorted, sort
from .reference import ALPHA_MAX, ALPHA_MIN, cutoff_radius

TILE = 160              # pixels: 100 kB of float32, at home in the second-level cache
FEWEST_TILES = 8        # along a small image's side, so that there is work for every thread
BATCH = 16              # points
TILE_COST = 1 / 256     # of a pixel of a tile that is not empty, in points
FLOOR = float32(1e-30)  # keeps the transmittance out of the denormal numbers, which are slow
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
    """points (B,P,2) -> images (B,R,R), and for `backward` the transmittance (B,S,S) and the arrays of `Sorted`."""
    codes = len(points)
    threads = numba.get_num_threads()
    lists = Sorted(*sort(points, grid.side, grid.tile, grid.reach, max(1, 4 * threads // codes)))
    image = np.zeros((codes, grid.side // grid.cell, grid.side // grid.cell), np.float32)
    # Only tiles that hold points are ever written or read; the other pages of memory are never touched.
    transmittance = np.empty((codes, grid.side, grid.side) if differentiable else (0, 0, 0), np.float32)
    _forward(lists, _shares(lists.starts, grid, threads), grid, _blocks(grid), image, transmittance)
    return image, transmittance, *lists


def backward(transmittance: np.ndarray, starts: np.ndarray, entries: np.ndarray, nearest: np.ndarray,
             offset: np.ndarray, grad_image: np.ndarray, grid: Grid) -> np.ndarray:
    """The gradient of the points (B,P,2) from that of the images (B,R,R)."""
    grad = np.zeros_like(offset)
    shares = _shares(starts, grid, numba.get_num_threads())
    _backward(Sorted(starts, entries, nearest, offset), shares, grid, _blocks(grid), transmittance, grad_image,
              factors(grad_image, LARGEST), grad)
    return grad


def _blocks(grid: Grid) -> np.ndarray:
    """The blocks that cover the disc of a point left of its pixel's centre, (K,2): the first column, counted from that
    pixel, and how many rows above and below it. For a point to the right, they are mirrored.
    """
    radius = cutoff_radius(grid.sigma) * (1 + 1e-5) + 1e-3   # float32 alphas round
    plans = []
    for origin in (0, LANES // 2):
        plan = []
        for first in range(origin - (grid.reach // LANES + 2) * LANES, grid.reach + 1, LANES):
            nearest = max(first, -0.5 - (first + LANES - 1), 0)
            if nearest <= radius:
                rows = math.floor(math.sqrt(radius**2 - nearest**2) + 0.5)
                plan.append((first, min(rows, grid.reach)))
        plans.append(np.array(plan))
    return min(plans, key=lambda plan: (2 * plan[:, 1] + 1).sum())


def _shares(starts: np.ndarray, grid: Grid, threads: int) -> np.ndarray:
    """The first tile of every thread and the end, so that each has about the same to do."""
    cost = np.diff(starts) + (np.diff(starts) > 0) * (grid.tile**2 * TILE_COST)
    done = np.cumsum(cost)
    bounds = np.searchsorted(done, done[-1] * np.arange(1, threads) / threads)
    return np.concatenate([[0], bounds, [len(cost)]])


@njit
def _gaussian(first, sigma):
    """exp(-d² / 2 sigma²) to 4e-7 for the distances d = first, first + 1, …, as a vector.

    By Taylor's polynomial of an eighth of the exponent, to the eighth. What lies below -5.6 is set to it: its
    exponential is under 1/255 and so is not drawn.
    """
    distance = count_up(first)
    x = no_less(distance * distance * (-0.5 / (sigma * sigma)), float32(-5.6)) * 0.125
    p = x * (1 / 5040) + 1 / 720
    p = p * x + 1 / 120
    p = p * x + 1 / 24
    p = p * x + 1 / 6
    p = p * x + 1 / 2
    p = p * x + 1
    p = p * x + 1
    p *= p
    p *= p
    return p * p


class Batch(NamedTuple):
    """What the footprints of BATCH points are made of: the first column of each block (BATCH,K), the Gaussians of the
    blocks' columns (BATCH·K·LANES,), and those of `rows` rows (BATCH·rows,), from -reach on."""

    column: np.ndarray
    along_x: np.ndarray
    along_y: np.ndarray
    rows: int


@njit
def _batch(reach, blocks):
    rows = (2 * reach + LANES) // LANES * LANES
    return Batch(np.empty((BATCH, blocks), np.int64), np.empty(BATCH * blocks * LANES, np.float32),
                 np.empty(BATCH * rows, np.float32), rows)


@njit
def _fill(batch, some, nearest, offset, reach, sigma, blocks):
    """Fill the batch for the points of numbers `some`."""
    for i in range(len(some)):
        x, y = offset[some[i], 0], offset[some[i], 1]
        for b in range(len(blocks)):
            first = blocks[b, 0] if x <= 0 else 1 - LANES - blocks[b, 0]
            batch.column[i, b] = nearest[some[i], 0] + first
            store(batch.along_x, (i * len(blocks) + b) * LANES, _gaussian(float32(first) - x, sigma))
        for r in range(0, batch.rows, LANES):
            store(batch.along_y, i * batch.rows + r, _gaussian(float32(r - reach) - y, sigma))


@kernel(parallel=True, fastmath=FUSED)
def _forward(lists, shares, grid, blocks, image, transmittance):
    starts, entries, nearest, offset = lists
    side, cell, tile, reach, sigma = grid
    across = (side + tile - 1) // tile
    margin = 2 * reach + LANES  # room for footprints that begin or end outside
    stride = tile + 2 * margin
    for worker in prange(len(shares) - 1):
        buffer = np.empty(tile * stride, np.float32)
        batch = _batch(reach, len(blocks))
        sums = np.empty(tile, np.float32)
        for t in range(shares[worker], shares[worker + 1]):
            if starts[t] == starts[t + 1]:
                continue
            code = t // (across * across)
            top, left = t // across % across * tile, t % across * tile
            buffer[:] = float32(1)
            for begin in range(starts[t], starts[t + 1], BATCH):
                some = entries[begin:min(begin + BATCH, starts[t + 1])]
                _fill(batch, some, nearest[code], offset[code], reach, sigma, blocks)
                for i in range(len(some)):
                    row = nearest[code, some[i], 1] - top
                    for b in range(len(blocks)):
                        first, end = max(row - blocks[b, 1], 0), min(row + blocks[b, 1] + 1, tile)
                        place = first * stride + batch.column[i, b] - left + margin
                        gauss = load(batch.along_x, (i * len(blocks) + b) * LANES)
                        from_row = i * batch.rows + reach - row
                        for r in range(from_row + first, from_row + end):
                            alpha = gauss * repeat(batch.along_y, r)
                            alpha = at_least(alpha, ALPHA_MIN, at_most(alpha, ALPHA_MAX))
                            line = load(buffer, place)
                            store(buffer, place, no_less(line - line * alpha, FLOOR))
                            place += stride
            high, wide = min(tile, side - top), min(tile, side - left)
            inner = buffer.reshape(tile, stride)[:high, margin:margin + wide]
            _downsample(inner, cell, sums,
                        image[code, top // cell:(top + high) // cell, left // cell:(left + wide) // cell])
            if len(transmittance) > 0:
                for r in range(high):
                    source, target = inner[r], transmittance[code, top + r, left:left + wide]
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


@kernel(parallel=True, fastmath=FUSED)
def _backward(lists, shares, grid, blocks, transmittance, grad_image, factors, grad):
    starts, entries, nearest, offset = lists
    side, cell, tile, reach, sigma = grid
    across = (side + tile - 1) // tile
    margin = 2 * reach + LANES
    stride = tile + 2 * margin
    scale = 0.5 * side / (sigma * sigma)
    steps = np.arange(-reach, reach + 1).astype(np.float32)
    for worker in prange(len(shares) - 1):
        # dL/dI · T in the tile and around it, as far as footprints whose centre is in the tile may reach.
        buffer = np.empty((tile + 2 * reach + 1, stride), np.float32)
        flat = buffer.reshape(-1)
        batch = _batch(reach, len(blocks))
        own = np.empty(BATCH, np.int32)
        weights = np.empty(stride, np.float32)
        for t in range(shares[worker], shares[worker + 1]):
            if starts[t] == starts[t + 1]:
                continue
            code = t // (across * across)
            top, left = t // across % across * tile, t % across * tile
            _weigh(transmittance[code], grad_image[code], factors[code], top - reach, left - margin, cell, weights,
                   buffer)
            done = starts[t]
            while done < starts[t + 1]:
                done, count = _next_own(entries, done, starts[t + 1], nearest[code], side, tile, top, left, own)
                _fill(batch, own[:count], nearest[code], offset[code], reach, sigma, blocks)
                for i in range(count):
                    k = own[i]
                    row = nearest[code, k, 1]
                    along_x = along_y = whole = zeros()
                    for b in range(len(blocks)):
                        first, end = max(row - blocks[b, 1], 0), min(row + blocks[b, 1] + 1, side)
                        place = (first - top + reach) * stride + batch.column[i, b] - left + margin
                        gauss = load(batch.along_x, (i * len(blocks) + b) * LANES)
                        part = zeros()
                        # Two rows at a time, for one division. A last row of its own has a neighbour without weight.
                        for r in range(first - row + reach, end - row + reach, 2):
                            alpha = gauss * repeat(batch.along_y, i * batch.rows + r)
                            beta = gauss * repeat(batch.along_y, i * batch.rows + r + 1)
                            passed_a, passed_b = 1 - at_most(alpha, ALPHA_MAX), 1 - at_most(beta, ALPHA_MAX)
                            inverse = 1 / (passed_a * passed_b)
                            # NaN is not seen where a splat does not reach.
                            others = at_least(alpha, ALPHA_MIN, load(flat, place) * alpha * (passed_b * inverse))
                            below = at_least(beta, ALPHA_MIN, load(flat, place + stride) * beta * (passed_a * inverse))
                            both = others + below
                            part += both
                            along_y += both * repeat(steps, r) + below
                            place += 2 * stride
                        whole += part
                        along_x += part * count_up(float32(batch.column[i, b] - nearest[code, k, 0]))
                    gx = total(along_x - whole * offset[code, k, 0])
                    gy = total(along_y - whole * offset[code, k, 1])
                    grad[code, k, 0] = gx * scale / factors[code]
                    grad[code, k, 1] = -gy * scale / factors[code]


@njit
def _next_own(entries, begin, end, nearest, side, tile, top, left, own):
    """Fill `own` with the next points of the list of which this tile is that of the centre, or the nearest to it, and
    return where in the list to go on, and how many they are: each point is summed up in one tile."""
    count = 0
    while begin < end and count < len(own):
        own[count] = entries[begin]
        column, row = nearest[entries[begin], 0], nearest[entries[begin], 1]
        count += ((left <= min(max(column, 0), side - 1) < left + tile)
                  & (top <= min(max(row, 0), side - 1) < top + tile))
        begin += 1
    return begin, count


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
