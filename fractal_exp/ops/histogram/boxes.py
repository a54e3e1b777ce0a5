"""The lit share of the parts of each pixel, by the CPU."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, uint64

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


@njit(inline="always")
def _ones(bits):
    """How many of 64 bits are set; LLVM knows this form and makes one instruction of it."""
    bits -= (bits >> uint64(1)) & uint64(0x5555555555555555)
    bits = (bits & uint64(0x3333333333333333)) + ((bits >> uint64(2)) & uint64(0x3333333333333333))
    bits = (bits + (bits >> uint64(4))) & uint64(0x0F0F0F0F0F0F0F0F)
    return (bits * uint64(0x0101010101010101)) >> uint64(56)


@kernel(parallel=True)
def lit_share(planes, factor, out):
    """The share of each factor × factor block of parts that is set in any of the planes (T,H,K) uint64, which
    `histogram.planes` explains, into out (H // factor, W // factor) float32; factor at most 64."""
    scale, mask = 1.0 / (factor * factor), uint64(0xFFFFFFFFFFFFFFFF) >> uint64(64 - factor)
    for row in prange(out.shape[0]):
        line, sums = np.empty(planes.shape[2], np.uint64), np.zeros(out.shape[1], np.uint64)
        for i in range(factor):
            for k in range(len(line)):
                line[k] = planes[0, row * factor + i, k]
                for plane in range(1, len(planes)):
                    line[k] |= planes[plane, row * factor + i, k]
            for column in range(len(sums)):
                word, shift = column * factor >> 6, uint64(column * factor & 63)
                bits = (line[word] >> shift) | (line[word + 1] << uint64(1) << (uint64(63) - shift))
                sums[column] += _ones(bits & mask)
        for column in range(len(sums)):
            out[row, column] = float(sums[column]) * scale
