"""CUDA kernels of the splat: points are sorted into square tiles, and every sum is gathered by its owner.

Forward, a block owns a tile of supersampled pixels and multiplies up their transmittance prod (1 - alpha) over the
points around it; where these are many, they are shared out to several blocks, whose products are multiplied in the end.
Backward, eight threads own a point and sum over the pixels around it. Nobody adds to another's memory, so there are no
atomics and results repeat bit for bit. Supersampled pixels are called pixels here, the image's own are called cells.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from numba import cuda, float32, float64, int32, int64
from torch import Tensor

from ..cuda_launch import blocks_of, launch
from .cpu_tiles import pixel
from .reference import ALPHA_MAX, ALPHA_MIN, cutoff_radius

TILE = 16                 # pixels a side
ROWS = 4                  # pixels of a column that a thread owns, so that it loads their column's Gaussian once
STRIPS = TILE // ROWS
SPLITS = 4                # groups of threads that share out a tile's points
GROUP = TILE * STRIPS     # threads that own a tile
AXES = 2 * TILE           # the columns and the rows of a tile
BATCH = 128               # points whose Gaussians a block holds at a time
CHUNK = 1024              # points that a block goes through, at most, where a splat reaches no further than a tile
LANES = 8                 # threads of a point
BLOCK = 128               # threads of the kernels that are free to choose
WORKSPACE = 1 << 30       # bytes of transmittance at a time, for images without a gradient

ALPHA_MIN = float32(ALPHA_MIN)
ALPHA_MAX = float32(ALPHA_MAX)


class Grid(NamedTuple):
    """The supersampled image: `side` pixels, cells of `cell` pixels, `across` tiles along a side; a splat reaches
    `reach` pixels from the one nearest to its centre."""

    side: int
    cell: int
    across: int
    reach: int
    sigma: float


def grid_of(resolution: int, supersample: int, sigma_px: float) -> Grid:
    """The grid for an image."""
    side = resolution * supersample
    return Grid(side, supersample, blocks_of(side, TILE), math.floor(cutoff_radius(sigma_px) + 0.5), sigma_px)


def image_of(points: Tensor, grid: Grid) -> Tensor:
    """points (B,P,2) -> images (B,R,R), in memory that does not grow with B."""
    images = []
    for some in points.split(max(1, WORKSPACE // (4 * grid.side**2))):
        seated, _, starts = sort(some, grid)
        images.append(downsample(transmittance(seated, starts, grid), grid))
    return images[0] if len(images) == 1 else torch.cat(images)


def sort(points: Tensor, grid: Grid) -> tuple[Tensor, Tensor, Tensor]:
    """All points (B·P,2) tile by tile, their numbers (B·P,), and where each tile's begin (B·tiles + 1,).

    A point counts to the tile of its centre, or to the nearest one; those that reach no pixel come last.
    """
    tiles = len(points) * grid.across**2
    keys = points.new_empty(points.shape[0] * points.shape[1], dtype=torch.int32)
    launch(assign_kernel, blocks_of(len(keys), BLOCK), BLOCK, points, grid.side, grid.across, grid.reach, keys)
    keys, order = torch.sort(keys, stable=True)
    starts = torch.searchsorted(keys, torch.arange(tiles + 1, dtype=torch.int32, device=keys.device))
    return points.view(-1, 2)[order], order, starts


def transmittance(seated: Tensor, starts: Tensor, grid: Grid) -> Tensor:
    """prod (1 - alpha) of every pixel (B,S,S), from the points tile by tile."""
    tiles, around = len(starts) - 1, blocks_of(grid.reach, TILE)
    # A point is looked at by the tiles around it, so the number of blocks has a bound that the host knows.
    neighbours = min((2 * around + 1) ** 2, grid.across**2)
    chunk = CHUNK * max(1, neighbours // 9)
    more = neighbours * len(seated) // chunk
    shares = starts.new_empty(tiles + 1)
    launch(share_out_kernel, blocks_of(tiles, BLOCK), BLOCK, starts, grid.across, around, chunk, shares)
    firsts = shares.cumsum(0)
    out = seated.new_empty(tiles // grid.across**2, grid.side, grid.side)
    partial = seated.new_empty(max(more, 1), TILE, TILE)
    launch(multiply_kernel, tiles + more, SPLITS * GROUP, seated, starts, firsts, grid.across, around, chunk,
           grid.reach, -0.5 / grid.sigma**2, out, partial)
    if more:
        launch(combine_kernel, more, TILE * TILE, firsts, grid.across, partial, out)
    return out


def downsample(transmittance: Tensor, grid: Grid) -> Tensor:
    """The image (B,R,R) from the transmittance (B,S,S)."""
    resolution = grid.side // grid.cell
    image = transmittance.new_empty(len(transmittance), resolution, resolution)
    launch(downsample_kernel, blocks_of(image.numel(), BLOCK), BLOCK, transmittance, grid.cell, image)
    return image


def backward(seated: Tensor, order: Tensor, starts: Tensor, transmittance: Tensor, grad_image: Tensor,
             grid: Grid) -> Tensor:
    """The gradient of the points (B,P,2) from that of the images (B,R,R)."""
    grad = torch.empty_like(seated)
    launch(gather_kernel, blocks_of(len(order), BLOCK // LANES), BLOCK, seated, order, starts, transmittance,
           grad_image, grid.cell, grid.reach, -0.5 / grid.sigma**2, grad)
    return grad.view(len(transmittance), -1, 2)


@cuda.jit
def assign_kernel(points, side, across, reach, keys):
    """Into keys, the tile of each point, counted over all codes; the number of tiles if it reaches no pixel."""
    n = cuda.grid(1)
    if n >= keys.size:
        return
    code = n // points.shape[1]
    x, y = pixel(points[code, n - code * points.shape[1], 0], points[code, n - code * points.shape[1], 1], side)
    low, high = -reach - 0.5, side + reach - 0.5
    if x >= low and x < high and y >= low and y < high:  # not so for NaN and infinity
        column = min(max(int32(math.floor(x + 0.5)), 0), side - 1)
        row = min(max(int32(math.floor(y + 0.5)), 0), side - 1)
        keys[n] = (code * across + row // TILE) * across + column // TILE
    else:
        keys[n] = points.shape[0] * across * across


@cuda.jit
def share_out_kernel(starts, across, around, chunk, shares):
    """Into shares[t + 1], how many blocks go through the points around tile t."""
    tile = cuda.grid(1)
    if tile == 0:
        shares[0] = 0
    if tile >= shares.size - 1:
        return
    ty, tx = tile // across % across, tile % across
    count = int64(0)
    for by in range(max(0, ty - around), min(across, ty + around + 1)):
        line = tile - tx + (by - ty) * across
        count += starts[line + min(across, tx + around + 1)] - starts[line + max(0, tx - around)]
    shares[tile + 1] = max(int64(1), (count + chunk - 1) // chunk)


@cuda.jit(device=True, inline="always")
def _last_at_most(firsts, skipped, number):
    """The last tile t with firsts[t] - skipped · t <= number."""
    low, high = 0, firsts.size - 2
    while low < high:
        middle = (low + high + 1) // 2
        if firsts[middle] - skipped * middle <= number:
            low = middle
        else:
            high = middle - 1
    return low


@cuda.jit(fastmath=True)
def multiply_kernel(seated, starts, firsts, across, around, chunk, reach, exponent, transmittance, partial):
    """The product of a tile over a share of the points around it: the first share's into transmittance."""
    side = transmittance.shape[1]
    place = cuda.shared.array((BATCH, 2), float64)             # of every point of a batch, in pixels of the tile
    near = cuda.shared.array(BATCH, int32)                     # whether it reaches the tile
    gauss = cuda.shared.array((BATCH, AXES), float32)          # along x, then along y
    product = cuda.shared.array((SPLITS, TILE, TILE), float32)
    share = int64(cuda.blockIdx.x)
    if share >= firsts[firsts.size - 1]:
        return
    tile = _last_at_most(firsts, 0, share)
    code = tile // (across * across)
    ty, tx = tile // across % across, tile % across
    skip = (share - firsts[tile]) * chunk                      # points around the tile that other blocks go through
    thread = cuda.threadIdx.x
    column, strip, split = thread % TILE, thread // TILE % STRIPS, thread // GROUP
    t0 = t1 = t2 = t3 = float32(1)
    for by in range(max(0, ty - around), min(across, ty + around + 1)):
        # The tiles of one row follow each other, and so do their points.
        line = (code * across + by) * across
        run, run_end = starts[line + max(0, tx - around)], starts[line + min(across, tx + around + 1)]
        begin, end = run + max(skip, 0), min(run + skip + chunk, run_end)
        skip -= run_end - run
        for base in range(begin, end, BATCH):
            count = min(BATCH, end - base)
            cuda.syncthreads()
            if thread < count:
                x, y = pixel(seated[base + thread, 0], seated[base + thread, 1], side)
                x, y = x - tx * TILE, y - ty * TILE
                place[thread, 0], place[thread, 1] = x, y
                near[thread] = -reach - 1 < x and x < TILE + reach and -reach - 1 < y and y < TILE + reach
            cuda.syncthreads()
            for entry in range(thread, count * AXES, SPLITS * GROUP):
                k, j = entry // AXES, entry % AXES
                if near[k]:
                    d = float32(j % TILE - place[k, j // TILE])
                    gauss[k, j] = math.exp(d * d * float32(exponent))
            cuda.syncthreads()
            for k in range(split, count, SPLITS):
                if near[k]:
                    along_x = gauss[k, column]
                    t0 *= _passing(along_x * gauss[k, TILE + ROWS * strip])
                    t1 *= _passing(along_x * gauss[k, TILE + ROWS * strip + 1])
                    t2 *= _passing(along_x * gauss[k, TILE + ROWS * strip + 2])
                    t3 *= _passing(along_x * gauss[k, TILE + ROWS * strip + 3])
    product[split, ROWS * strip, column] = t0
    product[split, ROWS * strip + 1, column] = t1
    product[split, ROWS * strip + 2, column] = t2
    product[split, ROWS * strip + 3, column] = t3
    cuda.syncthreads()
    for p in range(thread, TILE * TILE, SPLITS * GROUP):
        r, c = p // TILE, p % TILE
        total = product[0, r, c]
        for s in range(1, SPLITS):
            total *= product[s, r, c]
        if share > firsts[tile]:
            partial[share - tile - 1, r, c] = total
        elif ty * TILE + r < side and tx * TILE + c < side:
            transmittance[code, ty * TILE + r, tx * TILE + c] = total


@cuda.jit
def combine_kernel(firsts, across, partial, transmittance):
    """Multiply the products of a tile's further blocks into that of its first, in their order."""
    number = int64(cuda.blockIdx.x)  # of a further block, counting those of all tiles
    tiles = firsts.size - 1
    if number >= firsts[tiles] - tiles:
        return
    tile = _last_at_most(firsts, 1, number)
    if number > firsts[tile] - tile:
        return
    side = transmittance.shape[1]
    code = tile // (across * across)
    r = tile // across % across * TILE + cuda.threadIdx.x // TILE
    c = tile % across * TILE + cuda.threadIdx.x % TILE
    if r < side and c < side:
        total = transmittance[code, r, c]
        for k in range(number, firsts[tile + 1] - tile - 1):
            total *= partial[k, cuda.threadIdx.x // TILE, cuda.threadIdx.x % TILE]
        transmittance[code, r, c] = total


@cuda.jit(device=True, inline="always")
def _passing(alpha):
    """What a splat of this opacity lets through."""
    return float32(1) - (min(alpha, ALPHA_MAX) if alpha >= ALPHA_MIN else float32(0))


@cuda.jit
def downsample_kernel(transmittance, cell, image):
    """Into image, the mean opacity of each cell."""
    n = cuda.grid(1)
    if n >= image.size:
        return
    resolution = image.shape[1]
    j, i, code = n % resolution, n // resolution % resolution, n // (resolution * resolution)
    total = float32(0)
    for r in range(i * cell, (i + 1) * cell):
        row = float32(0)
        for c in range(j * cell, (j + 1) * cell):
            row += float32(1) - transmittance[code, r, c]  # summed as such, faint cells keep their digits
        total += row
    image[code, i, j] = total / float32(cell * cell)


@cuda.jit(fastmath=True)
def gather_kernel(seated, order, starts, transmittance, grad_image, cell, reach, exponent, grad):
    """Into grad, the gradient of each point, from the pixels around it."""
    partial = cuda.shared.array((2, BLOCK), float32)
    side = transmittance.shape[1]
    thread = cuda.threadIdx.x
    lane = thread % LANES
    entry = cuda.blockIdx.x * (BLOCK // LANES) + thread // LANES
    gx = gy = float32(0)
    if entry < starts[starts.size - 1]:  # the points beyond are not seen
        code = order[entry] // (order.size // transmittance.shape[0])
        x, y = pixel(seated[entry, 0], seated[entry, 1], side)
        left, top = int32(math.floor(x + 0.5)) - reach, int32(math.floor(y + 0.5)) - reach
        from_x, from_y = float32(left - x), float32(top - y)
        per_cell = float32(1) / float32(cell)
        width = 2 * reach + 1
        row, column = lane // width, lane % width
        while row < width:
            r, c = top + row, left + column
            if r >= 0 and r < side and c >= 0 and c < side:
                dx, dy = from_x + float32(column), from_y + float32(row)
                alpha = math.exp((dx * dx + dy * dy) * float32(exponent))
                if alpha >= ALPHA_MIN:
                    # The cell of a pixel: (r + 1/2) / cell is never so near to a whole number that rounding matters.
                    i, j = int32((float32(r) + float32(0.5)) * per_cell), int32((float32(c) + float32(0.5)) * per_cell)
                    others = (grad_image[code, i, j] * transmittance[code, r, c] * alpha
                              / (float32(1) - min(alpha, ALPHA_MAX)))
                    gx += others * dx
                    gy += others * dy
            column += LANES
            while column >= width:
                column -= width
                row += 1
    partial[0, thread] = gx
    partial[1, thread] = gy
    cuda.syncthreads()
    if lane < 2 and entry < order.size:
        total = float32(0)
        for k in range(LANES):
            total += partial[lane, thread - lane + k]
        # d alpha / d x = alpha · dx / sigma² · side / 2, and the mean over a cell; rows count downwards.
        scale = float32(-exponent * side / (float64(cell) * cell))
        grad[order[entry], lane] = total * scale if lane == 0 else -total * scale
