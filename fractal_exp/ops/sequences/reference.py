"""The torch twins of `sequence` and `blob_error`: the specification, for any device, float32 or float64, by plain
autograd."""

from __future__ import annotations

import torch
from torch import Tensor

from ..chaos.reference import ESCAPE, _shift_right, initial_states, next_states


def sequence(linear: Tensor, offset: Tensor, start: Tensor, thresholds: Tensor, seed: int, sequences: int, length: int
             ) -> Tensor:
    """(N,2,2), (N,2), (2,), (N,) int64 -> points (sequences, length, 2)."""
    state = initial_states(torch.tensor([seed], device=linear.device), sequences)[0]
    for _ in range(2):  # with which a chaos game draws its start
        state = next_states(state)
    x, points, thresholds = start.expand(sequences, 2), [], thresholds.contiguous()
    for _ in range(length):
        state = next_states(state)
        index = torch.searchsorted(thresholds, _shift_right(state, 32), right=True)
        x = ((linear[index] @ x[..., None])[..., 0] + offset[index]).clamp(-ESCAPE, ESCAPE)
        points.append(x)
    return torch.stack(points, 1)


def blob_error(points: Tensor, image: Tensor) -> Tensor:
    """(B,P,2), (S,S) -> (B,). The Gaussian is separable: the sum over points is a matrix product."""
    pixels = torch.arange(len(image), dtype=points.dtype, device=points.device)
    rows = torch.exp(-(pixels - points[..., :1]) ** 2)     # (B,P,S)
    columns = torch.exp(-(pixels - points[..., 1:]) ** 2)
    drawn = (rows.mT @ columns).clamp(0, 1)
    return (drawn - image).square().mean((1, 2))
