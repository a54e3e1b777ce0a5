"""The CPU backend of `point_counts`: the points in one pass, which torch goes through a dozen times."""

from __future__ import annotations

import numpy as np
import torch
from numba import float32
from torch import Tensor

from ...runtime.jit import kernel


def point_counts(points: Tensor, side: int) -> Tensor:
    """See `reference.point_counts`."""
    counts = np.zeros((side, side), np.int64)
    _count(points.contiguous().numpy(), counts)
    return torch.from_numpy(counts)


@kernel()
def _count(points, counts):
    side = len(counts)
    half = float32(0.5 * side)
    for k in range(len(points)):
        column, row = (points[k, 0] + float32(1)) * half, (float32(1) - points[k, 1]) * half
        if column >= 0 and column < side and row >= 0 and row < side:
            counts[int(row), int(column)] += 1
