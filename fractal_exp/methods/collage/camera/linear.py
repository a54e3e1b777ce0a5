"""Grey levels proportional to the density of points: counts of a chaos game, blurred or not."""

from __future__ import annotations

import math
from typing import Self

import torch
from torch import Tensor

from ....ifs.code import IFS
from .. import maps as affine
from ..bins import attractor_points
from ..params.camera import CameraParams
from .blur import blurred, deblurred
from .levels import ANSCOMBE, Levels, mean_of

BOX = 1 / 12     # variance, pixels², of a point's position within its pixel


class Linear(Levels):
    """The number of points in a pixel, up to an unknown factor, under a Gaussian blur of known width. No grey level
    saturates, so the image is its own measure.

    brightness: mean grey level of every rendering, whatever the number of points on the canvas; side: pixels per side
    of the image for which the camera gives blur and points; None: of each rendering.
    """

    is_density = True
    is_linear = True

    def __init__(self, camera: CameraParams, brightness: float, side: int | None = None):
        super().__init__(camera)
        self.brightness, self.side = brightness, side

    @classmethod
    def of(cls, image: Tensor, camera: CameraParams) -> Self:
        return cls(camera, float(image.mean()), image.shape[0])

    def blur_px(self, resolution: int) -> float:
        """The blur, in pixels of an image of this resolution."""
        return (self.camera.blur_px or 0.0) * resolution / (self.side or resolution)

    def points(self, resolution: int) -> float:
        """Number of chaos game points in an image of this resolution: as many as in the given image."""
        return self.camera.points_per_pixel * (self.side or resolution) ** 2

    def measure(self, image: Tensor) -> Tensor:
        """The image itself, sharpened."""
        return deblurred(image, self.blur_px(image.shape[0]), self.camera)

    def unlit(self, grey: Tensor, around: Tensor) -> Tensor:
        return torch.ones_like(grey)

    def shrunk(self, image: Tensor, size: int) -> Tensor:
        return mean_of(image, size)

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        """The image (R,R) of a code, from at least as many points as the given image has."""
        points = max(self.points(resolution), self.camera.linear_points * resolution**2)
        return self._drawn(code, resolution, seed, points)

    def noisy(self, code: IFS, resolution: int, seed: int) -> Tensor:
        return self._drawn(code, resolution, seed, self.points(resolution))

    def subpixels(self, resolution: int, side: int) -> float:
        """Points that make a cell white, if the image has `side` cells per side. A blurred count has less noise, like a
        count over the area that the blur covers."""
        area = max(1.0, 4 * math.pi * (self.blur_px(side) ** 2 + BOX))
        return area * self.points(resolution) / side**2 / self.brightness

    def stabilized(self, image: Tensor, subpixels: float) -> Tensor:
        """The square root (Anscombe 1948). Its variance is 1 / 4n if white stands for n points."""
        return (image + ANSCOMBE / subpixels).clamp_min(0).sqrt()

    def stabilizing_slope(self, image: Tensor, subpixels: float) -> Tensor:
        return 0.5 * (image + ANSCOMBE / subpixels).rsqrt()

    def exposure(self, counts: Tensor) -> Tensor:
        """The factor that gives blurred counts (R,R) the brightness of the image."""
        return self.brightness / counts.mean().clamp_min(1e-12)

    def _drawn(self, code: IFS, resolution: int, seed: int, count: float) -> Tensor:
        """The image of a code from `count` points. If the blur is narrow, the image is drawn with smaller pixels and
        then averaged, like an image that was shrunk."""
        camera, blur_px, side = self.camera, self.blur_px(resolution), resolution
        if camera.least_blur_px < blur_px < camera.coarse_blur_px:
            side *= math.ceil(camera.coarse_blur_px / blur_px)
        counts = blurred(self._counted(code, side, seed, count), self.blur_px(resolution) * side / resolution, camera)
        counts = counts if side == resolution else mean_of(counts, resolution)
        return counts * self.exposure(counts)

    def _counted(self, code: IFS, resolution: int, seed: int, count: float) -> Tensor:
        points = attractor_points(affine.from_code(code), code.sampling_probabilities(), max(1, round(count)), seed,
                                  self.camera)
        column, row = ((points * points.new_tensor([1, -1]) + 1) * (resolution / 2)).floor().long().unbind(1)
        inside = (column >= 0) & (column < resolution) & (row >= 0) & (row < resolution)
        counts = torch.bincount((row * resolution + column)[inside], minlength=resolution**2)
        return counts.view(resolution, resolution).to(points.dtype)
