"""What the grey levels of an image mean, and how such an image is rendered from a code."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import Self

from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, max_pool2d

from ....ifs.code import IFS
from ....ops import cuda_launch
from ..params.camera import CameraParams

ANSCOMBE = 3 / 8   # added to a count before its square root, so that the variance is the same everywhere (1948)


class Levels(ABC):
    """Grey levels are shares of `supersample`² subpixels of each pixel. is_graded: whether a pixel can show a line
    thinner than itself; is_density: whether a grey level depends on how often the pixel is hit; is_linear: whether it
    is proportional to that, so that grey levels determine the probabilities of the maps. is_whole: whether an image
    shows the whole attractor. is_exact: whether an image differs from a rendering of its true code only by chance; if
    not, `values` holds the estimated values of the camera (empty before the estimate). image: the picture (R,R).
    numbers, lengths: the names of the values, first those without a unit."""

    is_graded = True
    is_density = False
    is_linear = False
    is_exact = True
    is_whole = True
    lengths: tuple[str, ...] = ()
    numbers: tuple[str, ...] = ()
    supersample: int

    def __init__(self, camera: CameraParams, image: Tensor | None = None, values: tuple[float, ...] = ()):
        self.camera, self.image, self.values, self.supersample = camera, image, values, camera.supersample

    @classmethod
    def of(cls, image: Tensor, camera: CameraParams) -> Self:
        """The levels of an image (R,R)."""
        return cls(camera, image)

    @abstractmethod
    def measure(self, image: Tensor) -> Tensor:
        """The masses (R,R) of the pixels of an image (R,R), up to a factor."""

    @abstractmethod
    def unlit(self, grey: Tensor, around: Tensor) -> Tensor:
        """The share of a pixel that more mass can still light up, from its grey level and the level around it."""

    @abstractmethod
    def shrunk(self, image: Tensor, size: int) -> Tensor:
        """The image (S,S) as it would have been rendered at this size if the shape were smooth."""

    @property
    def picture(self) -> Tensor:
        """`image`, where levels were taken from one."""
        assert self.image is not None
        return self.image

    @property
    def lit_above(self) -> float:
        """The grey level above which a pixel belongs to the shape."""
        return self.camera.threshold

    @property
    def pen(self) -> float:
        """The radius of the pen, canvas units."""
        return 0.0

    def smallest_part(self, code: IFS, resolution: int) -> float:
        """The size, canvas units, of the smallest parts of a construction that ended early; 0 if the attractor itself
        is drawn."""
        return 0.0

    @property
    def open_values(self) -> list[int]:
        """The indices of the values that the user left to be estimated and that may change by any small amount."""
        names = (*self.numbers, *self.lengths)[:len(self.values)]
        return [k for k, name in enumerate(names) if getattr(self.camera, name, self) is None]

    def adjusted(self, steps: Mapping[int, float]) -> Self:
        """The same levels with changed values, by index. A step is added to a length, canvas units, which stays
        positive or 0; of any other value it is added to the logarithm."""
        values = [max(0.0, value + steps.get(k, 0.0)) if k >= len(self.numbers) else value * math.exp(steps.get(k, 0.0))
                  for k, value in enumerate(self.values)]
        return type(self)(self.camera, self.image, tuple(values))

    @property
    def shows_attractor(self) -> bool:
        """Whether the image shows the attractor itself, rather than a step of its construction."""
        return True

    def drawn(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """The camera values that define what is drawn of a code, without those that define how."""
        return ()

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[tuple[float, ...], Tensor]]:
        """Pairs of camera values and the rendering (R,R) of the code with them; none if nothing is estimated."""
        return iter(())

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        """The image (R,R) of a code. independent: use each point only once, which takes twice as long."""
        return self.occupied(code, resolution, self.supersample, self.points(resolution), seed, independent)

    def points(self, resolution: int) -> int:
        """Number of chaos game points for an image of this resolution."""
        return round(self.camera.points_per_pixel * resolution**2)

    def occupied(self, code: IFS, resolution: int, supersample: int, points: int, seed: int, independent: bool,
                 mode: str = "occupancy") -> Tensor:
        """What `render` draws of a code, (R,R)."""
        from ....rendering.still import render_with_info  # does not warn: candidates may lie off the canvas

        device = "cuda" if code.linear.is_cuda and cuda_launch.INSTALLED else "cpu"
        image, _ = render_with_info(code.to("cpu"), resolution=resolution, supersample=supersample, seed=seed,
                                    points_in_view=points, reuse=1 if independent else self.camera.reuse, mode=mode,
                                    device=device)
        return image

    def noisy(self, code: IFS, resolution: int, seed: int) -> Tensor:
        """The image (R,R) of a code, with as much noise as the given image."""
        return self.render(code, resolution, seed)

    def subpixels(self, resolution: int, side: int) -> float:
        """n in `stabilized` for a cell, if an image of this resolution has `side` cells per side."""
        return (self.supersample * resolution / side) ** 2

    def stabilized(self, image: Tensor, subpixels: float) -> Tensor:
        """Grey levels (…) transformed to a counting error of variance 1 / 4n everywhere, for n subpixels."""
        return stabilize(image, subpixels)

    def stabilizing_slope(self, image: Tensor, subpixels: float) -> Tensor:
        """The derivative of `stabilized`."""
        share = anscombe(image, subpixels)
        return 0.5 * (share * (1 - share)).clamp_min(self.camera.least_variance).rsqrt()


class Density(Levels):
    """The share of subpixels that points of a chaos game hit."""

    is_density = True

    def measure(self, image: Tensor) -> Tensor:
        """-log(1 - I): the expected number of points in a subpixel that is hit with probability I."""
        return -(1 - image.clamp(max=1 - self.camera.unlit / self.supersample**2)).log()

    def unlit(self, grey: Tensor, around: Tensor) -> Tensor:
        return 1 - grey

    def shrunk(self, image: Tensor, size: int) -> Tensor:
        return 1 - (-mean_of(self.measure(image), size)).exp()


class Coverage(Levels):
    """The share of a pixel that the shape covers, as in an anti-aliased image. Subpixels are so large that points fill
    them."""

    def __init__(self, camera: CameraParams, image: Tensor | None = None, values: tuple[float, ...] = ()):
        super().__init__(camera, image, values)
        self.supersample = camera.coverage_supersample

    def measure(self, image: Tensor) -> Tensor:
        return image.clone()

    def unlit(self, grey: Tensor, around: Tensor) -> Tensor:
        return 1 - around

    def shrunk(self, image: Tensor, size: int) -> Tensor:
        return mean_of(image, size)


class Binary(Levels):
    """White where the shape covers enough of a pixel."""

    is_graded = False

    def measure(self, image: Tensor) -> Tensor:
        return image.clone()

    def unlit(self, grey: Tensor, around: Tensor) -> Tensor:
        return 1 - around

    def shrunk(self, image: Tensor, size: int) -> Tensor:
        covered, least = mean_of(image, size), self.camera.threshold
        return (covered > (least if bool((covered > least).any()) else 0)).float()

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = True) -> Tensor:
        # points are always independent: if a whole image were a little brighter, many pixels would turn white together
        return (super().render(code, resolution, seed, independent=True) > self.camera.threshold).float()


def may_be_density(image: Tensor, camera: CameraParams) -> bool:
    """Whether an image (R,R) is mostly grey even where all neighbours are lit, unlike most drawings."""
    lit = image > camera.faint
    inside = -max_pool2d(-lit.float()[None], 3, 1, 1)[0] > 0
    grey = inside & (image < 1 - camera.faint)
    return bool(grey.sum() > camera.grey_inside * lit.sum())


def mean_of(image: Tensor, size: int) -> Tensor:
    """The image (R,R) at a smaller size (S,S). Each pixel is the mean of those that it covers."""
    return adaptive_avg_pool2d(image[None], size)[0]


def stabilize(image: Tensor, subpixels: float) -> Tensor:
    """arcsin sqrt of grey levels that are shares of this many subpixels (Anscombe 1948)."""
    return anscombe(image, subpixels).sqrt().asin()


def anscombe(image: Tensor, subpixels: float) -> Tensor:
    """Grey levels that are shares of this many subpixels, as shares that are never 0 or 1 (Anscombe 1948)."""
    return ((image * subpixels + ANSCOMBE) / (subpixels + 2 * ANSCOMBE)).clamp(0, 1)
