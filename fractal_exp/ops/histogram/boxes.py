"""The lit share of the parts of each pixel, by the CPU."""

from __future__ import annotations

import numpy as np
from numba import prange

from ...runtime.jit import kernel


@kernel(parallel=True)
def box_mean(canvas, factor, out):
    """The mean of each factor × factor block of canvas (S,S) uint8 of 0 and 1 into out (S // factor, S // factor)
    float32; factor at most 255."""
    scale = 1.0 / (factor * factor)
    for row in prange(out.shape[0]):
        sums = np.zeros(canvas.shape[1], np.uint8)  # of bytes, so that many are added at once
        for i in range(factor):
            line = canvas[row * factor + i]
            for k in range(len(line)):
                sums[k] += line[k]
        for column in range(out.shape[1]):
            total = 0
            for j in range(factor):
                total += sums[column * factor + j]
            out[row, column] = total * scale
