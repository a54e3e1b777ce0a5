"""The objective of stage 3: each code is rendered as the image was, and both are compared pixel by pixel."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, avg_pool2d

from ....evaluation import metrics
from ....ifs import attractor
from ....ifs.code import IFS
from ....runtime.seeds import derive
from .. import maps as affine
from ..camera.levels import Levels, stabilize
from ..params import CollageParams
from .frame import Frame

GRIDS = 4             # compared, each half as fine as the one before
HALVED_FROM = 8       # minimum number of cells per side of a grid for a coarser one to follow
LEAST_NOISE = 1e-3    # lower limit of the estimated noise of a rendering
NOISE_RENDERINGS = 4  # that estimate the noise of a linear image, which has few independent parts under a blur


@dataclass(frozen=True)
class Rendered(affine.WeightedMaps):
    """A code with its rendering (R,R), the rendering's error (see `ImageObjective`), and the levels that it was
    rendered with."""

    image: Tensor
    error: float
    levels: Levels


class ImageObjective:
    """The target image (R,R) in [0,1], and the error of renderings against it.

    If a share I of n subpixels of a pixel is lit, the counting error of I depends on I. But arcsin(sqrt(I)) has
    variance 1/4n for every I (Anscombe 1948), so faint tips count for what they are worth. The error is the mean over
    grids of sum 2n (arcsin sqrt I - arcsin sqrt J)² / (lit cells of the target), with the n of the finest grid
    throughout. It is about 0.1 for two renderings of one code, and 0.3 for pixels that only share their brightness. The
    mean of several renderings has less noise. frame: the frame that the attractor must fill, if any (`within`); the
    misfit adds to the error.
    """

    frame: Frame | None = None

    def __init__(self, image: Tensor, levels: Levels, params: CollageParams, seed: int = 0, renderings: int = 1):
        self.image, self.levels, self.params = image, levels, params
        self.seed, self.renderings = derive(seed, "picture"), renderings
        self.side = min(image.shape[0], params.image.finest)
        self.subpixels = levels.subpixels(image.shape[0], self.side)
        self.stable = self.stabilized(image)
        self.lit = [max(1, int((grid > 0).sum())) for grid in self.grids(image)]

    def within(self, frame: Frame | None) -> ImageObjective:
        """The same objective with this frame."""
        other = copy.copy(self)
        other.frame = frame
        return other

    def seen_with(self, levels: Levels) -> ImageObjective:
        """The same objective with other levels that have the same number of subpixels."""
        other = copy.copy(self)
        other.levels = levels
        return other

    def own_frame(self) -> Frame | None:
        """The frame that the image fills, or None."""
        return Frame.of(self.image, self.levels, self.params.frame)

    def firm_frame(self) -> Frame | None:
        """The frame for firm polishes, or None."""
        return Frame.firm_of(self.image, self.levels, self.params.frame)

    def hasty(self) -> ImageObjective:
        """The same objective with a single rendering of each code."""
        other = copy.copy(self)
        other.renderings = 1
        return other

    def grids(self, image: Tensor) -> list[Tensor]:
        """The image (R,R) on grids with `side` and fewer cells per side."""
        image = adaptive_avg_pool2d(image[None], self.side)[0] if image.shape[0] > self.side else image
        grids = [image]
        while len(grids) < GRIDS and grids[-1].shape[0] >= HALVED_FROM:
            grids.append(avg_pool2d(grids[-1][None], 2, ceil_mode=True)[0])
        return grids

    def stabilized(self, image: Tensor) -> list[Tensor]:
        """The grids of an image, transformed to variance 1 / 4n everywhere."""
        return [self.levels.stabilized(grid, self.subpixels * 4**k) for k, grid in enumerate(self.grids(image))]

    def residuals(self, rendering: Tensor) -> list[Tensor]:
        """Target minus rendering (R,R) on every grid, after the transform to equal variance."""
        return [a - b for a, b in zip(self.stable, self.stabilized(rendering), strict=True)]

    def render(self, code: IFS, *path: int | str) -> Tensor:
        """The code rendered as the target was, (R,R). The same path of a random stream gives the same points."""
        resolution = self.image.shape[0]
        once = {"independent": True} if self.renderings > 1 else {}  # a percent of the error matters then
        images = [self.levels.render(code, resolution, derive(self.seed, *path, *([n] if n else [])), **once)
                  for n in range(self.renderings)]
        return torch.stack(images).mean(0).to(self.image)

    def judge(self, maps: Tensor, weights: Tensor | None = None) -> Rendered:
        """The code of these maps, rendered and compared."""
        image = self.render(affine.to_code(maps, weights))
        rendered = Rendered(maps, weights, image, self.error(image), self.levels)
        if self.frame is None:
            return rendered
        misses, _ = self.frame.penalty(self.frame.misfit(maps, rendered.probabilities))
        return replace(rendered, error=rendered.error + misses / (self.lit[0] * len(self.lit)))

    def without(self, rendered: Rendered, gone: list[int]) -> Rendered:
        """The code without some of its maps."""
        keep = [i for i in range(len(rendered.maps)) if i not in gone]
        return self.judge(rendered.maps[keep], None if rendered.weights is None else rendered.probabilities[keep])

    def error(self, rendering: Tensor) -> float:
        """The error of a rendering (R,R); lower is better."""
        sums = torch.stack([residual.square().sum() for residual in self.residuals(rendering)]).tolist()
        parts = [each / n for each, n in zip(sums, self.lit, strict=True)]
        return 2 * self.subpixels * sum(parts) / len(parts)

    def framed_error(self, rendered: Rendered) -> float:
        """The geometric mean of two errors of a binary image's code: that of its rendering, and that of the code scaled
        to fill the frame exactly. The image does not show the faint tips that decide an attractor's box, so a code may
        draw it well in a wrong frame. For images without a firm frame, the error of the rendering."""
        if self.firm_frame() is None:
            return rendered.error
        fitting = self.render(attractor.normalize(rendered.code))
        return (self.error(rendered.image) * self.error(fitting)) ** 0.5

    def angle(self, error: float) -> float:
        """The root mean square of arcsin sqrt I - arcsin sqrt J, in radians, that corresponds to an error."""
        return (error / (2 * self.subpixels)) ** 0.5

    def error_at(self, angle: float) -> float:
        """The error that corresponds to an angle."""
        return 2 * self.subpixels * angle**2

    def noise(self, code: IFS) -> float:
        """The error that the true code would have by chance, estimated from renderings of this code."""
        if self.levels.is_linear:  # renderings have less noise than the image
            shown = self.render(code)
            drawn = (self.levels.noisy(code, len(shown), derive(self.seed, "again", n)).to(shown)
                     for n in range(NOISE_RENDERINGS))
            errors = [ImageObjective(each, self.levels, self.params).error(shown) for each in drawn]
            return max(LEAST_NOISE, sum(errors) / len(errors))
        other = ImageObjective(self.render(code, "again"), self.levels, self.params)
        return max(LEAST_NOISE, other.error(self.render(code)))

    def likeness(self, rendering: Tensor) -> float:
        """F1 within a pixel between a rendering (R,R) and the image, both thresholded at `Levels.lit_above`."""
        least = self.levels.lit_above
        masks = ((image > least).float()[None] for image in (rendering, self.image))
        return float(metrics.f1_1px(*masks))

    def is_hopeless(self, error: float) -> bool:
        """Whether a code with this error is so far from the image that the image may show no attractor. Expensive steps
        that help only near a true code are then skipped: roots of codes of many maps, the last polish, another round
        that continues from it.
        """
        return self.angle(error) >= self.params.stages.hopeless


def error_of(shown: Rendered) -> float:
    """Sort key: the error of a rendering."""
    return shown.error


def reduced(image: Tensor, size: int, code: IFS, levels: Levels, params: CollageParams, seed: int) -> Tensor:
    """The image (R,R) at a smaller size (S,S), as it would have been rendered.

    Where the shape is finer than a pixel, `levels.shrunk` errs by many times the noise of a rendering. A nearly right
    code, rendered at both sizes, shows by how much. This difference is subtracted from levels of equal variance.
    Without `ImageParams.reduced_renderings`, the image is only shrunk.
    """
    subpixels = levels.supersample**2
    shrunk = levels.shrunk(image, size)
    if levels.is_linear or not params.image.reduced_renderings:  # a mean of counts is exact
        return shrunk
    large = levels.shrunk(levels.render(code, image.shape[0], derive(seed, "large")).to(image), size)
    small = torch.stack([levels.render(code, size, derive(seed, "small", n)).to(image)
                         for n in range(params.image.reduced_renderings)]).mean(0)
    stable = stabilize(shrunk, subpixels) - stabilize(large, subpixels) + stabilize(small, subpixels)
    share = stable.clamp(0, torch.pi / 2).sin().square()
    found = ((share * (subpixels + 0.75) - 0.375) / subpixels).clamp(0, 1)
    return torch.where(shrunk > 0, found, 0)
