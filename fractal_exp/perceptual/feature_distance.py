"""The comparison in LPIPS's construction: the weighted squared difference of features of unit length.

The backward passes are written out: with PyTorch's own, a distance and its gradient take a CPU a fifth longer
(`fractal`) to twice as long (LPIPS-squeeze). Where only the first features take a gradient, as in a fit, a CPU has
kernels (`distance_kernels`), in which they take two fifths of that time again.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import add

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from ..errors import InputError

NORM_FLOOR = 1e-10


def unit_distance(a: Sequence[Tensor], b: Sequence[Tensor], weights: Sequence[Tensor]) -> Tensor:
    """Sum over levels of the mean over pixels of sum_c w_c (u_c - v_c)², u and v being a and b scaled to length 1 along
    C (Zhang et al. 2018, equation 1); of each level (…,C,h,w), (…,C,h,w) and (C,) -> (…,); batches broadcast.

    Differentiable in a and b, and in weights that ask for it. Raises `InputError` on levels that do not go together.
    """
    _check(a, b, weights)
    levels = zip(a, b, weights, strict=True)
    return reduce(add, (_distance_of_level(x, y, weight) for x, y, weight in levels))


def _check(a: Sequence[Tensor], b: Sequence[Tensor], weights: Sequence[Tensor]) -> None:
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


def _distance_of_level(x: Tensor, y: Tensor, weight: Tensor) -> Tensor:
    if x.device.type == "cpu":
        from . import distance_kernels as kernels  # at its first use, so that nobody else waits for a compiler

        if kernels.takes(x, y, weight):
            return kernels.UnitDistance.apply(x, y, weight)
    return squared_distance(unit_length(x), unit_length(y), weight)


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
