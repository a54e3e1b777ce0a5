"""An image that was enlarged, as a reconstruction that can be looked at from closer by, up to a limit."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from ...errors import InputError
from ...ifs.code import View
from ...rendering.still import check_resolution
from ..base import Reconstruction


@dataclass(frozen=True)
class Enlarged(Reconstruction):
    """An image (fR,fR) in [0,1] of the whole canvas, `largest_zoom` times as fine as the input.

    A view is the mean of the image over each of its pixels; off the canvas all is black.
    """

    image: Tensor
    largest_zoom: float

    def render(self, view: View, *, resolution: int, points_in_view: int | None = None, supersample: int = 8,
               seed: int = 0) -> Tensor:
        """The grey image (R,R) in [0,1] of a view. points_in_view, supersample and seed make no difference: there are
        no points. Raises `InputError` on a zoom above `largest_zoom`: there is nothing finer to see."""
        check_resolution(resolution)
        if view.zoom > self.largest_zoom:
            raise InputError(f"super-resolution shows the image at most {self.largest_zoom:g}x enlarged, and the view "
                             f"has zoom {view.zoom:g}; only a code can be drawn from closer by")
        low_x, low_y, high_x, high_y = view.box
        columns = _edges(low_x, high_x, resolution, len(self.image))
        rows = _edges(-high_y, -low_y, resolution, len(self.image))
        return _means(_means(self.image, rows).T, columns).T.clamp(0, 1).float()


def _edges(low: float, high: float, count: int, side: int) -> Tensor:
    """The edges (R+1,) of a view's pixels, in pixels of an image whose canvas is [-1,1]."""
    return (torch.linspace(low, high, count + 1, dtype=torch.float64) + 1) * (side / 2)


def _means(image: Tensor, edges: Tensor) -> Tensor:
    """(R,W), the means of the rows of an image (H,W) between edges (R+1,), rows of 0 beyond it."""
    first, last = max(0, math.floor(float(edges[0]))), min(len(image), math.ceil(float(edges[-1])))
    if first >= last:
        return torch.zeros(len(edges) - 1, image.shape[1], dtype=torch.float64)
    total = torch.nn.functional.pad(image[first:last].double().cumsum(0), (0, 0, 1, 0))
    place = (edges - first).clamp(0, last - first)
    below = place.floor().long().clamp(max=last - first - 1)
    share = (place - below)[:, None]
    return (total[below] * (1 - share) + total[below + 1] * share).diff(dim=0) / (edges[1] - edges[0])
