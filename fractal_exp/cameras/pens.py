"""Pictures that others drew, with a pen or dots of unknown width and grey levels of unknown gain.

The unknown values of their camera are estimated with a nearly right code, by trying all of them, and polished with it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt
from torch import Tensor
from torch.nn.functional import avg_pool2d

from ..ifs.code import IFS
from ..rendering.curve import Curve
from .blur import blurred
from .camera import Camera
from .grain import LARGEST, grain
from .levels import FAINT, Coverage, Density, may_be_density
from .points import counted
from .tiles import tiled

# Values that are tried where the user knows none. Lengths are in pixels of the image.
PENS_PX = 0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0
BLURS_PX = 0.0, 0.2, 0.35, 0.5, 0.7, 1.0
TILES_PX = 32.0, 22.0, 16.0, 11.0, 8.0, 5.6, 4.0
GAINS = tuple(0.01 * 2**(k / 2) for k in range(18))
GAMMAS = 1.5, 2.2, 3.0, 4.0, 6.0
CURVED_BLURS_PX = 0.0, 0.35, 0.7   # under a tone curve
CURVED_FROM = 2.0         # a tone curve is tried if the angle of dots is at most this factor times the pen's
USUAL_GAMMA = 2.2         # with which an image is searched before the estimate, as of sRGB
HISTOGRAM_LEVELS = 4096   # by which the histograms of image and rendering are compared
DOT_WINDOW_PX = 1.5       # standard deviation of the Gaussian over which dots are averaged before they are counted
LEAST_DOT = 0.05          # pixels², of a dot that is plotted, of which a picture needs few millions
PLOTTED_PX = 2            # side of the cells that tell its area: a plot is to look like the picture close up
PEN_SUPERSAMPLE = 3       # subpixels per side of a pixel where a pen draws
DOT_SUPERSAMPLE = 2       # and where dots are blurred


class Inked(Coverage):
    """Lines and areas: the share of a pixel that the drawing covers, blurred by a Gaussian. The drawing shows the
    attractor, drawn with a round pen, or a step of its construction, whose smallest parts are tiles of one shape
    (`tiles`). A tile size of 0 means the attractor."""

    is_exact = False
    values = "tile", "pen", "blur"

    @property
    def pen(self) -> float:
        return self.camera.pen or 0.0

    def whole_mass(self, resolution: int) -> float | None:
        return None

    @property
    def shows_attractor(self) -> bool:
        return not self.camera.tile

    @property
    def open_values(self) -> list[str]:
        """Without the pen if tiles are drawn, which have none."""
        return [name for name in super().open_values if not (self.camera.tile and name == "pen")]

    def what_is_drawn(self, camera: Camera) -> tuple[float | None, ...]:
        """The tile size."""
        return (camera.tile,)

    def smallest_part(self, code: IFS, resolution: int) -> float:
        return self.camera.tile or 0.0

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        camera = self.camera
        if not camera.is_known:
            return super().render(code, resolution, seed, independent=independent)
        if camera.tile:
            drawn = tiled(self.picture, code, camera.tile, resolution, PEN_SUPERSAMPLE)
        else:
            distance = self._distance(code, resolution, seed, independent)
            drawn = inked(distance, self.pen * resolution / 2)
        return blurred(drawn, (camera.blur or 0.0) * resolution / 2)

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[Camera, Tensor]]:
        """Pairs of a camera and the rendering (R,R) of the code with it."""
        params, pixel = self.params, 2 / resolution
        blurs = given(params.blur_px, BLURS_PX)
        distance = self._distance(code, resolution, seed, False)
        for radius in given(params.pen_px, PENS_PX):
            drawn, found = inked(distance, radius), Camera(self.kind, tile=0.0, pen=radius * pixel)
            yield from ((replace(found, blur=sigma * pixel), blurred(drawn, sigma)) for sigma in blurs)
        for size in TILES_PX if params.tiles and params.pen_px is None else ():
            drawn = tiled(self.picture, code, size * pixel, resolution, PEN_SUPERSAMPLE)
            found = Camera(self.kind, tile=size * pixel, pen=0.0)
            yield from ((replace(found, blur=sigma * pixel), blurred(drawn, sigma)) for sigma in blurs)

    def _distance(self, code: IFS, resolution: int, seed: int, independent: bool) -> Tensor:
        """Distance (3R,3R) from each subpixel to the nearest one that the attractor lights, pixels."""
        return distance_to(self.occupied(code, resolution * PEN_SUPERSAMPLE, 1, self.points(resolution), seed,
                                         independent))


class ExposedDensity(Density):
    """A density of unknown exposure. The share of ink in a pixel is 1 - exp(-gain · density), with the density relative
    to a uniform one on the canvas, and the tone curve makes grey levels of it. The blur is that of each point, the
    standard deviation of a Gaussian."""

    is_exact = False
    blurs_px: ClassVar[Sequence[float]] = BLURS_PX   # that are tried

    @property
    def lit_above(self) -> float:
        is_faint = self.image is not None and may_be_density(self.image)
        return FAINT if is_faint else super().lit_above

    def whole_mass(self, resolution: int) -> float | None:
        gain = self.params.gain or self.camera.gain
        return gain and gain * resolution**2

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        camera = self.camera
        if not camera.is_known:
            return self.curve.displayed(super().render(code, resolution, seed, independent=independent))
        sigma = (camera.blur or 0.0) * resolution * DOT_SUPERSAMPLE / 2
        ink = self.ink(blurred(self._density(code, resolution, seed, independent), sigma), camera.gain or 0.0)
        return self.curve.displayed(ink)

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[Camera, Tensor]]:
        """Pairs of a camera and the rendering (R,R) of the code with it."""
        return ((camera, self.curve.displayed(ink)) for camera, ink in self._inks(code, resolution, seed))

    def _inks(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[Camera, Tensor]]:
        """Pairs of a camera and the shares of ink (R,R) of the code with it."""
        params, pixel = self.params, 2 / resolution
        density = self._density(code, resolution, seed, False)
        for sigma in given(params.blur_px, self.blurs_px):
            spread = blurred(density, sigma * DOT_SUPERSAMPLE)
            for gain in given(params.gain, GAINS):
                yield Camera(self.kind, gain=gain, blur=sigma * pixel), self.ink(spread, gain)

    def _density(self, code: IFS, resolution: int, seed: int, independent: bool) -> Tensor:
        return self.occupied(code, resolution * DOT_SUPERSAMPLE, 1, self.points(resolution), seed, independent,
                             "density")

    def ink(self, density: Tensor, gain: float) -> Tensor:
        """The share of ink in [0,1] of pixels (R,R), from a density (2R,2R)."""
        return avg_pool2d(Curve().grey(gain * density)[None], DOT_SUPERSAMPLE)[0]


class Dots(ExposedDensity):
    """A scatter plot: each point is a dot of unknown width and opacity."""

    kind = "dots"
    is_grainy = True
    values = "gain", "blur"

    def measure(self, image: Tensor) -> Tensor:
        """The hits by the grey around each pixel, because a single dot may fill a pixel."""
        return self.hits(blurred(image, DOT_WINDOW_PX))

    def plotted(self, code: IFS, resolution: int, seed: int) -> Tensor:
        drawing = self.render(code, resolution, seed)
        if self.image is None or len(self.image) != resolution:
            return drawing
        shown = 1.0 if self.known is None else self.known.mask(resolution).to(drawing)
        area = min(max(grain(self.image.to(drawing) * shown, drawing * shown, PLOTTED_PX), LEAST_DOT), LARGEST)
        count = float(self.hits(drawing).sum()) / (1 - math.exp(-area))
        return self.curve.grey(area * counted(code, resolution, count, seed, self.camera.blur or 0.0))


class ToneMapped(ExposedDensity):
    """A density seen through a tone curve, as flame renderers and plots of logarithmic counts show it: grey levels are
    the root of the ink, I = (1 - exp(-gain · density))^(1 / gamma). With both numbers free, that is close to a
    logarithm too."""

    kind = "tonemapped"
    is_curved = True
    values = "gain", "gamma", "blur"
    blurs_px = CURVED_BLURS_PX

    @classmethod
    def is_worth_trying(cls, angles: Mapping[str, float]) -> bool:
        """Where dots do not explain an image much worse than pens and tiles."""
        return angles.get(Dots.kind, 0.0) <= CURVED_FROM * angles.get(Inked.kind, math.inf)

    @property
    def curve(self) -> Curve:
        """With the gamma that is known, or a usual one."""
        return Curve(self.camera.gamma or self.params.gamma or USUAL_GAMMA)

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[Camera, Tensor]]:
        """The camera whose rendering (R,R) has the histogram most like the image's, with this rendering. A map
        that is a little off hardly changes the histogram, but it moves light from pixel to pixel."""
        wanted, gammas = self._levels_of(self.picture.cpu()), given(self.params.gamma, GAMMAS)
        shown = 1.0 if self.known is None else self.known.mask(resolution).float()
        found, least = [], math.inf
        for camera, ink in self._inks(code, resolution, seed):
            levels = self._levels_of(ink * shown)
            for gamma in gammas:
                curve = Curve(gamma)
                off = float((curve.displayed(levels).sqrt().asin() - wanted.sqrt().asin()).square().sum())
                if off < least:
                    found, least = [(replace(camera, gamma=gamma), curve.displayed(ink))], off
        yield from found

    def _levels_of(self, image: Tensor) -> Tensor:
        """`HISTOGRAM_LEVELS` grey levels of an image, the lowest first, with equally many pixels between them."""
        levels = image.flatten().sort().values
        return levels[torch.linspace(0, len(levels) - 1, HISTOGRAM_LEVELS).long()].clamp(0, 1)


def distance_to(lit: Tensor) -> Tensor:
    """Distance (3R,3R) from each subpixel to the nearest lit one, pixels."""
    if not bool(lit.any()):
        return torch.full_like(lit, torch.inf)
    return torch.from_numpy(np.asarray(distance_transform_edt(lit.numpy() == 0)) / PEN_SUPERSAMPLE).float()


def inked(distance: Tensor, radius: float) -> Tensor:
    """The share (R,R) of each pixel within a radius, from distances (3R,3R); both in pixels."""
    return avg_pool2d(((radius - distance) * PEN_SUPERSAMPLE + 0.5).clamp(0, 1)[None], PEN_SUPERSAMPLE)[0]


def given(value: float | None, others: Sequence[float]) -> Sequence[float]:
    """The camera value that the user gave, or else those to try."""
    return others if value is None else (value,)
