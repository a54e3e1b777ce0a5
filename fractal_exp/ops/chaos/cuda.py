"""The CUDA backend of the chaos game: autograd over the numba-cuda kernels, float32, on torch's current stream.

Nothing waits for the device, so that a whole iteration can be recorded in a CUDA graph (after one run outside of it,
which compiles). No kernel adds with atomics: results and gradients repeat bit for bit on one kind of GPU.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from . import cuda_kernels as kernels


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
        points, path, indices = kernels.forward(maps, thresholds, seeds, trajectories, length, warmup)
        ctx.save_for_backward(maps, seeds, points, path, indices)
        return points

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, grad_points: Tensor) -> tuple[Tensor | None, ...]:
        grad = kernels.backward(*ctx.saved_tensors, grad_points.contiguous())
        return grad[..., :4].unflatten(-1, (2, 2)), grad[..., 4:], None, None, None, None, None
