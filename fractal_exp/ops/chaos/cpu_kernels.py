"""numba kernels of the chaos game: a trajectory is a serial chain, so the threads share out trajectories."""

from __future__ import annotations

import numpy as np
from numba import float32, njit, prange, uint64

from ...runtime.jit import FAST, kernel
from .reference import ESCAPE as LIMIT

BLOCK = 32          # trajectories whose gradients are summed together: fixes the order of the sum for good
GUIDE_BITS = 8      # the guide table inverts the cumulative probabilities to within one of its 256 steps

ESCAPE = float32(LIMIT)
GOLDEN = uint64(0x9E3779B97F4A7C15)
MIX_1 = uint64(0xBF58476D1CE4E5B9)
MIX_2 = uint64(0x94D049BB133111EB)


def forward(maps: np.ndarray, thresholds: np.ndarray, seeds: np.ndarray, trajectories: int, length: int,
            warmup: int) -> tuple[np.ndarray, np.ndarray]:
    """maps (B,N,6) rows a b c d e f, thresholds (B,N), seeds (B,) -> points (B,P,2) and all indices (B,T,L) uint16."""
    kept = length - warmup
    points = np.empty((len(maps), trajectories, kept, 2), np.float32)
    indices = np.empty((len(maps), trajectories, length), np.uint16)
    _forward(maps, np.ascontiguousarray(thresholds), guide_of(thresholds), np.ascontiguousarray(seeds), points, indices)
    return points.reshape(len(maps), trajectories * kept, 2), indices


def backward(maps: np.ndarray, seeds: np.ndarray, points: np.ndarray, indices: np.ndarray,
             grad_points: np.ndarray) -> np.ndarray:
    """The gradient (B,N,6) of the maps from that of the points (B,P,2)."""
    codes, trajectories, _ = indices.shape
    shape = (codes, trajectories, -1, 2)
    blocks = -(-trajectories // BLOCK)
    partial = np.zeros((codes, blocks, maps.shape[1], 6))
    _backward(maps, np.ascontiguousarray(seeds), points.reshape(shape), indices, grad_points.reshape(shape), partial)
    return partial.sum(1).astype(np.float32)


def guide_of(thresholds: np.ndarray) -> np.ndarray:
    """The map (B,256) drawn by the least variate of every step of the table."""
    steps = np.arange(1 << GUIDE_BITS) << (32 - GUIDE_BITS)
    return np.stack([np.searchsorted(row, steps, side="right") for row in thresholds]).astype(np.uint16)


@njit(inline="always")
def _mix(z):
    z = (z ^ (z >> uint64(30))) * MIX_1
    z = (z ^ (z >> uint64(27))) * MIX_2
    return z ^ (z >> uint64(31))


@njit(inline="always")
def next_state(state):
    """The stream's next state, 64 random bits: xorshift (Marsaglia 2003)."""
    state ^= state << uint64(13)
    state ^= state >> uint64(7)
    return state ^ (state << uint64(17))


@njit(inline="always")
def start(seed, trajectory):
    """The stream's state after the start was drawn, and the start."""
    state = _mix(_mix(uint64(seed) + GOLDEN) + uint64(trajectory + 1) * GOLDEN)
    state = next_state(GOLDEN if state == uint64(0) else state)
    x = float32(state >> uint64(40)) * float32(2.0**-23) - float32(1)
    state = next_state(state)
    y = float32(state >> uint64(40)) * float32(2.0**-23) - float32(1)
    return state, x, y


@njit(inline="always")
def _step(m, x, y):
    return hold(m[0] * x + (m[1] * y + m[4])), hold(m[2] * x + (m[3] * y + m[5]))


@njit(inline="always")
def hold(x):
    """A point that runs away stays finite, and so does its gradient."""
    return min(max(x, -ESCAPE), ESCAPE)


@kernel(parallel=True, fastmath=FAST)
def _forward(maps, thresholds, guide, seeds, points, indices):
    codes, trajectories, length = indices.shape
    warmup = length - points.shape[2]
    for job in prange(codes * trajectories):
        code = job // trajectories
        trajectory = job - code * trajectories
        table, cumulative, first = maps[code], thresholds[code], guide[code]
        drawn, kept = indices[code, trajectory], points[code, trajectory]
        state, x, y = start(seeds[code], trajectory)
        for k in range(length):
            state = next_state(state)
            variate = np.int64(state >> uint64(32))
            i = first[variate >> (32 - GUIDE_BITS)]
            while variate >= cumulative[i]:
                i += 1
            drawn[k] = i
            x, y = _step(table[i], x, y)
            if k >= warmup:
                kept[k - warmup, 0] = x
                kept[k - warmup, 1] = y


@kernel(parallel=True, fastmath=FAST)
def _backward(maps, seeds, points, indices, grad_points, partial):
    codes, trajectories, length = indices.shape
    blocks = partial.shape[1]
    warmup = length - points.shape[2]
    for job in prange(codes * blocks):
        code = job // blocks
        block = job - code * blocks
        table, total = maps[code], partial[code, block]
        path = np.empty((warmup + 1, 2), np.float32)  # from the start to the last point that was dropped
        for trajectory in range(block * BLOCK, min((block + 1) * BLOCK, trajectories)):
            drawn, kept, grad = indices[code, trajectory], points[code, trajectory], grad_points[code, trajectory]
            _, path[0, 0], path[0, 1] = start(seeds[code], trajectory)
            for k in range(warmup):
                path[k + 1, 0], path[k + 1, 1] = _step(table[drawn[k]], path[k, 0], path[k, 1])
            gx = gy = 0.0  # in double precision: what fades along the trajectory meets no denormal numbers, slow ones
            for k in range(length - 1, warmup, -1):
                gx = unless_held(kept[k - warmup, 0], gx + grad[k - warmup, 0])
                gy = unless_held(kept[k - warmup, 1], gy + grad[k - warmup, 1])
                gx, gy = _pull_back(table, total, drawn[k], kept[k - warmup - 1, 0], kept[k - warmup - 1, 1], gx, gy)
            gx = unless_held(kept[0, 0], gx + grad[0, 0])
            gy = unless_held(kept[0, 1], gy + grad[0, 1])
            for k in range(warmup, -1, -1):
                gx, gy = _pull_back(table, total, drawn[k], path[k, 0], path[k, 1], gx, gy)
                gx, gy = unless_held(path[k, 0], gx), unless_held(path[k, 1], gy)


@njit(inline="always")
def unless_held(x, g):
    """The gradient by a coordinate, none where the coordinate is held at the escape radius."""
    return g if abs(x) < ESCAPE else float32(0)


@njit(inline="always")
def _pull_back(table, total, i, x, y, gx, gy):
    """Add one step's gradient to its map's total, and carry it on to the point before: g <- M^T g."""
    total[i, 0] += gx * x
    total[i, 1] += gx * y
    total[i, 2] += gy * x
    total[i, 3] += gy * y
    total[i, 4] += gx
    total[i, 5] += gy
    return table[i, 0] * gx + table[i, 2] * gy, table[i, 1] * gx + table[i, 3] * gy
