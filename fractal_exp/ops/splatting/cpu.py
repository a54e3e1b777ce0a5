"""The CPU backend of the splat: autograd over the numba kernels, float32. Results do not depend on threads."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from . import cpu_kernels as kernels


def splat(points: Tensor, resolution: int, *, sigma_px: float, supersample: int) -> Tensor:
    """See `reference.splat`."""
    differentiable = torch.is_grad_enabled() and points.requires_grad
    return Splat.apply(points, resolution, sigma_px, supersample, differentiable)


class Splat(torch.autograd.Function):
    """Keeps the supersampled transmittance prod (1 - alpha) and the points sorted by tile."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, resolution: int, sigma_px: float, supersample: int,
                differentiable: bool) -> Tensor:
        grid = kernels.grid_of(resolution, supersample, sigma_px)
        image, *kept = kernels.forward(points.contiguous().numpy(), grid, differentiable)
        if differentiable:
            ctx.grid = grid
            ctx.save_for_backward(*(torch.from_numpy(array) for array in kept))
        return torch.from_numpy(image)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_image: Tensor) -> tuple[Tensor | None, ...]:
        kept = (tensor.numpy() for tensor in ctx.saved_tensors)
        grad = kernels.backward(*kept, grad_image.contiguous().numpy(), ctx.grid)
        return torch.from_numpy(grad), None, None, None, None
