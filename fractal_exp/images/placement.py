"""The position of a picture on the canvas, so that results on the canvas can be laid over the picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ..errors import InputError
from ..ifs.code import View


@dataclass(frozen=True)
class Placement:
    """The similarity between the pixels of a picture and the canvas [-1,1]².

    size: (width, height) of the upright picture in pixels. crop_box: (x0, y0, x1, y1), the square of the picture that
    fills the canvas, which may reach beyond the picture. Pixel coordinates run from the upper left corner, x to the
    right and y down; the upper left pixel has its centre at (0.5, 0.5). On the canvas y runs up.
    """

    size: tuple[int, int]
    crop_box: tuple[float, float, float, float]

    @property
    def side(self) -> float:
        """The side of the crop box in pixels: two units of the canvas."""
        return self.crop_box[2] - self.crop_box[0]

    def to_canvas(self, points: ArrayLike) -> np.ndarray:
        """Points (…,2) in pixels as points (…,2) of the canvas, float64. Raises `InputError` on another shape."""
        x0, y0, x1, y1 = self.crop_box
        return (_pairs(points) - [(x0 + x1) / 2, (y0 + y1) / 2]) * [2 / self.side, -2 / self.side]

    def to_pixels(self, points: ArrayLike) -> np.ndarray:
        """Points (…,2) of the canvas as points (…,2) in pixels, float64. Raises `InputError` on another shape."""
        x0, y0, x1, y1 = self.crop_box
        return _pairs(points) * [self.side / 2, -self.side / 2] + [(x0 + x1) / 2, (y0 + y1) / 2]

    def view(self) -> View:
        """The smallest square view that shares the picture's upper left corner and holds all of the picture.

        Rendered at a resolution of max(size), its pixels are the picture's pixels.
        """
        longer = max(self.size)
        x, y = self.to_canvas((longer / 2, longer / 2)).tolist()
        return View((x, y), self.side / longer)


def _pairs(points: ArrayLike) -> np.ndarray:
    try:
        pairs = np.asarray(points, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(f"points must be a regular array of numbers (…, 2): {error}") from error
    if pairs.shape[-1:] != (2,):
        raise InputError(f"points must have shape (…, 2), an x and a y each, got {pairs.shape}")
    return pairs
