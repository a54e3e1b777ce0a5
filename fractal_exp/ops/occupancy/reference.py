"""The torch twin of the occupancy: the specification, for any device, float32 or float64."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ..chaos import reference as chaos

if TYPE_CHECKING:
    from . import Game


def occupancy(linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, game: Game, resolution: int,
              play: Callable[..., Tensor] = chaos.chaos_game) -> Tensor:
    """(B,N,2,2), (B,N,2), (B,N) int64, (B,) int64 -> (B,R,R) uint8. play: who plays the chaos game."""
    points = play(linear, offset, thresholds, seeds, trajectories=game.trajectories, length=game.length,
                  warmup=game.warmup)
    if game.frame:
        points = framed(points, game.frame)
    return marked(points, resolution)


def framed(points: Tensor, frame: float) -> Tensor:
    """The points (B,P,2) with their box centred on the canvas and its longer side brought to `frame`."""
    from . import LEAST_SIDE

    low, high = points.amin(1, keepdim=True), points.amax(1, keepdim=True)
    side = (high - low).amax(-1, keepdim=True).clamp_min(LEAST_SIDE)
    return (points - (low + high) / 2) * (frame / side)


def marked(points: Tensor, resolution: int) -> Tensor:
    """Pixels (B,R,R) uint8 that hold one of the points (B,P,2)."""
    column = ((points[..., 0] + 1) * (resolution / 2)).floor()
    row = ((1 - points[..., 1]) * (resolution / 2)).floor()
    inside = (column >= 0) & (column < resolution) & (row >= 0) & (row < resolution)
    place = torch.where(inside, row * resolution + column, resolution * resolution).long()
    canvas = torch.zeros(len(points), resolution * resolution + 1, dtype=torch.uint8, device=points.device)
    return canvas.scatter_(1, place, 1)[:, :-1].reshape(-1, resolution, resolution)
