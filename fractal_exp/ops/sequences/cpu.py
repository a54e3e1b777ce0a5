"""The CPU backend of `sequence` and `blob_error`: autograd over numba kernels, float32. A thread has sequences of its
own, so results do not depend on their number."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from numba import float32, njit, prange, uint64
from torch import Tensor
from torch.autograd.function import once_differentiable

from ...runtime.jit import FUSED, kernel
from ..chaos.cpu_kernels import hold, next_state, unless_held
from ..chaos.cpu_kernels import start as start_of

REACH = 4  # pixels from the nearest one, to which a Gaussian is drawn
BELL = np.array([math.exp(-k * k) for k in range(REACH + 1)], np.float32)


def sequence(linear: Tensor, offset: Tensor, start: Tensor, thresholds: Tensor, seed: int, sequences: int, length: int
             ) -> Tensor:
    """See `reference.sequence`."""
    return Sequence.apply(linear, offset, start, thresholds, seed, sequences, length)


def blob_error(points: Tensor, image: Tensor) -> Tensor:
    """See `reference.blob_error`."""
    return BlobError.apply(points, image, torch.is_grad_enabled() and points.requires_grad)


class Sequence(torch.autograd.Function):
    """Keeps the points and the maps drawn, and walks every sequence backwards."""

    @staticmethod
    def forward(ctx: Any, linear: Tensor, offset: Tensor, start: Tensor, thresholds: Tensor, seed: int, sequences: int,
                length: int) -> Tensor:
        maps = torch.cat([linear.flatten(1), offset], -1)
        points, indices = np.empty((sequences, length, 2), np.float32), np.empty((sequences, length), np.uint16)
        _walk(maps.numpy(), np.ascontiguousarray(thresholds.numpy()), seed, start.numpy(), points, indices)
        points = torch.from_numpy(points)
        ctx.save_for_backward(maps, start, points, torch.from_numpy(indices))
        return points

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_points: Tensor) -> tuple[Tensor | None, ...]:
        maps, start, points, indices = (tensor.numpy() for tensor in ctx.saved_tensors)
        grad, grad_start = np.zeros((len(points), len(maps), 6)), np.zeros((len(points), 2))
        _walk_back(maps, start, points, indices, grad_points.contiguous().numpy(), grad, grad_start)
        grad = torch.from_numpy(grad.sum(0).astype(np.float32))
        return (grad[:, :4].unflatten(-1, (2, 2)), grad[:, 4:], torch.from_numpy(grad_start.sum(0).astype(np.float32)),
                None, None, None, None)


class BlobError(torch.autograd.Function):
    """The gradient is computed with the error, as both need the image that the points draw."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, image: Tensor, differentiable: bool) -> Tensor:
        points = points.contiguous()
        errors = np.empty(len(points), np.float32)
        grad = np.zeros(points.shape if differentiable else (0, 0, 2), np.float32)
        _errors(points.numpy(), image.contiguous().numpy(), BELL, errors, grad)
        ctx.save_for_backward(torch.from_numpy(grad))
        return torch.from_numpy(errors)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_errors: Tensor) -> tuple[Tensor | None, ...]:
        return ctx.saved_tensors[0] * grad_errors[:, None, None], None, None


@kernel(parallel=True, fastmath=FUSED)
def _walk(maps, thresholds, seed, origin, points, indices):
    for number in prange(len(points)):
        state, _, _ = start_of(seed, number)
        x, y = origin[0], origin[1]
        for k in range(points.shape[1]):
            state = next_state(state)
            variate = np.int64(state >> uint64(32))
            i = 0
            while variate >= thresholds[i]:
                i += 1
            m = maps[i]
            new_x = hold(m[0] * x + (m[1] * y + m[4]))
            y = hold(m[2] * x + (m[3] * y + m[5]))
            x = new_x
            indices[number, k] = i
            points[number, k, 0], points[number, k, 1] = x, y


@kernel(parallel=True, fastmath=FUSED)
def _walk_back(maps, origin, points, indices, grad_points, grad, grad_start):
    for number in prange(len(points)):
        total, at, slope = grad[number], points[number], grad_points[number]
        gx = gy = 0.0
        for k in range(points.shape[1] - 1, -1, -1):
            gx = unless_held(at[k, 0], gx + slope[k, 0])
            gy = unless_held(at[k, 1], gy + slope[k, 1])
            i = indices[number, k]
            x, y = (at[k - 1, 0], at[k - 1, 1]) if k > 0 else (origin[0], origin[1])
            total[i, 0] += gx * x
            total[i, 1] += gx * y
            total[i, 2] += gy * x
            total[i, 3] += gy * y
            total[i, 4] += gx
            total[i, 5] += gy
            gx, gy = maps[i, 0] * gx + maps[i, 2] * gy, maps[i, 1] * gx + maps[i, 3] * gy
        grad_start[number, 0], grad_start[number, 1] = gx, gy


@njit(inline="always")
def _weights(x, bell, side, weights):
    """exp(-(k - x)²) at the pixels k about x, into weights (2 REACH + 1,); the nearest pixel and the range in the
    image, as indices of the weights. With k = nearest + j and x = nearest + f it is exp(-j²) exp(2 f)^j exp(-f²)."""
    nearest = int(np.floor(x + float32(0.5)))
    f = x - float32(nearest)
    up, down = np.exp(float32(2) * f), np.exp(float32(-2) * f)
    above = below = np.exp(-f * f)
    weights[REACH] = above
    for j in range(1, REACH + 1):
        above *= up
        below *= down
        weights[REACH + j] = above * bell[j]
        weights[REACH - j] = below * bell[j]
    return nearest, max(0, REACH - nearest), min(2 * REACH + 1, REACH + side - nearest)


@kernel(parallel=True, fastmath=FUSED)
def _errors(points, image, bell, errors, grad):
    side = len(image)
    scale = float32(2) / float32(side * side)
    for number in prange(len(points)):
        canvas = np.zeros((side, side), np.float32)
        across, down = np.empty(2 * REACH + 1, np.float32), np.empty(2 * REACH + 1, np.float32)
        for k in range(points.shape[1]):
            row, top, bottom = _weights(points[number, k, 0], bell, side, down)
            column, left, right = _weights(points[number, k, 1], bell, side, across)
            for r in range(top, bottom):
                line, weight = canvas[row + r - REACH], down[r]
                for c in range(left, right):
                    line[column + c - REACH] += weight * across[c]
        total = 0.0
        for r in range(side):
            for c in range(side):
                drawn = canvas[r, c]
                wrong = min(drawn, float32(1)) - image[r, c]
                total += wrong * wrong
                canvas[r, c] = scale * wrong if drawn <= 1 else float32(0)
        errors[number] = total / (side * side)
        if len(grad) == 0:
            continue
        for k in range(points.shape[1]):
            y, x = points[number, k, 0], points[number, k, 1]
            row, top, bottom = _weights(y, bell, side, down)
            column, left, right = _weights(x, bell, side, across)
            slope_y = slope_x = float32(0)
            for r in range(top, bottom):
                line, weight = canvas[row + r - REACH], down[r]
                straight = aslant = float32(0)
                for c in range(left, right):
                    part = line[column + c - REACH] * across[c]
                    straight += part
                    aslant += part * (float32(column + c - REACH) - x)
                slope_y += straight * weight * (float32(row + r - REACH) - y)
                slope_x += aslant * weight
            grad[number, k, 0] = float32(2) * slope_y
            grad[number, k, 1] = float32(2) * slope_x
