"""The torch twin of `point_counts`: the specification, for any device."""

from __future__ import annotations

import torch
from torch import Tensor


def point_counts(points: Tensor, side: int) -> Tensor:
    """points (P,2) -> counts (R,R) int64."""
    column, row = ((points * points.new_tensor([1, -1]) + 1) * (side / 2)).floor().unbind(1)
    inside = (column >= 0) & (column < side) & (row >= 0) & (row < side)
    pixel = row[inside].long() * side + column[inside].long()
    return torch.bincount(pixel, minlength=side**2).view(side, side)
