"""CUDA kernels of the collage operations: a block of threads moves one code from its first step to its last.

A descent is one launch, whatever the number of its steps, and nothing waits for it. Masses are added up as integers, in
units of 2^-40, in whatever order the threads come, and every other sum has a fixed order: results repeat bit for bit.
The bins lie in global memory, which a GPU's second-level cache holds for a hundred codes at once.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from numba import cuda, float32, float64, int32, int64
from torch import Tensor

from ...ifs.code import PROBABILITY_FLOOR
from ..cuda_launch import blocks_of, launch
from . import steps
from .cpu_kernels import EDGE
from .reference import Descent, Settings, Target

THREADS, WARP = 256, 32
WARPS = THREADS // WARP
UNITS = float(1 << 40)  # of mass 1
SUMS = 7                # of a map: the gradients of its six numbers, and of its weight

inlined = cuda.jit(device=True, inline="always")
_adam, _contract, _pass_on, _push_off_identity = (
    inlined(function.py_func) for function in (steps.adam, steps.contract, steps.pass_on, steps.push_off_identity))


class Workspace(NamedTuple):
    """What a descent of B codes of N maps writes down: Adam's moments (B,N,2,7), masses (B,G²) in UNITS, the bins of
    all grids in a row for each code, the error's slopes by the finest (B,G²), and gradients (B,N,7)."""

    moments: Tensor
    masses: Tensor
    bins: Tensor
    slopes: Tensor
    gradients: Tensor


def pushforward(maps: Tensor, weights: Tensor, samples: Tensor, size: int) -> Tensor:
    """See `reference.pushforward`."""
    bins = torch.zeros(len(maps), size * size, dtype=torch.int64, device=maps.device)
    shares = max(1, blocks_of(maps.shape[1] * len(samples), THREADS * WARP))
    launch(pushforward_kernel, len(maps) * shares, THREADS, maps.contiguous(), weights.contiguous(),
           samples.contiguous(), size, shares, bins)
    return (bins / UNITS).float().view(-1, size, size)


def descend(maps: Tensor, weights: Tensor, target: Target, backgrounds: Tensor, chosen: Tensor, how: Descent
            ) -> tuple[Tensor, Tensor, Tensor]:
    """See `reference.descend`."""
    codes, count, _ = maps.shape
    maps, weights = (given.detach().clone(memory_format=torch.contiguous_format) for given in (maps, weights))
    target = target._replace(samples=target.samples.contiguous(), covariance=target.covariance.contiguous())
    cells = codes, target.size**2
    work = Workspace(moments=maps.new_zeros(codes, count, 2, SUMS), masses=maps.new_empty(cells, dtype=torch.int64),
                     bins=maps.new_empty(codes, len(target.roots)), slopes=maps.new_empty(cells),
                     gradients=maps.new_empty(codes, count, SUMS))
    errors = maps.new_empty(codes)
    launch(descend_kernel, codes, THREADS, maps, weights, target, backgrounds.contiguous(), chosen.contiguous(),
           Settings(**vars(how)), work, errors)
    return maps, weights, errors


@inlined
def _held(value, last):
    """Between 0 and `last`; NaN at 0."""
    if not value > float32(0):
        return float32(0)
    return value if value < last else last


@inlined
def _locate(maps, b, n, samples, k, size):
    """The lower left of the four bins that share a mapped sample, and the shares of those to the right and down."""
    half, last = float32(0.5 * size), float32(size) - EDGE
    x, y = samples[k, 0], samples[k, 1]
    u = (maps[b, n, 0] * x + maps[b, n, 1] * y + maps[b, n, 4] + float32(1)) * half - float32(0.5)
    v = (float32(1) - (maps[b, n, 2] * x + maps[b, n, 3] * y + maps[b, n, 5])) * half - float32(0.5)
    u, v = _held(u, last), _held(v, last)
    column, row = int32(u), int32(v)
    return row * size + column, u - float32(column), v - float32(row)


@inlined
def _drop(maps, weights, b, n, samples, k, size, masses):
    """Share out a mapped sample's mass."""
    corner, right, down = _locate(maps, b, n, samples, k, size)
    mass = float64(weights[b, n] * samples[k, 2]) * UNITS
    lower = mass * down
    upper = mass - lower
    cuda.atomic.add(masses, (b, corner), int64(upper - upper * right))
    cuda.atomic.add(masses, (b, corner + 1), int64(upper * right))
    cuda.atomic.add(masses, (b, corner + size), int64(lower - lower * right))
    cuda.atomic.add(masses, (b, corner + size + 1), int64(lower * right))


@cuda.jit
def pushforward_kernel(maps, weights, samples, size, shares, masses):
    """Share out the mapped samples of each code among its bins, by `shares` blocks."""
    b = cuda.blockIdx.x // shares
    count = samples.shape[0]
    first = (cuda.blockIdx.x - b * shares) * THREADS + cuda.threadIdx.x
    for job in range(first, maps.shape[1] * count, shares * THREADS):
        n = job // count
        if weights[b, n] > 0:
            _drop(maps, weights, b, n, samples, job - n * count, size, masses)


@inlined
def _tile(maps, weights, b, target, backgrounds, behind, masses, bins):
    """The measure that the maps make up on all grids, by all threads of the block."""
    samples, size, grids, known = target.samples, target.size, target.grids, target.known
    thread, count = cuda.threadIdx.x, samples.shape[0]
    for i in range(thread, size * size, THREADS):
        masses[b, i] = 0
    cuda.syncthreads()
    for job in range(thread, maps.shape[1] * count, THREADS):
        n = job // count
        if weights[b, n] > 0:
            _drop(maps, weights, b, n, samples, job - n * count, size, masses)
    cuda.syncthreads()
    for i in range(thread, size * size, THREADS):
        bins[b, i] = backgrounds[behind, i] + float32(masses[b, i] / UNITS)
        if known.shape[0] > 0:
            bins[b, i] *= known[i]
    fine, side = 0, size
    for _ in range(1, grids):
        cuda.syncthreads()
        coarse, half = fine + side * side, side // 2
        for i in range(thread, half * half, THREADS):
            row = i // half
            corner = fine + 2 * (row * side + i - row * half)
            bins[b, coarse + i] = bins[b, corner] + bins[b, corner + 1] + (bins[b, corner + side]
                                                                           + bins[b, corner + side + 1])
        fine, side = coarse, half
    cuda.syncthreads()


@inlined
def _slope(bins, b, roots, size, grids, floor, known, slopes):
    """The derivative of the collage error by each finest bin, by all threads of the block."""
    share = float32(1 / grids)
    for i in range(cuda.threadIdx.x, size * size, THREADS):
        total, start, side = float32(0), 0, size
        row = i // size
        column = i - row * size
        for _ in range(grids):
            cell = start + row * side + column
            root = math.sqrt(bins[b, cell] + floor)
            total += share * (root - roots[cell]) / root
            start, side, row, column = start + side * side, side // 2, row // 2, column // 2
        slopes[b, i] = total * known[i] if known.shape[0] > 0 else total
    cuda.syncthreads()


@inlined
def _pull(maps, weights, b, first, samples, slopes, size, lanes, gradients):
    """The gradients of the maps from `first` on, a warp for each: by its six numbers, and by its weight."""
    thread, count = cuda.threadIdx.x, samples.shape[0]
    warp, lane = thread // WARP, thread % WARP
    n = first + warp
    ga = gb = gc = gd = ge = gf = gw = float32(0)
    if n < maps.shape[1] and weights[b, n] > 0:
        for k in range(lane, count, WARP):
            x, y, mass = samples[k, 0], samples[k, 1], samples[k, 2]
            corner, right, down = _locate(maps, b, n, samples, k, size)
            upper, lower = slopes[b, corner], slopes[b, corner + size]
            across, below = slopes[b, corner + 1] - upper, slopes[b, corner + size + 1] - lower
            upper += across * right
            lower += below * right
            gw += mass * (upper + (lower - upper) * down)
            du, dv = mass * (across + (below - across) * down), mass * (upper - lower)
            ga += du * x
            gb += du * y
            ge += du
            gc += dv * x
            gd += dv * y
            gf += dv
    lanes[thread, 0], lanes[thread, 1], lanes[thread, 2], lanes[thread, 3] = ga, gb, gc, gd
    lanes[thread, 4], lanes[thread, 5], lanes[thread, 6] = ge, gf, gw
    cuda.syncthreads()
    if thread < WARPS * SUMS:
        n = thread // SUMS
        j = thread - n * SUMS
        total = float32(0)
        for lane in range(WARP):
            total += lanes[n * WARP + lane, j]
        if first + n < maps.shape[1]:
            scale = weights[b, first + n] * float32(0.5 * size) if j < 6 else float32(1)
            gradients[b, first + n, j] = total * scale
    cuda.syncthreads()


@inlined
def _total_volume(maps, weights, b):
    total = 0.0
    for n in range(maps.shape[1]):
        if weights[b, n] > 0:
            total += _volume_of(maps, b, n)
    return total


@inlined
def _volume_of(maps, b, n):
    return abs(maps[b, n, 0] * maps[b, n, 3] - maps[b, n, 1] * maps[b, n, 2]) + PROBABILITY_FLOOR


@inlined
def _tie(maps, weights, b, total):
    """Weights in proportion to the volumes, of the same total, by a thread for each."""
    volume = _total_volume(maps, weights, b)
    for n in range(cuda.threadIdx.x, maps.shape[1], THREADS):
        if weights[b, n] > 0:
            weights[b, n] = total * _volume_of(maps, b, n) / volume
    cuda.syncthreads()


@inlined
def _advance(maps, weights, b, n, k, by_weight, by_volume, target, how, work):
    """A step of Adam for one map; by_weight is added to its weight's gradient, or by_volume passed on to its matrix."""
    moments, falling = work.moments, how.decay ** (k / how.steps)
    m, g = cuda.local.array(6, float32), cuda.local.array(SUMS, float32)
    first, second = cuda.local.array(SUMS, float32), cuda.local.array(SUMS, float32)
    center, spread = cuda.local.array(2, float32), cuda.local.array((2, 2), float32)
    for j in range(SUMS):
        g[j], first[j], second[j] = work.gradients[b, n, j], moments[b, n, 0, j], moments[b, n, 1, j]
    for j in range(6):
        m[j] = maps[b, n, j]
    for j in range(2):
        center[j], spread[j, 0], spread[j, 1] = target.mean[j], target.covariance[j, 0], target.covariance[j, 1]
    if how.tied:
        _pass_on(m, g, by_volume)
    else:
        g[6] = g[6] * weights[b, n] + by_weight
    _push_off_identity(m, weights[b, n], center, spread, how.identity_radius, how.identity_weight, g)
    _adam(g, first, second, k, how)
    for j in range(6):
        m[j] -= how.rate * falling * g[j]
    if not how.tied:
        weights[b, n] *= math.exp(-how.weight_rate * falling * g[6])
    _contract(m, how.largest, how.smaller)
    for j in range(SUMS):
        moments[b, n, 0, j], moments[b, n, 1, j] = first[j], second[j]
    for j in range(6):
        maps[b, n, j] = m[j]


@cuda.jit
def descend_kernel(maps, weights, target, backgrounds, chosen, how, work, errors):
    """All steps of a descent, and the errors after the last."""
    samples, roots, size, grids = target.samples, target.roots, target.size, target.grids
    floor, known = float32(target.floor), target.known
    masses, bins, slopes, gradients = work.masses, work.bins, work.slopes, work.gradients
    b, thread, count = cuda.blockIdx.x, cuda.threadIdx.x, maps.shape[1]
    lanes = cuda.shared.array((THREADS, SUMS), float32)
    total = 0.0
    for n in range(count):
        total += weights[b, n]
    cuda.syncthreads()
    for k in range(1, how.steps + 1):
        if how.tied:
            _tie(maps, weights, b, total)
        _tile(maps, weights, b, target, backgrounds, chosen[b], masses, bins)
        _slope(bins, b, roots, size, grids, floor, known, slopes)
        for n in range(0, count, WARPS):
            _pull(maps, weights, b, n, samples, slopes, size, lanes, gradients)
        volume, pull = _total_volume(maps, weights, b), 0.0
        for n in range(count):
            if weights[b, n] > 0:
                pull += gradients[b, n, 6] * weights[b, n] / total
        cuda.syncthreads()
        for n in range(thread, count, THREADS):
            w = weights[b, n]
            if w > 0:
                prior_pull = how.prior * w * math.log(w * volume / (total * _volume_of(maps, b, n)))
                _advance(maps, weights, b, n, k, prior_pull, (gradients[b, n, 6] - pull) * total / volume, target, how,
                         work)
        cuda.syncthreads()
    if how.tied:
        _tie(maps, weights, b, total)
    _tile(maps, weights, b, target, backgrounds, chosen[b], masses, bins)
    error = float32(0)
    for i in range(thread, roots.shape[0], THREADS):
        difference = math.sqrt(bins[b, i] + floor) - roots[i]
        error += difference * difference
    lanes[thread, 0] = error
    cuda.syncthreads()
    if thread == 0:
        error = float32(0)
        for i in range(THREADS):
            error += lanes[i, 0]
        errors[b] = error / grids
