"""The part of the canvas that a picture shows. What lies beyond is unknown, not empty."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import torch
from torch import Tensor

from ..ifs.canvas import canvas_to_pixel

ROUNDING = 1e-6   # canvas units


@dataclass(frozen=True)
class Known:
    """A box of the canvas [-1,1]², in canvas units, y up. A side at the edge of the canvas is open: whatever lies
    beyond that edge is known to be empty, as beside any shape that a picture shows whole."""

    left: float
    bottom: float
    right: float
    top: float

    @cache  # noqa: B019 (a box is four numbers, and a search asks for its few masks all the time)
    def mask(self, resolution: int) -> Tensor:
        """The pixels (R,R) that lie in the box with all that they cover, bool. Not to be changed."""
        edges = 2 * torch.arange(resolution + 1, dtype=torch.float64) / resolution - 1
        low, high = edges[:-1] + ROUNDING, edges[1:] - ROUNDING
        return ((low >= self.bottom) & (high <= self.top)).flip(0)[:, None] & (low >= self.left) & (high <= self.right)

    def holds(self, points: Tensor, resolution: int) -> Tensor:
        """Whether points (P,2), also off the canvas, lie in pixels of `mask`, (P,)."""
        row, column = canvas_to_pixel(points, resolution).long().clamp(0, resolution - 1).unbind(1)
        return self.mask(resolution).to(points.device)[row, column]
