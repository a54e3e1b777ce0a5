"""A numba kernel of SSIM's window, whose twin is `ssim.shifted_sums` along both axes."""

from __future__ import annotations

import numpy as np
from numba import prange

from ...runtime.jit import FUSED, kernel

TAPS = 11  # as a constant, so that LLVM unrolls their loop and keeps the sums in registers


def blurred(images: np.ndarray, window: np.ndarray) -> np.ndarray:
    """images (B,H,W) under a window (11,) along both axes, where it fits: (B,H-10,W-10).

    Summed in double precision: a variance is a small difference of two such sums.
    """
    count, height, width = images.shape
    out = np.empty((count, height - TAPS + 1, width - TAPS + 1), np.float32)
    _blur(images, window, out)
    return out


@kernel(parallel=True, fastmath=FUSED)
def _blur(images, window, out):
    count, height, width = out.shape
    for job in prange(count * height):
        code, row = job // height, job % height
        lines, target, down = images[code, row:row + TAPS], out[code, row], np.empty(images.shape[2])
        for c in range(len(down)):
            total = 0.0
            for k in range(TAPS):
                total += window[k] * lines[k, c]
            down[c] = total
        for c in range(width):
            total = 0.0
            for k in range(TAPS):
                total += window[k] * down[c + k]
            target[c] = total
