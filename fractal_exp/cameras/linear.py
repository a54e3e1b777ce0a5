"""Grey levels proportional to the density of points: counts of a chaos game, blurred or not."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..ifs.code import IFS
from .blur import LEAST_BLUR_PX, blurred, deblurred
from .camera import Camera
from .levels import ANSCOMBE, Levels, mean_of
from .params import CameraParams
from .points import counted

BOX = 1 / 12     # variance, pixels², of a point's position within its pixel
LEAST_POINTS = 12.0     # per pixel, in a rendering that judges a code: less noise than most images have
COARSE_BLUR_PX = 1.0    # a narrower blur is drawn on smaller pixels, in which it is at least as wide


class Linear(Levels):
    """The number of points in a pixel, up to an unknown factor, under a Gaussian blur of known width. No grey level
    saturates, so the image is its own measure.

    brightness: mean grey level of every rendering, whatever the number of points on the canvas. The camera gives blur
    and points for the image that the levels were read from; without one, for each rendering.
    """

    kind = "linear"
    values = ("blur",)
    is_density = True
    is_linear = True

    def __init__(self, params: CameraParams, image: Tensor | None = None, camera: Camera | None = None,
                 kinds: tuple[str, ...] = (), *, brightness: float | None = None):
        if camera is None and image is not None and params.blur_px is not None:
            camera = Camera(self.kind, blur=params.blur_px * 2 / len(image))
        super().__init__(params, image, camera, kinds)
        self.brightness = float(self.picture.mean()) if brightness is None else brightness
        self.side = None if image is None else len(image)

    def blur_px(self, resolution: int) -> float:
        """The blur, in pixels of an image of this resolution."""
        if self.side is None:
            return self.params.blur_px or 0.0
        return (self.camera.blur or 0.0) * resolution / 2

    def points(self, resolution: int) -> float:
        """Number of chaos game points in an image of this resolution: as many as in the given image."""
        return self.params.points_per_pixel * (self.side or resolution) ** 2

    def whole_mass(self, resolution: int) -> float | None:
        return self.brightness * resolution**2

    def measure(self, image: Tensor) -> Tensor:
        """The image itself, sharpened."""
        return deblurred(image, self.blur_px(image.shape[0]))

    def unlit(self, grey: Tensor, around: Tensor) -> Tensor:
        return torch.ones_like(grey)

    def shrunk(self, image: Tensor, size: int) -> Tensor:
        return mean_of(image, size)

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        """The image (R,R) of a code, from at least as many points as the given image has."""
        points = max(self.points(resolution), LEAST_POINTS * resolution**2)
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
        blur_px, side = self.blur_px(resolution), resolution
        if LEAST_BLUR_PX < blur_px < COARSE_BLUR_PX:
            side *= math.ceil(COARSE_BLUR_PX / blur_px)
        counts = blurred(counted(code, side, count, seed), self.blur_px(resolution) * side / resolution)
        counts = counts if side == resolution else mean_of(counts, resolution)
        return counts * self.exposure(counts)
