"""Points of an attractor sorted into the pixels of a window, on an NVIDIA GPU: the distribution of `histogram`.

The CPU cuts the address tree into words that share out the window's points (see `histogram`) and draws how many points
each gets; every GPU thread then throws an equal share of them, whichever words they belong to, and not one after the
other: neighbours of an orbit are alike where a map is slow, and would make a word's points clump. The threads of a warp
work on the same word at a time. Words that reach beyond the window are not searched further: what of them lies beside
it is rejected. float64 throughout, for deep zooms.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from numba import cuda, float64, int64, uint64
from torch import Tensor

from ..chaos.cpu_kernels import next_state, start
from ..cuda_launch import blocks_of, launch
from . import AddressTree, Window
from .cpu import COUNTED, CUT, LIT
from .pool import BURN_IN, GOLDEN_RATIO, GUIDE_BITS

THREADS = 128
FEWEST = 64           # points a thread throws, at the least: it takes many more steps before the first, from anywhere
ARRIVED = 16          # to e^-16 of that distance from the attractor; slow maps take more than BURN_IN steps for it,
MOST_STEPS = 1 << 12  # but these at the most
MOST_THREADS = 1 << 17
WASTE = 64            # throws for every point in the window, beyond which searching the tree on the CPU is better


def scatter(tree: AddressTree, window: Window, thrown: float, *, seed: tuple[int, ...], mode: int,
            device: torch.device | str, wanted: float = math.inf) -> tuple[Tensor, int] | None:
    """`AddressTree.scatter` onto a new canvas (H,W) on a device, uint8 for LIT and int32 for COUNTED, and the points
    in it. None if the words found hold many times the points `wanted` in the window."""
    words = tree.cut(window, thrown, CUT, whole=True)  # small ones also where all of a word lies in the window
    if words[:, 7].sum() > WASTE * (wanted + CUT):
        return None
    random = np.random.default_rng(seed)
    counts = random.poisson(words[:, 7])
    ends = np.cumsum(counts)
    total = int(ends[-1]) if len(ends) else 0
    canvas = torch.zeros(window.height, window.width, dtype=DTYPES[mode], device=device)
    kept = torch.zeros(1, dtype=torch.int64, device=device)
    if total == 0:
        return canvas, 0
    share = 1 << (max(FEWEST, blocks_of(total, MOST_THREADS)) - 1).bit_length()
    tables = [torch.from_numpy(np.ascontiguousarray(table)).to(device) for table in (
        words[:, :6], ends.astype(np.int64), tree.maps, tree.thresholds.astype(np.int64), tree.guide.astype(np.int32))]
    launch(KERNELS[mode], blocks_of(blocks_of(total, share), THREADS), THREADS, *tables,
           int(random.integers(2**63)), share, burn_in(tree), canvas, kept)
    return canvas, int(kept)


def burn_in(tree: AddressTree) -> int:
    """Steps before a thread's first point: words of so many maps, drawn at random, contract by e^-16 and more."""
    largest = np.linalg.norm(tree.maps[:, :4].reshape(-1, 2, 2), 2, axis=(1, 2))
    rate = -tree.mass @ np.log(largest.clip(1e-9))
    return int(np.clip(math.ceil(ARRIVED / max(rate, 1e-9)), BURN_IN, MOST_STEPS))


def box_mean(canvas: Tensor, factor: int) -> Tensor:
    """The mean of each factor × factor block of canvas (H,W) uint8: (H // factor, W // factor) float32."""
    parts = canvas.view(len(canvas) // factor, factor, -1, factor)
    return parts.sum((1, 3), dtype=torch.int32) / float(factor * factor)


def _thrower(mark: Callable[..., Any]) -> Any:
    """The kernel that throws points and marks those that land in the window."""
    @cuda.jit
    def throw(words, ends, maps, thresholds, guide, seed, share, steps, canvas, kept):
        thread, total = cuda.grid(1), ends[ends.size - 1]
        threads = (total + share - 1) // share
        if thread >= threads:
            return
        height, width, stride = canvas.shape[0], canvas.shape[1], int64(GOLDEN_RATIO * share) | 1
        state, start_x, start_y = start(seed, thread)
        x, y = float64(start_x), float64(start_y)
        inside = int64(0)
        for k in range(-steps, share):
            state = next_state(uint64(state))
            i = int64(guide[int64(state >> uint64(64 - GUIDE_BITS))])
            while int64(state >> uint64(32)) >= thresholds[i]:
                i += 1
            new_x = maps[i, 0] * x + (maps[i, 1] * y + maps[i, 4])
            y = maps[i, 2] * x + (maps[i, 3] * y + maps[i, 5])
            x = new_x
            number = thread + threads * (k * stride & (share - 1))  # of the point among all
            if k >= 0 and number < total:
                job, last = 0, ends.size - 1
                while job < last:  # the word that it is under
                    middle = (job + last) // 2
                    if number < ends[middle]:
                        last = middle
                    else:
                        job = middle + 1
                column = words[job, 0] * x + (words[job, 1] * y + words[job, 4])
                row = words[job, 2] * x + (words[job, 3] * y + words[job, 5])
                if column >= 0 and column < width and row >= 0 and row < height:
                    inside += 1
                    mark(canvas, int64(row), int64(column))
        cuda.atomic.add(kept, 0, inside)
    return throw


@cuda.jit(device=True, inline="always")
def _light(canvas, row, column):
    canvas[row, column] = 1


@cuda.jit(device=True, inline="always")
def _count(canvas, row, column):
    cuda.atomic.add(canvas, (row, column), 1)


DTYPES = {LIT: torch.uint8, COUNTED: torch.int32}
KERNELS = {LIT: _thrower(_light), COUNTED: _thrower(_count)}
