"""The CUDA backend of the occupancy: the chaos game's kernel, and torch for what is done with its points."""

from __future__ import annotations

import torch
from torch import Tensor

from ..chaos import cuda as chaos
from . import Game, reference


def occupancy(linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, game: Game, resolution: int) -> Tensor:
    """See `reference.occupancy`. Codes are drawn a few at a time, as the points of all of them take much memory."""
    images = [reference.occupancy(*part, game, resolution, chaos.chaos_game) for part in zip(
        *(tensor.split(64) for tensor in (linear, offset, thresholds.contiguous(), seeds)), strict=True)]
    return torch.cat(images)
