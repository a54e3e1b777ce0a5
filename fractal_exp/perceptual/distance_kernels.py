"""numba kernels of the distance of features of unit length, for a CPU: a pixel's channels are read once a pass, and
nothing is written but the distance or its gradient. The formulas in `feature_distance` are their twin."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from numba import float32, njit, prange
from torch import Tensor
from torch.autograd.function import once_differentiable

from ..runtime.jit import FUSED, kernel
from ..runtime.vectors import LANES, load, store, total, zeros

NORM_FLOOR = float32(1e-10)
TOGETHER = 64  # pixels whose sum is taken at once: fixes the order of the sum for any number of threads


def takes(a: Tensor, b: Tensor, weight: Tensor) -> bool:
    """Whether the kernels take features a (…,C,h,w), b (…,C,h,w) or (C,h,w), and weight (C,)."""
    of_one_kind = all(each.dtype == torch.float32 and each.device.type == "cpu" for each in (a, b, weight))
    return (of_one_kind and len(weight) % LANES == 0 and b.shape in (a.shape, a.shape[-3:])
            and not (torch.is_grad_enabled() and (b.requires_grad or weight.requires_grad)))


class UnitDistance(torch.autograd.Function):
    """Mean over pixels of sum_c weight_c (u_c - v_c)², u and v being a and b scaled to length 1 along C; differentiable
    in a."""

    @staticmethod
    def forward(ctx: Any, a: Tensor, b: Tensor, weight: Tensor) -> Tensor:
        rows = _rows(a), _rows(b)
        ctx.save_for_backward(*rows, weight)
        ctx.shape = a.shape
        sums = np.zeros((len(rows[0]), -(-rows[0].shape[1] // TOGETHER)), np.float32)
        _forward(*(each.numpy() for each in (*rows, weight)), sums)
        means = sums.sum(1, dtype=np.float64) / max(rows[0].shape[1], 1)
        return torch.from_numpy(means.astype(np.float32)).view(a.shape[:-3])

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, cotangent: Tensor) -> tuple[Tensor, None, None]:
        a, b, weight = ctx.saved_tensors
        gradient = torch.empty_like(a)
        scales = (cotangent.reshape(-1) * (2 / a.shape[1])).contiguous()
        _backward(*(each.numpy() for each in (a, b, weight, scales, gradient)))
        *batch, channels, height, width = ctx.shape
        return gradient.view(*batch, height, width, channels).movedim(-1, -3), None, None


def _rows(features: Tensor) -> Tensor:
    """Features (…,C,h,w) as (B,h·w,C): no copy of what is channels-last."""
    *_, channels, height, width = features.shape
    return features.detach().movedim(-3, -1).reshape(-1, height * width, channels).contiguous()


@njit(inline="always")
def _norm(x, start, channels):
    squares = zeros()
    for c in range(start, start + channels, LANES):
        squares += load(x, c) * load(x, c)
    return math.sqrt(total(squares)) + NORM_FLOOR


@kernel(parallel=True, fastmath=FUSED)
def _forward(a, b, weight, sums):
    codes, pixels, channels = a.shape
    parts = sums.shape[1]
    flat_a, flat_b = a.reshape(-1), b.reshape(-1)
    for job in prange(codes * parts):
        code, part = job // parts, job % parts
        for pixel in range(part * TOGETHER, min((part + 1) * TOGETHER, pixels)):
            at_a, at_b = (code * pixels + pixel) * channels, (code % len(b) * pixels + pixel) * channels
            norm = _norm(flat_a, at_a, channels)
            ratio = float32(norm / _norm(flat_b, at_b, channels))
            squares = zeros()
            for c in range(0, channels, LANES):
                apart = load(flat_a, at_a + c) - load(flat_b, at_b + c) * ratio  # 0 where a and b are equal
                squares += load(weight, c) * apart * apart
            inverse = 1 / norm
            sums[code, part] += total(squares) * inverse * inverse


@kernel(parallel=True, fastmath=FUSED)
def _backward(a, b, weight, scales, gradient):
    """With w the weights, s = 1/|a| and e = a - b |a|/|b|: 2 scale s² (w e - s² a sum(w e a))."""
    codes, pixels, channels = a.shape
    flat_a, flat_b, flat = a.reshape(-1), b.reshape(-1), gradient.reshape(-1)
    for place in prange(codes * pixels):
        at_a = place * channels
        at_b = (place // pixels % len(b) * pixels + place % pixels) * channels
        norm = _norm(flat_a, at_a, channels)
        ratio = float32(norm / _norm(flat_b, at_b, channels))
        along = zeros()
        for c in range(0, channels, LANES):
            value = load(flat_a, at_a + c)
            weighted = (value - load(flat_b, at_b + c) * ratio) * load(weight, c)
            along += weighted * value
            store(flat, at_a + c, weighted)
        inverse = 1 / norm
        square = float32(inverse * inverse)
        down, scale = float32(total(along) * square), float32(square * scales[place // pixels])
        for c in range(0, channels, LANES):
            store(flat, at_a + c, (load(flat, at_a + c) - load(flat_a, at_a + c) * down) * scale)
