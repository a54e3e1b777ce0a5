"""The CPU backend of the collage operations: autograd over the numba kernels, float32."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..chaos.cpu_kernels import guide_of
from . import cpu_kernels as kernels
from .reference import Descent, Settings, Target


def pushforward(maps: Tensor, weights: Tensor, samples: Tensor, size: int) -> Tensor:
    """See `reference.pushforward`."""
    pushed: Tensor = _Pushforward.apply(maps, weights, samples, size)  # pyright: ignore[reportAssignmentType]
    return pushed


class _Pushforward(torch.autograd.Function):
    """`pushforward` with gradients by maps, weights and the samples' masses."""

    @staticmethod
    def forward(ctx: Any, maps: Tensor, weights: Tensor, samples: Tensor, size: int) -> Tensor:
        ctx.save_for_backward(maps, weights, samples)
        bins = torch.zeros(len(maps), size * size)
        kernels.pushforward(*_arrays(maps, weights, samples.T), size, bins.numpy())
        return bins.view(-1, size, size)

    @staticmethod
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor, Tensor, Tensor | None, None]:
        maps, weights, samples = ctx.saved_tensors
        gradient = torch.zeros(*weights.shape, 7)
        by_mass = torch.zeros(len(maps), len(samples) if ctx.needs_input_grad[2] else 0)
        kernels.pull_all(*_arrays(maps, weights, samples.T), slope.shape[-1],
                         *_arrays(slope.flatten(1), gradient, by_mass))
        by_sample = torch.nn.functional.pad(by_mass.sum(0)[:, None], (2, 0)) if ctx.needs_input_grad[2] else None
        return gradient[..., :6], gradient[..., 6], by_sample, None


def descend(maps: Tensor, weights: Tensor, target: Target, backgrounds: Tensor, chosen: Tensor, how: Descent
            ) -> tuple[Tensor, Tensor, Tensor]:
    """See `reference.descend`."""
    moved, masses = (given.detach().clone(memory_format=torch.contiguous_format) for given in (maps, weights))
    errors = torch.empty(len(maps))
    samples, roots, mean, covariance, known = _arrays(target.samples.T, target.roots, target.mean, target.covariance,
                                                      target.known)
    target = target._replace(samples=samples, roots=roots, mean=mean, covariance=covariance, known=known)
    kernels.descend(*_arrays(moved, masses), target, *_arrays(backgrounds, chosen), Settings(**vars(how)),
                    errors.numpy())
    return moved, masses, errors


def orbit_bins(maps: Tensor, thresholds: Tensor, seed: int, size: int, trajectories: int, length: int, warmup: int
               ) -> Tensor:
    """See `collage.orbit_bins`; thresholds (N,) int64 are the cumulative probabilities in units of 2^-32."""
    bins = torch.zeros(len(maps), size * size)
    cumulative, blocks = thresholds.numpy(), -(-trajectories // kernels.ABREAST)
    letters = np.empty((blocks, length, kernels.ABREAST), np.uint16)
    starts = np.empty((blocks, 2, kernels.ABREAST), np.float32)
    kernels.draw_letters(cumulative, guide_of(cumulative[None])[0], np.int64(seed), letters, starts)
    kernels.orbit_bins(*_arrays(maps), letters, starts, trajectories, warmup, size, bins.numpy())
    return bins.view(-1, size, size)


def _arrays(*tensors: Tensor) -> list[np.ndarray]:
    return [tensor.detach().contiguous().numpy() for tensor in tensors]
