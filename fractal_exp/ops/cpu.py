"""The CPU backend: autograd over the numba kernels, float32. Results do not depend on the number of threads."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from . import cpu_chaos_game, cpu_splat


def chaos_game(linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, *, trajectories: int, length: int,
               warmup: int) -> Tensor:
    """See `reference.chaos_game`."""
    return ChaosGame.apply(linear, offset, thresholds, seeds, trajectories, length, warmup)


def splat(points: Tensor, resolution: int, *, sigma_px: float, supersample: int) -> Tensor:
    """See `reference.splat`."""
    differentiable = torch.is_grad_enabled() and points.requires_grad
    return Splat.apply(points, resolution, sigma_px, supersample, differentiable)


class ChaosGame(torch.autograd.Function):
    """Keeps the points and the indices drawn, and walks every trajectory backwards."""

    @staticmethod
    def forward(ctx: Any, linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, trajectories: int,
                length: int, warmup: int) -> Tensor:
        maps = torch.cat([linear.flatten(2), offset], dim=-1)  # (B,N,6)
        points, indices = cpu_chaos_game.forward(maps.numpy(), thresholds.numpy(), seeds.numpy(), trajectories, length,
                                                 warmup)
        points, indices = torch.from_numpy(points), torch.from_numpy(indices)
        ctx.save_for_backward(maps, seeds, points, indices)
        return points

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_points: Tensor) -> tuple[Tensor | None, ...]:
        maps, seeds, points, indices = ctx.saved_tensors
        grad = torch.from_numpy(cpu_chaos_game.backward(maps.numpy(), seeds.numpy(), points.numpy(), indices.numpy(),
                                                        grad_points.contiguous().numpy()))
        return grad[..., :4].unflatten(-1, (2, 2)), grad[..., 4:], None, None, None, None, None


class Splat(torch.autograd.Function):
    """Keeps the supersampled transmittance prod (1 - alpha) and the lists of points by tile."""

    @staticmethod
    def forward(ctx: Any, points: Tensor, resolution: int, sigma_px: float, supersample: int,
                differentiable: bool) -> Tensor:
        grid = cpu_splat.grid_of(resolution, supersample, sigma_px)
        points = points.contiguous()
        image, *kept = cpu_splat.forward(points.numpy(), grid, differentiable)
        if differentiable:
            ctx.grid = grid
            ctx.save_for_backward(points, *(torch.from_numpy(array) for array in kept))
        return torch.from_numpy(image)

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_image: Tensor) -> tuple[Tensor | None, ...]:
        points, *kept = (tensor.numpy() for tensor in ctx.saved_tensors)
        grad = cpu_splat.backward(points, *kept, grad_image.contiguous().numpy(), ctx.grid)
        return torch.from_numpy(grad), None, None, None, None
