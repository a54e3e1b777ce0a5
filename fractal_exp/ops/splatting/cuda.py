"""The CUDA backend of the splat: autograd over the numba-cuda kernels, float32, on torch's current stream.

Nothing waits for the device, so that a whole iteration can be recorded in a CUDA graph (after one run outside of it,
which compiles). No kernel adds with atomics: results and gradients repeat bit for bit on one kind of GPU.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from . import cuda_kernels as kernels


def splat(points: Tensor, resolution: int, *, sigma_px: float, supersample: int) -> Tensor:
    """See `reference.splat`."""
    if torch.is_grad_enabled() and points.requires_grad:
        return Splat.apply(points, resolution, sigma_px, supersample)
    return kernels.image_of(points.contiguous(), kernels.grid_of(resolution, supersample, sigma_px))


class Splat(torch.autograd.Function):
    """Keeps the supersampled transmittance prod (1 - alpha) and the order of the points by tile."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, resolution: int, sigma_px: float, supersample: int) -> Tensor:
        ctx.grid = kernels.grid_of(resolution, supersample, sigma_px)
        seated, order, starts = kernels.sort(points.contiguous(), ctx.grid)
        transmittance = kernels.transmittance(seated, starts, ctx.grid)
        ctx.save_for_backward(seated, order, starts, transmittance)
        return kernels.downsample(transmittance, ctx.grid)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_image: Tensor) -> tuple[Tensor | None, ...]:
        return kernels.backward(*ctx.saved_tensors, grad_image.contiguous(), ctx.grid), None, None, None
