"""The lit share of the parts of each pixel, by the CPU."""

from __future__ import annotations

import numpy as np
from numba import njit, prange, uint64

from ...runtime.jit import kernel

MOST_OF_BYTES = 24   # parts a side whose 8 columns each are counted in a byte, a multiple of 8


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
def _ones_of_bytes(bits):
    """How many bits of each of 8 bytes are set, in that byte."""
    bits -= (bits >> uint64(1)) & uint64(0x5555555555555555)
    bits = (bits & uint64(0x3333333333333333)) + ((bits >> uint64(2)) & uint64(0x3333333333333333))
    return (bits + (bits >> uint64(4))) & uint64(0x0F0F0F0F0F0F0F0F)


@njit(inline="always")
def _ones(bits):
    """How many of 64 bits are set; LLVM knows this form and makes one instruction of it."""
    return (_ones_of_bytes(bits) * uint64(0x0101010101010101)) >> uint64(56)


@njit(inline="always")
def _unite(planes, row, line):
    """The row of all planes (T,H,K) into line (K,): what is set in any of them."""
    for k in range(len(line)):
        line[k] = planes[0, row, k]
    for plane in range(1, len(planes)):
        for k in range(len(line)):
            line[k] |= planes[plane, row, k]


@kernel(parallel=True)
def lit_share(planes, factor, out):
    """The share of each factor × factor block of parts that is set in any of the planes (T,H,K) uint64, which
    `histogram.planes` explains, into out (H // factor, W // factor) float32; factor at most 64."""
    scale, mask = 1.0 / (factor * factor), uint64(0xFFFFFFFFFFFFFFFF) >> uint64(64 - factor)
    bytes_each = factor // 8 if factor % 8 == 0 and factor <= MOST_OF_BYTES else 0
    for row in prange(out.shape[0]):
        line, sums = np.empty(planes.shape[2], np.uint64), np.zeros(out.shape[1], np.uint64)
        if bytes_each:  # many words at once
            ones = np.zeros(planes.shape[2], np.uint64)
            for i in range(factor):
                _unite(planes, row * factor + i, line)
                for k in range(len(line)):
                    ones[k] += _ones_of_bytes(line[k])
            for column in range(len(sums)):
                for part in range(column * bytes_each, (column + 1) * bytes_each):
                    sums[column] += (ones[part >> 3] >> uint64(8 * (part & 7))) & uint64(255)
        else:
            for i in range(factor):
                _unite(planes, row * factor + i, line)
                for column in range(len(sums)):
                    word, shift = column * factor >> 6, uint64(column * factor & 63)
                    bits = (line[word] >> shift) | (line[word + 1] << uint64(1) << (uint64(63) - shift))
                    sums[column] += _ones(bits & mask)
        for column in range(len(sums)):
            out[row, column] = float(sums[column]) * scale
