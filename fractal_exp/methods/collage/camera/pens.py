"""Pictures that others drew, with a pen or dots of unknown width and grey levels of unknown gain.

The unknown values of the camera are estimated with a nearly right code, by trying all of them, and polished with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from ....ifs.code import IFS
from .blur import blurred
from .levels import Coverage, Density, may_be_density
from .tiles import tiled


class Drawn(Coverage):
    """Lines and areas: the share of a pixel that the drawing covers, blurred by a Gaussian. The drawing shows the
    attractor, drawn with a round pen, or a step of its construction, whose smallest parts are tiles of one shape
    (`tiles`). values, canvas units: tile size (0: the attractor), pen radius, and standard deviation of the blur."""

    is_exact = False
    lengths = "tile_px", "pen_px", "blur_px"

    @property
    def pen(self) -> float:
        return self.values[-2] if self.values else 0.0

    @property
    def shows_attractor(self) -> bool:
        return not (self.values and self.values[0])

    @property
    def open_values(self) -> list[int]:
        """Without the pen if tiles are drawn, which have none."""
        pen = len(self.numbers) + self.lengths.index("pen_px")
        has_tiles = "tile_px" in self.lengths and not self.shows_attractor
        return [k for k in super().open_values if not (has_tiles and k == pen)]

    def drawn(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """The tile size."""
        return values[:1]

    def smallest_part(self, code: IFS, resolution: int) -> float:
        return self.values[0] if self.values else 0.0

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        if not self.values:
            return super().render(code, resolution, seed, independent=independent)
        size, radius, sigma = self.values
        if size:
            drawn = tiled(self.picture, code, size, resolution, self.fine, camera=self.camera)
        else:
            distance = self._distance(code, resolution, seed, independent)
            drawn = inked(distance, radius * resolution / 2, self.fine)
        return blurred(drawn, sigma * resolution / 2, self.camera)

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[tuple[float, ...], Tensor]]:
        """Pairs of camera values and the rendering (R,R) of the code with them."""
        camera, pixel = self.camera, 2 / resolution
        blurs = given(camera.blur_px, camera.blurs_px)
        distance = self._distance(code, resolution, seed, False)
        for radius in given(camera.pen_px, camera.pens_px):
            drawn = inked(distance, radius, self.fine)
            yield from (((0.0, radius * pixel, sigma * pixel), blurred(drawn, sigma, camera)) for sigma in blurs)
        for size in camera.tiles_px if camera.pen_px is None else ():
            drawn = tiled(self.picture, code, size * pixel, resolution, self.fine, camera=camera)
            yield from (((size * pixel, 0.0, sigma * pixel), blurred(drawn, sigma, camera)) for sigma in blurs)

    @property
    def fine(self) -> int:
        """Subpixels per side of a pixel where the pen draws."""
        return self.camera.pen_supersample

    def _distance(self, code: IFS, resolution: int, seed: int, independent: bool) -> Tensor:
        """Distance (R·fine, R·fine) from each subpixel to the nearest one that the attractor lights, pixels."""
        return self.distance_to(self.occupied(code, resolution * self.fine, 1, self.points(resolution), seed,
                                              independent))

    def distance_to(self, lit: Tensor) -> Tensor:
        """Distance (R·fine, R·fine) from each subpixel to the nearest lit one, pixels."""
        from scipy.ndimage import distance_transform_edt

        if not bool(lit.any()):
            return torch.full_like(lit, torch.inf)
        return torch.from_numpy(np.asarray(distance_transform_edt(lit.numpy() == 0)) / self.fine).float()


class Dots(Density):
    """A scatter plot: each point is a dot of unknown width and opacity. Grey levels are I = 1 - exp(-gain · density),
    with the density relative to a uniform one on the canvas. values: the gain, and the standard deviation of a dot's
    Gaussian, canvas units."""

    is_exact = False
    numbers, lengths = ("gain",), ("blur_px",)

    @property
    def lit_above(self) -> float:
        is_faint = self.image is not None and may_be_density(self.image, self.camera)
        return self.camera.faint if is_faint else super().lit_above

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        if not self.values:
            return super().render(code, resolution, seed, independent=independent)
        gain, *curve, sigma = self.values
        density = blurred(self._density(code, resolution, seed, independent), sigma * resolution * self.fine / 2,
                          self.camera)
        grey = self._toned(density, gain)
        return curved(grey, *curve) if curve else grey

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[tuple[float, ...], Tensor]]:
        """Pairs of camera values and the rendering (R,R) of the code with them."""
        camera, pixel = self.camera, 2 / resolution
        density = self._density(code, resolution, seed, False)
        for sigma in given(camera.blur_px, self.blurs_px):
            spread = blurred(density, sigma * self.fine, camera)
            for gain in given(camera.gain, camera.gains):
                yield (gain, sigma * pixel), self._toned(spread, gain)

    @property
    def blurs_px(self) -> Sequence[float]:
        """Blurs that are tried, pixels."""
        return self.camera.blurs_px

    @property
    def fine(self) -> int:
        """Subpixels per side of a pixel where dots are blurred."""
        return self.camera.dot_supersample

    def _density(self, code: IFS, resolution: int, seed: int, independent: bool) -> Tensor:
        return self.occupied(code, resolution * self.fine, 1, self.points(resolution), seed, independent, "density")

    def _toned(self, density: Tensor, gain: float) -> Tensor:
        return avg_pool2d((1 - (-gain * density).exp())[None], self.fine)[0]


class ToneMapped(Dots):
    """A density seen through a tone curve, as flame renderers and plots of logarithmic counts show it. Grey levels are
    I = (1 - exp(-gain · density))^(1 / gamma), which with both numbers free is close to a logarithm too. values: the
    gain, the gamma, and the standard deviation of the blur, canvas units."""

    numbers = ("gain", "gamma")

    @property
    def gamma(self) -> float:
        """The gamma that is known, or a usual one."""
        return self.values[1] if self.values else self.camera.gamma or self.camera.usual_gamma

    @property
    def blurs_px(self) -> Sequence[float]:
        return self.camera.curved_blurs_px

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        grey = super().render(code, resolution, seed, independent=independent)
        return grey if self.values else curved(grey, self.gamma)

    def measure(self, image: Tensor) -> Tensor:
        return super().measure(image.clamp_min(0) ** self.gamma)

    def shrunk(self, image: Tensor, size: int) -> Tensor:
        return curved(super().shrunk(image, size), self.gamma)

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[tuple[float, ...], Tensor]]:
        """The camera values whose rendering (R,R) has the histogram most like the image's, with this rendering. A map
        that is a little off hardly changes the histogram, but it moves light from pixel to pixel."""
        wanted, gammas = self._levels_of(self.picture.cpu()), given(self.camera.gamma, self.camera.gammas)
        found, least = [], math.inf
        for (gain, sigma), grey in super().candidates(code, resolution, seed):
            levels = self._levels_of(grey)
            for gamma in gammas:
                off = float((curved(levels, gamma).sqrt().asin() - wanted.sqrt().asin()).square().sum())
                if off < least:
                    found, least = [((gain, gamma, sigma), curved(grey, gamma))], off
        yield from found

    def _levels_of(self, image: Tensor) -> Tensor:
        """`histogram_levels` grey levels of an image, the lowest first, with equally many pixels between them."""
        levels = image.flatten().sort().values
        return levels[torch.linspace(0, len(levels) - 1, self.camera.histogram_levels).long()].clamp(0, 1)


def inked(distance: Tensor, radius: float, fine: int) -> Tensor:
    """The share (R,R) of each pixel within a radius, from distances (R·fine, R·fine); both in pixels."""
    return avg_pool2d(((radius - distance) * fine + 0.5).clamp(0, 1)[None], fine)[0]


def curved(grey: Tensor, gamma: float) -> Tensor:
    """Grey levels in [0,1] after a display with this gamma."""
    return grey.clamp_min(0) ** (1 / gamma)


def given(value: float | None, others: Sequence[float]) -> Sequence[float]:
    """The camera value that the user gave, or else those to try."""
    return others if value is None else (value,)
