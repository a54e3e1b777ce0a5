"""The comparison in LPIPS's construction: the weighted squared difference of features of unit length.

Written out, since PyTorch's own backward passes over the features cost a CPU more than the convolutions of a small
network; of frozen weights on a CPU in one numba kernel each way, which is one pass instead of a dozen. It runs on one
thread: the features of a small network are done before a second would have begun, and those of a large one are little
beside its convolutions.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import add

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ..errors import InputError
from ..runtime.jit import FAST, kernel

NORM_FLOOR = 1e-10
_FLOOR = np.float32(NORM_FLOOR)
_EXACT_ZERO = FAST - {"contract"}  # a product fused into a difference would put equal features 10⁻¹⁵ apart


def unit_distance(a: Sequence[Tensor], b: Sequence[Tensor], weights: Sequence[Tensor]) -> Tensor:
    """Sum over levels of the mean over pixels of sum_c w_c (u_c - v_c)², u and v being a and b scaled to length 1 along
    C (Zhang et al. 2018, equation 1); of each level (…,C,h,w), (…,C,h,w) and (C,) -> (…,); batches broadcast.

    Differentiable in a and b, and in weights that ask for it. Raises `InputError` on levels that do not go together.
    """
    batch = _check(a, b, weights)
    plain = all(x.device.type == "cpu" and x.dtype == torch.float32 for x in (*a, *b, *weights))
    if plain and not any(weight.requires_grad for weight in weights):
        a, b = (levels if levels[0].shape[:-3].numel() == 1 else [x.expand(*batch, *x.shape[-3:]) for x in levels]
                for levels in (a, b))
        return _UnitDistance.apply(batch, *a, *b, *weights)
    levels = zip(a, b, weights, strict=True)
    return reduce(add, (squared_distance(unit_length(x), unit_length(y), weight) for x, y, weight in levels))


def _check(a: Sequence[Tensor], b: Sequence[Tensor], weights: Sequence[Tensor]) -> torch.Size:
    """The batch of the distances; the kernels themselves check no bounds."""
    if not len(a) == len(b) == len(weights) > 0:
        raise InputError(f"features must have as many levels as there are weights, got {len(a)} and {len(b)} for "
                         f"{len(weights)}; take both from `features` of one distance")
    for x, y, weight in zip(a, b, weights, strict=True):
        if x.shape[-3:] != y.shape[-3:] or weight.shape != x.shape[-3:-2]:
            raise InputError(f"features of one level must agree in channels and size, got {tuple(x.shape[-3:])}, "
                             f"{tuple(y.shape[-3:])} and {tuple(weight.shape)} weights; draw both images at one "
                             "resolution")
        if x.shape[:-3] != a[0].shape[:-3] or y.shape[:-3] != b[0].shape[:-3]:
            raise InputError(f"all levels must have one batch, got {tuple(x.shape[:-3])} and {tuple(y.shape[:-3])} "
                             f"beside {tuple(a[0].shape[:-3])} and {tuple(b[0].shape[:-3])}")
    return torch.broadcast_shapes(a[0].shape[:-3], b[0].shape[:-3])


def unit_length(x: Tensor) -> Tensor:
    """Features (…,C,h,w) scaled to length 1 along C; where all of them are 0 they stay 0."""
    return _UnitLength.apply(x)


def squared_distance(a: Tensor, b: Tensor, weight: Tensor) -> Tensor:
    """Mean over pixels of sum_c weight_c (a_c - b_c)²: (…,C,h,w), (…,C,h,w), (C,) -> (…,); batches broadcast.

    Differentiable in all three; weights that take no gradient cost less.
    """
    if weight.requires_grad:
        return (a - b).square().mean((-2, -1)) @ weight
    return _SquaredDistance.apply(a, b, weight)


class _UnitDistance(torch.autograd.Function):
    """See `unit_distance`; a and b have the whole batch each, or a single image."""

    @staticmethod
    def forward(ctx, batch: torch.Size, *levels: Tensor) -> Tensor:
        count = len(levels) // 3
        kept = [*map(_by_pixel, levels[:2 * count]), *levels[2 * count:]]
        ctx.save_for_backward(*kept)
        ctx.shapes = [level.shape for level in levels[:2 * count]]
        a, b, weights = _thirds([tensor.numpy() for tensor in kept])
        return torch.from_numpy(sum(map(_distances, a, b, weights))).view(batch)

    @staticmethod
    @once_differentiable
    def backward(ctx, cotangent: Tensor) -> tuple[Tensor | None, ...]:
        a, b, weights = _thirds([tensor.numpy() for tensor in ctx.saved_tensors])
        pushed = cotangent.flatten().contiguous().numpy()
        sides = zip([*a, *b], [*b, *a], weights * 2, ctx.shapes, ctx.needs_input_grad[1:], strict=False)
        gradients = [_by_channel(_gradient(own, other, weight, pushed), shape) if wanted else None
                     for own, other, weight, shape, wanted in sides]
        return None, *gradients, *[None] * len(weights)


def _thirds(values: list) -> tuple[list, list, list]:
    count = len(values) // 3
    return values[:count], values[count:2 * count], values[2 * count:]


def _by_pixel(x: Tensor) -> Tensor:
    """(…,C,h,w) -> (B,h·w,C), without a copy where the channels are last in memory."""
    return x.movedim(-3, -1).reshape(-1, x.shape[-2:].numel(), x.shape[-3]).contiguous()


def _by_channel(x: np.ndarray, shape: torch.Size) -> Tensor:
    """(B,h·w,C) -> (…,C,h,w) as `shape` says, the channels last in memory."""
    *batch, channels, height, width = shape
    return torch.from_numpy(x).view(*batch, height, width, channels).movedim(-1, -3)


@kernel(fastmath=_EXACT_ZERO)
def _distances(a, b, weight):  # noqa: ANN001, ANN202
    """(A,P,C), (B,P,C), (C,) -> (K,): A and B are K, but for one that may be 1."""
    _, pixels, channels = a.shape
    found = np.empty(len(a) if len(b) == 1 else len(b), np.float32)
    for k in range(len(found)):
        x, y, total = a[k % len(a)], b[k % len(b)], 0.0
        for p in range(pixels):
            x_length, y_length, here = np.float32(0), np.float32(0), np.float32(0)
            for c in range(channels):
                x_length += x[p, c] * x[p, c]
                y_length += y[p, c] * y[p, c]
            x_scale = np.float32(1) / (np.sqrt(x_length) + _FLOOR)
            y_scale = np.float32(1) / (np.sqrt(y_length) + _FLOOR)
            for c in range(channels):
                difference = x[p, c] * x_scale - y[p, c] * y_scale
                here += weight[c] * difference * difference
            total += here
        found[k] = total / pixels
    return found


@kernel(fastmath=_EXACT_ZERO)
def _gradient(a, b, weight, cotangent):  # noqa: ANN001, ANN202
    """The gradient (A,P,C), with respect to a, of the sum over k of cotangent_k (K,) and `_distances`."""
    _, pixels, channels = a.shape
    gradient = np.zeros_like(a)
    for k in range(len(cotangent)):
        x, y, found = a[k % len(a)], b[k % len(b)], gradient[k % len(a)]
        scale = np.float32(2) * cotangent[k] / np.float32(pixels)
        for p in range(pixels):
            x_length, y_length, along = np.float32(0), np.float32(0), np.float32(0)
            for c in range(channels):
                x_length += x[p, c] * x[p, c]
                y_length += y[p, c] * y[p, c]
            x_scale = np.float32(1) / (np.sqrt(x_length) + _FLOOR)
            y_scale = np.float32(1) / (np.sqrt(y_length) + _FLOOR)
            for c in range(channels):
                unit = x[p, c] * x_scale
                along += unit * weight[c] * (unit - y[p, c] * y_scale)
            for c in range(channels):
                unit = x[p, c] * x_scale
                found[p, c] += scale * x_scale * (weight[c] * (unit - y[p, c] * y_scale) - unit * along)
    return gradient


class _UnitLength(torch.autograd.Function):
    """u = x / (|x| + floor)."""

    @staticmethod
    def forward(ctx, x: Tensor) -> Tensor:
        inverse = (torch.linalg.vector_norm(x, dim=-3, keepdim=True) + NORM_FLOOR).reciprocal_()
        unit = x * inverse
        ctx.save_for_backward(unit, inverse)
        return unit

    @staticmethod
    @once_differentiable
    def backward(ctx, cotangent: Tensor) -> Tensor:
        unit, inverse = ctx.saved_tensors
        along = (unit * cotangent).sum(-3, keepdim=True)
        return torch.addcmul(cotangent, unit, along, value=-1).mul_(inverse)


class _SquaredDistance(torch.autograd.Function):
    """See `squared_distance`, for weights that take no gradient."""

    @staticmethod
    def forward(ctx, a: Tensor, b: Tensor, weight: Tensor) -> Tensor:
        difference = a - b
        ctx.save_for_backward(difference, weight)
        ctx.shapes = a.shape, b.shape
        return difference.square().mean((-2, -1)) @ weight

    @staticmethod
    @once_differentiable
    def backward(ctx, cotangent: Tensor) -> tuple[Tensor | None, Tensor | None, None]:
        difference, weight = ctx.saved_tensors
        scale = cotangent[..., None] * weight * (2 / difference.shape[-2:].numel())
        gradient = difference * scale[..., None, None]
        a, b = ctx.shapes
        wants_a, wants_b, _ = ctx.needs_input_grad
        return gradient.sum_to_size(a) if wants_a else None, -gradient.sum_to_size(b) if wants_b else None, None
