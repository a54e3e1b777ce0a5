"""The numba kernels of the occupancy: one code after another, threads share out the codes of a batch."""

from __future__ import annotations

import numpy as np
import torch
from numba import float32, njit, prange, uint64
from torch import Tensor

from ...runtime.jit import FUSED, kernel
from ..chaos.cpu_kernels import GUIDE_BITS, guide_of, hold, next_state, start
from . import LEAST_SIDE, Game

SHIFT = 32 - GUIDE_BITS
LANES = 8  # trajectories played in turn, as a step waits for the one before
LEAST_SIDE = float32(LEAST_SIDE)


def occupancy(linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, game: Game, resolution: int) -> Tensor:
    """See `reference.occupancy`."""
    maps = torch.cat([linear.flatten(2), offset], -1).numpy()
    cumulative = np.ascontiguousarray(thresholds.numpy())
    canvas = np.zeros((len(maps), resolution, resolution), np.uint8)
    _mark(maps, cumulative, guide_of(cumulative), np.ascontiguousarray(seeds.numpy()),
          (game.trajectories, game.length, game.warmup), np.float32(game.frame), canvas)
    return torch.from_numpy(canvas)


@njit
def _play(table, cumulative, first, seed, sizes, points):
    """The points (2,P) of one code, trajectory by trajectory within a group of LANES; their box."""
    trajectories, length, warmup = sizes
    low_x = low_y = float32(np.inf)
    high_x = high_y = float32(-np.inf)
    states, xs, ys = np.empty(LANES, np.uint64), np.empty(LANES, np.float32), np.empty(LANES, np.float32)
    at = 0
    for group in range(0, trajectories, LANES):
        lanes = min(LANES, trajectories - group)
        for lane in range(lanes):
            states[lane], xs[lane], ys[lane] = start(seed, group + lane)
        for k in range(length):
            for lane in range(lanes):
                state = next_state(states[lane])
                states[lane] = state
                variate = np.int64(state >> uint64(32))
                i = first[variate >> SHIFT]
                while variate >= cumulative[i]:
                    i += 1
                x, y = xs[lane], ys[lane]
                new_x = hold(table[i, 0] * x + (table[i, 1] * y + table[i, 4]))
                new_y = hold(table[i, 2] * x + (table[i, 3] * y + table[i, 5]))
                xs[lane], ys[lane] = new_x, new_y
                if k >= warmup:
                    points[0, at], points[1, at] = new_x, new_y
                    at += 1
                    low_x, high_x = min(low_x, new_x), max(high_x, new_x)
                    low_y, high_y = min(low_y, new_y), max(high_y, new_y)
    return low_x, high_x, low_y, high_y


@kernel(parallel=True, fastmath=FUSED)
def _mark(maps, thresholds, guide, seeds, sizes, frame, canvas):
    trajectories, length, warmup = sizes
    side = canvas.shape[1]
    half, most = float32(side) * float32(0.5), float32(side)
    for code in prange(len(maps)):
        points = np.empty((2, trajectories * (length - warmup)), np.float32)
        low_x, high_x, low_y, high_y = _play(maps[code], thresholds[code], guide[code], seeds[code], sizes, points)
        scale, middle_x, middle_y = float32(1), float32(0), float32(0)
        if frame > 0:
            scale = frame / max(high_x - low_x, high_y - low_y, LEAST_SIDE)
            middle_x, middle_y = (low_x + high_x) * float32(0.5), (low_y + high_y) * float32(0.5)
        image = np.zeros((side + 2, side + 2), np.uint8)  # its border takes what lies beyond the canvas
        for k in range(points.shape[1]):
            column = ((points[0, k] - middle_x) * scale + float32(1)) * half
            row = (float32(1) - (points[1, k] - middle_y) * scale) * half
            column = min(max(column + float32(1), float32(0)), most + float32(1))
            row = min(max(row + float32(1), float32(0)), most + float32(1))
            image[int(row), int(column)] = 1
        canvas[code] = image[1:-1, 1:-1]
