"""The CUDA backend: autograd over the numba-cuda kernels, float32, on torch's current stream.

Nothing waits for the device, so that a whole iteration can be recorded in a CUDA graph (after one run outside of it,
which compiles). No kernel adds with atomics: points, images and gradients repeat bit for bit on one kind of GPU.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from . import cuda_chaos_game, cuda_splat


def chaos_game(linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, *, trajectories: int, length: int,
               warmup: int) -> Tensor:
    """See `reference.chaos_game`."""
    return ChaosGame.apply(linear, offset, thresholds, seeds, trajectories, length, warmup)


def splat(points: Tensor, resolution: int, *, sigma_px: float, supersample: int) -> Tensor:
    """See `reference.splat`."""
    if torch.is_grad_enabled() and points.requires_grad:
        return Splat.apply(points, resolution, sigma_px, supersample)
    return cuda_splat.image_of(points.contiguous(), cuda_splat.grid_of(resolution, supersample, sigma_px))


class ChaosGame(torch.autograd.Function):
    """Keeps the points and the indices drawn, and walks every trajectory backwards."""

    @staticmethod
    def forward(ctx: Any, linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, trajectories: int,
                length: int, warmup: int) -> Tensor:
        maps = torch.cat([linear.flatten(2), offset], dim=-1)  # (B,N,6)
        points, path, indices = cuda_chaos_game.forward(maps, thresholds, seeds, trajectories, length, warmup)
        ctx.save_for_backward(maps, seeds, points, path, indices)
        return points

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_points: Tensor) -> tuple[Tensor | None, ...]:
        grad = cuda_chaos_game.backward(*ctx.saved_tensors, grad_points.contiguous())
        return grad[..., :4].unflatten(-1, (2, 2)), grad[..., 4:], None, None, None, None, None


class Splat(torch.autograd.Function):
    """Keeps the supersampled transmittance prod (1 - alpha) and the order of the points by tile."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, resolution: int, sigma_px: float, supersample: int) -> Tensor:
        ctx.grid = cuda_splat.grid_of(resolution, supersample, sigma_px)
        seated, order, starts = cuda_splat.sort(points.contiguous(), ctx.grid)
        transmittance = cuda_splat.transmittance(seated, starts, ctx.grid)
        ctx.save_for_backward(seated, order, starts, transmittance)
        return cuda_splat.downsample(transmittance, ctx.grid)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_image: Tensor) -> tuple[Tensor | None, ...]:
        return cuda_splat.backward(*ctx.saved_tensors, grad_image.contiguous(), ctx.grid), None, None, None
