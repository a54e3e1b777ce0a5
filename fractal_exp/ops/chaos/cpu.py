"""The CPU backend of the chaos game: autograd over the numba kernels, float32. Results do not depend on threads."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from . import cpu_kernels as kernels


def chaos_game(linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, *, trajectories: int, length: int,
               warmup: int) -> Tensor:
    """See `reference.chaos_game`."""
    return ChaosGame.apply(linear, offset, thresholds, seeds, trajectories, length, warmup)


class ChaosGame(torch.autograd.Function):
    """Keeps the points and the indices drawn, and walks every trajectory backwards."""

    @staticmethod
    def forward(ctx: Any, linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, trajectories: int,
                length: int, warmup: int) -> Tensor:
        maps = torch.cat([linear.flatten(2), offset], dim=-1)  # (B,N,6)
        points, indices = kernels.forward(maps.numpy(), thresholds.numpy(), seeds.numpy(), trajectories, length,
                                                 warmup)
        points, indices = torch.from_numpy(points), torch.from_numpy(indices)
        ctx.save_for_backward(maps, seeds, points, indices)
        return points

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_points: Tensor) -> tuple[Tensor | None, ...]:
        maps, seeds, points, indices = ctx.saved_tensors
        grad = torch.from_numpy(kernels.backward(maps.numpy(), seeds.numpy(), points.numpy(), indices.numpy(),
                                                        grad_points.contiguous().numpy()))
        return grad[..., :4].unflatten(-1, (2, 2)), grad[..., 4:], None, None, None, None, None
