"""The shape of a picture in black and white, and the likeness of a drawing to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, max_pool2d

from ....evaluation import metrics
from ....ifs.canvas import pixel_to_canvas
from ..bins import lit_pixels

SIDE = 256   # maximum side, pixels, of the picture that is covered; a larger one is shrunk


@dataclass(frozen=True)
class Silhouette:
    """A shape: its pixels `mask` (R,R) bool."""

    mask: Tensor

    @classmethod
    def of(cls, image: Tensor) -> Silhouette:
        """The shape that an image (R,R) in [0,1] shows, on at most `SIDE` pixels a side."""
        image = image.cpu()
        return cls(lit_pixels(adaptive_avg_pool2d(image[None], SIDE)[0] if image.shape[0] > SIDE else image))

    @property
    def side(self) -> int:
        """R."""
        return self.mask.shape[0]

    @property
    def area(self) -> int:
        """Pixels of the shape."""
        return int(self.mask.sum())

    def points(self, count: int, generator: torch.Generator, mask: Tensor | None = None) -> Tensor:
        """Points (count,2) of the canvas, uniform on the shape, or on the pixels of a mask (R,R)."""
        pixels = (self.mask if mask is None else mask).nonzero()
        chosen = torch.randint(len(pixels), (count,), generator=generator)
        return pixel_to_canvas(pixels[chosen] + torch.rand(count, 2, generator=generator), self.side)

    def distances(self) -> Tensor:
        """Distance (R,R) of every pixel from the shape, in pixels."""
        from scipy.ndimage import distance_transform_edt

        return torch.from_numpy(np.asarray(distance_transform_edt(~self.mask.numpy()))).float()

    def likeness(self, drawing: Tensor) -> float:
        """The F1 within a pixel between the lit part of a drawing (R,R) and the shape."""
        return float(metrics.f1_1px(drawing.float()[None], self.mask.float()[None]))


def widened(mask: Tensor) -> Tensor:
    """A mask (R,R) and the eight neighbours of each of its pixels, as float32."""
    return max_pool2d(mask[None, None].float(), 3, 1, 1)[0, 0]
