"""What the grey levels of an image mean, and how such an image is rendered from a code."""

from __future__ import annotations

import copy
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from typing import ClassVar, Self

from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, max_pool2d

from ..evaluation.inside import LIT, shape_level
from ..ifs.code import IFS
from ..images.known import Known
from ..ops import cuda_launch
from ..rendering.curve import Curve
from .camera import KNOWN, LENGTHS, Camera
from .params import CameraParams

ANSCOMBE = 3 / 8   # added to a count before its square root, so that the variance is the same everywhere (1948)
THRESHOLD = 0.25   # share of lit subpixels above which a pixel of a binary image is white
COVERAGE_SUPERSAMPLE = 4   # subpixels per side of a pixel of an anti-aliased image: so large that points fill them
REUSE = 8          # words under which a rendering that judges a code draws each point of the invariant measure
UNLIT = 0.5        # least number of unlit subpixels in a pixel of a density: a white pixel would have infinite mass
LEAST_VARIANCE = 1e-4   # lower limit of I (1 - I) in the slope of the arcsine by which images are compared
FAINT = 0.05       # level up to which a pixel counts as black in an image that may be a density, or as close to white
DOT_CELL_PX = 4    # side of a cell that holds several dots of a scatter plot
GREY_INSIDE = 0.5  # share of grey among lit pixels, although all neighbours are lit, from which it may be a density


class Levels(ABC):
    """Grey levels are shares of `supersample`² subpixels of each pixel. is_graded: whether a pixel can show a line
    thinner than itself; is_density: whether a grey level depends on how often the pixel is hit; is_linear: whether it
    is proportional to that, so that grey levels determine the probabilities of the maps. is_whole: whether an image
    shows the whole attractor. is_exact: whether an image differs from a rendering of its true code only by chance; if
    not, `camera` holds the estimated values (none before the estimate). image: the picture (R,R). values: the names of
    those that a camera of this kind has, first those without a unit. kinds: of the cameras that the picture may have,
    where nobody said which; params: what the user knows of it. beside: the kind beside which this one is tried, as
    strokes beside coverage, if it is not tried for its own sake. is_curved: whether grey levels pass a tone curve. A
    search reads masses through such a curve from its start, or not at all. is_grainy: whether an image may show single
    dots, which have more noise than a rendering (`grain`). known: the part of the canvas that the
    picture shows, see `images.levels.TargetImage`."""

    kind: ClassVar[str]

    is_graded = True
    is_density = False
    is_linear = False
    is_exact = True
    is_whole = True
    is_curved = False
    is_grainy = False
    known: Known | None = None
    beside: ClassVar[str | None] = None
    values: ClassVar[tuple[str, ...]] = ()
    own_supersample: ClassVar[int | None] = None  # in the place of that of the parameters
    supersample: int

    def __init__(self, params: CameraParams, image: Tensor | None = None, camera: Camera | None = None,
                 kinds: tuple[str, ...] = ()):
        self.params, self.image, self.camera = params, image, camera or Camera(self.kind)
        self.kinds, self.supersample = kinds or (self.kind,), self.own_supersample or params.supersample

    def within(self, known: Known | None) -> Self:
        """The same levels of a picture that shows this part of the canvas."""
        other = copy.copy(self)
        other.known = known
        return other

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
        """The grey level above which a pixel belongs to the shape; half of the highest level of a faint image."""
        return LIT if self.image is None else shape_level(self.image)

    @property
    def curve(self) -> Curve:
        """The tone curve, by which grey levels follow masses."""
        return Curve(linear=self.is_linear)

    @property
    def pen(self) -> float:
        """The radius of the pen, canvas units."""
        return 0.0

    def smallest_part(self, code: IFS, resolution: int) -> float:
        """The size, canvas units, of the smallest parts of a construction that ended early; 0 if the attractor itself
        is drawn."""
        return 0.0

    @property
    def open_values(self) -> list[str]:
        """The values that the user left to be estimated and that may change by any small amount."""
        if not self.camera.is_known:
            return []
        return [name for name in self.values if name in KNOWN and self.params.known(name) is None]

    def adjusted(self, steps: Mapping[str, float]) -> Self:
        """The same levels with changed values of the camera, by name. A step is added to a length, canvas units, which
        stays positive or 0; of any other value it is added to the logarithm."""
        moved = {}
        for name, step in steps.items():
            value = getattr(self.camera, name)
            moved[name] = max(0.0, value + step) if name in LENGTHS else value * math.exp(step)
        return type(self)(self.params, self.image, self.camera.moved(moved), self.kinds).within(self.known)

    @property
    def shows_attractor(self) -> bool:
        """Whether the image shows the attractor itself, rather than a step of its construction."""
        return True

    @classmethod
    def is_worth_trying(cls, angles: Mapping[str, float]) -> bool:
        """Whether an image may be of this kind if others that were tried before have these angles of error, by name."""
        return True

    def what_is_drawn(self, camera: Camera) -> tuple[float | None, ...]:
        """The values of a camera that define what is drawn of a code, without those that define how."""
        return ()

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[Camera, Tensor]]:
        """Pairs of a camera and the rendering (R,R) of the code with it; none if nothing is estimated."""
        return iter(())

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        """The image (R,R) of a code. independent: use each point only once, which takes twice as long."""
        return self.occupied(code, resolution, self.supersample, self.points(resolution), seed, independent)

    def points(self, resolution: int) -> int:
        """Number of chaos game points for an image of this resolution."""
        return round(self.params.points_per_pixel * resolution**2)

    def whole_mass(self, resolution: int) -> float | None:
        """The sum of m over all pixels of an image of this resolution, if a pixel of mass m is expected to show
        1 - exp(-m), or m if levels are linear. None: any, because the exposure is not known."""
        return self.params.points_per_pixel * (resolution / self.supersample) ** 2

    def occupied(self, code: IFS, resolution: int, supersample: int, points: int, seed: int, independent: bool,
                 mode: str = "occupancy") -> Tensor:
        """What `render` draws of a code, (R,R)."""
        from ..rendering.still import render_with_info  # does not warn: candidates may lie off the canvas

        device = "cuda" if code.linear.is_cuda and cuda_launch.INSTALLED else "cpu"
        image, _ = render_with_info(code.to("cpu"), resolution=resolution, supersample=supersample, seed=seed,
                                    points_in_view=points, reuse=1 if independent else REUSE, mode=mode,
                                    device=device)
        return image

    def noisy(self, code: IFS, resolution: int, seed: int) -> Tensor:
        """The image (R,R) of a code, with as much noise as the given image."""
        return self.render(code, resolution, seed)

    def plotted(self, code: IFS, resolution: int, seed: int) -> Tensor:
        """The image (R,R) of a nearly right code, with as much noise as the given image: from as many dots, if it shows
        some."""
        return self.noisy(code, resolution, seed)

    def subpixels(self, resolution: int, side: int) -> float:
        """n in `stabilized` for a cell, if an image of this resolution has `side` cells per side."""
        return (self.supersample * resolution / side) ** 2

    def stabilized(self, image: Tensor, subpixels: float) -> Tensor:
        """Grey levels (…) transformed to a counting error of variance 1 / 4n everywhere, for n subpixels."""
        return stabilize(image, subpixels)

    def stabilizing_slope(self, image: Tensor, subpixels: float) -> Tensor:
        """The derivative of `stabilized`."""
        share = anscombe(image, subpixels)
        return 0.5 * (share * (1 - share)).clamp_min(LEAST_VARIANCE).rsqrt()


class Density(Levels):
    """The share of subpixels that points of a chaos game hit."""

    kind = "density"
    is_density = True

    def measure(self, image: Tensor) -> Tensor:
        return self.hits(image)

    def hits(self, image: Tensor) -> Tensor:
        """The expected number of points in a subpixel: -log(1 - I) if it is hit with probability I."""
        return self.curve.mass(image, 1 - UNLIT / self.supersample**2)

    def unlit(self, grey: Tensor, around: Tensor) -> Tensor:
        return 1 - grey

    def shrunk(self, image: Tensor, size: int) -> Tensor:
        return self.curve.grey(mean_of(self.hits(image), size))


class Coverage(Levels):
    """The share of a pixel that the shape covers, as in an anti-aliased image. Subpixels are so large that points fill
    them."""

    kind = "coverage"
    own_supersample = COVERAGE_SUPERSAMPLE

    def measure(self, image: Tensor) -> Tensor:
        return image.clone()

    def unlit(self, grey: Tensor, around: Tensor) -> Tensor:
        return 1 - around

    def shrunk(self, image: Tensor, size: int) -> Tensor:
        return mean_of(image, size)


class Binary(Levels):
    """White where the shape covers enough of a pixel."""

    kind = "binary"
    is_graded = False

    def measure(self, image: Tensor) -> Tensor:
        return image.clone()

    def unlit(self, grey: Tensor, around: Tensor) -> Tensor:
        return 1 - around

    def shrunk(self, image: Tensor, size: int) -> Tensor:
        covered, least = mean_of(image, size), THRESHOLD
        return (covered > (least if bool((covered > least).any()) else 0)).float()

    def whole_mass(self, resolution: int) -> float | None:
        """So that a pixel at the threshold shows half white."""
        mass = super().whole_mass(resolution)
        return mass and mass * math.log(0.5) / math.log(1 - THRESHOLD)

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = True) -> Tensor:
        # points are always independent: if a whole image were a little brighter, many pixels would turn white together
        return (super().render(code, resolution, seed, independent=True) > THRESHOLD).float()


def may_be_density(image: Tensor) -> bool:
    """Whether an image (R,R) is mostly grey even where all neighbours are lit, unlike most drawings."""
    lit = image > FAINT
    inside = -max_pool2d(-lit.float()[None], 3, 1, 1)[0] > 0
    grey = inside & (image < 1 - FAINT)
    return bool(grey.sum() > GREY_INSIDE * lit.sum())


def may_be_dots(image: Tensor) -> bool:
    """Whether an image (R,R) may be a scatter plot. A single dot may fill a pixel, so the plot can be white where its
    dots are many, but cells of a few pixels are grey."""
    return may_be_density(mean_of(image, max(1, len(image) // DOT_CELL_PX)))


def mean_of(image: Tensor, size: int) -> Tensor:
    """The image (R,R) at a smaller size (S,S). Each pixel is the mean of those that it covers."""
    return adaptive_avg_pool2d(image[None], size)[0]


def stabilize(image: Tensor, subpixels: float) -> Tensor:
    """arcsin sqrt of grey levels that are shares of this many subpixels (Anscombe 1948)."""
    return anscombe(image, subpixels).sqrt().asin()


def anscombe(image: Tensor, subpixels: float) -> Tensor:
    """Grey levels that are shares of this many subpixels, as shares that are never 0 or 1 (Anscombe 1948)."""
    return ((image * subpixels + ANSCOMBE) / (subpixels + 2 * ANSCOMBE)).clamp(0, 1)
