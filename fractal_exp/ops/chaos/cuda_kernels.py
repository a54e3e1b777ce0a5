"""CUDA kernels of the chaos game: a thread follows one trajectory, a warp of them is a block.

There are too few trajectories to fill a large GPU, so the time is that of one thread's chain of steps: whatever does
not depend on the step before is loaded one step ahead. No atomics: every sum has a fixed order, and results repeat bit
for bit. The random numbers are those of the CPU, from the same functions.
"""

from __future__ import annotations

import torch
from numba import cuda, float32, float64, int64, uint16, uint64
from torch import Tensor

from ..cuda_launch import blocks_of, launch
from .cpu_kernels import GUIDE_BITS, hold, next_state, start, unless_held

WARP = 32
GUIDE = 1 << GUIDE_BITS
MAPS = 32  # whose gradients a block keeps in shared memory, a column of its own for every thread: 24 kB at most


def forward(maps: Tensor, thresholds: Tensor, seeds: Tensor, trajectories: int, length: int,
            warmup: int) -> tuple[Tensor, Tensor, Tensor]:
    """maps (B,N,6) rows a b c d e f, thresholds (B,N), seeds (B,) -> points (B,P,2), and for `backward` the points of
    the warm-up (B,T,W,2) and all indices (B,T,L) uint16."""
    codes, kept = len(maps), length - warmup
    points = maps.new_empty(codes, trajectories, kept, 2)
    path = maps.new_empty(codes, trajectories, max(warmup, 1), 2)
    indices = maps.new_empty(codes, trajectories, length, dtype=torch.uint16)
    launch(forward_kernel, codes * blocks_of(trajectories, WARP), WARP, maps, thresholds.contiguous(),
           seeds.contiguous(), points, path, indices)
    return points.view(codes, trajectories * kept, 2), path, indices


def backward(maps: Tensor, seeds: Tensor, points: Tensor, path: Tensor, indices: Tensor,
             grad_points: Tensor) -> Tensor:
    """The gradient (B,N,6) of the maps from that of the points (B,P,2)."""
    codes, trajectories, _ = indices.shape
    count = maps.shape[1]
    blocks, shares = blocks_of(trajectories, WARP), blocks_of(count, MAPS)
    partial = maps.new_empty(codes, blocks, count, 6, dtype=torch.float64)
    shape = (codes, trajectories, -1, 2)
    launch(backward_kernel, codes * blocks * shares, WARP, maps, seeds.contiguous(), points.view(shape), path, indices,
           grad_points.view(shape), partial, shared_bytes=min(count, MAPS) * 6 * WARP * 4)
    return partial.sum(1).float()


@cuda.jit
def forward_kernel(maps, thresholds, seeds, points, path, indices):
    """Play the trajectories of `forward`, a thread each."""
    trajectories, length = indices.shape[1], indices.shape[2]
    warmup = length - points.shape[2]
    blocks = (trajectories + WARP - 1) // WARP
    code = cuda.blockIdx.x // blocks
    t = (cuda.blockIdx.x - code * blocks) * WARP + cuda.threadIdx.x
    # The map drawn by the least variate of every step of the table, by bisection.
    guide = cuda.shared.array(GUIDE, uint16)
    for entry in range(cuda.threadIdx.x, GUIDE, WARP):
        variate = int64(entry) << (32 - GUIDE_BITS)
        low, high = 0, maps.shape[1] - 1
        while low < high:
            middle = (low + high) // 2
            if variate < thresholds[code, middle]:
                high = middle
            else:
                low = middle + 1
        guide[entry] = low
    cuda.syncthreads()
    if t >= trajectories:
        return
    state, x, y = start(seeds[code], t)
    for k in range(length):
        state = next_state(uint64(state))  # the simulator hands it over as a number without a type
        variate = int64(state >> uint64(32))
        i = int64(guide[variate >> (32 - GUIDE_BITS)])
        while variate >= thresholds[code, i]:
            i += 1
        indices[code, t, k] = i
        new_x = hold(maps[code, i, 0] * x + (maps[code, i, 1] * y + maps[code, i, 4]))
        y = hold(maps[code, i, 2] * x + (maps[code, i, 3] * y + maps[code, i, 5]))
        x = new_x
        if k >= warmup:
            points[code, t, k - warmup, 0] = x
            points[code, t, k - warmup, 1] = y
        else:
            path[code, t, k, 0] = x
            path[code, t, k, 1] = y


@cuda.jit
def backward_kernel(maps, seeds, points, path, indices, grad_points, partial):
    """Follow the trajectories of `backward` back; into partial, the sum of the gradients of each block of them."""
    trajectories, length = indices.shape[1], indices.shape[2]
    warmup = length - points.shape[2]
    count, blocks = maps.shape[1], partial.shape[1]
    shares = (count + MAPS - 1) // MAPS
    code = cuda.blockIdx.x // (blocks * shares)
    block = cuda.blockIdx.x // shares % blocks
    first = cuda.blockIdx.x % shares * MAPS             # of the maps whose gradients this block sums
    mine = min(MAPS, count - first)
    lane = cuda.threadIdx.x
    t = block * WARP + lane
    total = cuda.shared.array(0, float32)               # (maps, 6, lanes): each lane has a bank of its own
    for entry in range(mine * 6):
        total[entry * WARP + lane] = float32(0)
    if t < trajectories:
        _, start_x, start_y = start(seeds[code], t)
        gx = gy = float32(0)
        k = length - 1
        x, y = points[code, t, k - warmup, 0], points[code, t, k - warmup, 1]
        i = int64(indices[code, t, k])
        before_x, before_y = _point(points, path, code, t, k - 1, warmup, start_x, start_y)
        from_x, from_y = grad_points[code, t, k - warmup, 0], grad_points[code, t, k - warmup, 1]
        while k >= 0:
            map_now, now_x, now_y, in_x, in_y = i, before_x, before_y, from_x, from_y
            k -= 1
            if k >= 0:
                i = int64(indices[code, t, k])
                before_x, before_y = _point(points, path, code, t, k - 1, warmup, start_x, start_y)
                from_x = from_y = float32(0)
                if k >= warmup:
                    from_x, from_y = grad_points[code, t, k - warmup, 0], grad_points[code, t, k - warmup, 1]
            gx, gy = unless_held(x, gx + in_x), unless_held(y, gy + in_y)
            if first <= map_now < first + mine:
                entry = (map_now - first) * 6 * WARP + lane
                total[entry] += gx * now_x
                total[entry + WARP] += gx * now_y
                total[entry + 2 * WARP] += gy * now_x
                total[entry + 3 * WARP] += gy * now_y
                total[entry + 4 * WARP] += gx
                total[entry + 5 * WARP] += gy
            carried = maps[code, map_now, 0] * gx + maps[code, map_now, 2] * gy
            gy = maps[code, map_now, 1] * gx + maps[code, map_now, 3] * gy
            gx = carried
            x, y = now_x, now_y
    cuda.syncthreads()
    for entry in range(lane, mine * 6, WARP):
        all_lanes = float64(0)
        for j in range(WARP):
            all_lanes += total[entry * WARP + (lane + j) % WARP]  # begun at another lane each, for the banks' sake
        partial[code, block, first + entry // 6, entry % 6] = all_lanes


@cuda.jit(device=True, inline="always")
def _point(points, path, code, t, k, warmup, start_x, start_y):
    """A trajectory's point after step k; its start for k = -1."""
    x, y = start_x, start_y
    if k >= warmup:
        x, y = points[code, t, k - warmup, 0], points[code, t, k - warmup, 1]
    elif k >= 0:
        x, y = path[code, t, k, 0], path[code, t, k, 1]
    return x, y
