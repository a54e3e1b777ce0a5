"""A picture and renderings of codes, compared pixel by pixel at several scales."""

from __future__ import annotations

import copy
from typing import Any, Self

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, avg_pool2d

from ..evaluation import metrics
from ..ifs.code import IFS
from ..runtime.deadline import check_time
from ..runtime.seeds import derive
from .grain import noise_ratio_of_dots
from .levels import Levels

GRIDS = 4           # that are compared, each half as fine as the one before
FINEST = 512        # greatest number of cells per side of the finest grid: a larger rendering only has less noise
HALVED_FROM = 8     # cells per side from which on a coarser grid follows
WITHIN_NOISE = 1.2  # noise ratio below which a code cannot be told from the true one
LEAST_NOISE = 1e-3  # lower limit of the noise of a rendering
NOISE_RENDERINGS = 4   # that estimate the noise of a linear image, which has few independent parts under a blur


class Comparison:
    """The target image (R,R) in [0,1], and the error of renderings against it.

    If a share I of n subpixels of a pixel is lit, the counting error of I depends on I. But arcsin(sqrt(I)) has
    variance 1/4n for every I (Anscombe 1948), so faint tips count for what they are worth. The error is the mean over
    grids of sum 2n (arcsin sqrt I - arcsin sqrt J)² / (lit cells of the target), with the n of the finest grid
    throughout. It is about 0.1 for two renderings of one code, and 0.3 for pixels that only share their brightness. The
    mean of several renderings has less noise. Only pixels that the picture shows are compared (`Levels.known`).
    """

    def __init__(self, image: Tensor, levels: Levels, seed: int = 0, renderings: int = 1):
        self.image, self.levels = image, levels
        self.mask = None if levels.known is None else levels.known.mask(len(image)).to(image)
        self.seed, self.renderings = derive(seed, "picture"), renderings
        self.side = min(image.shape[0], FINEST)
        self.subpixels = levels.subpixels(image.shape[0], self.side)
        self.stable = self.stabilized(image)
        self.lit = [max(1, int((grid > 0).sum())) for grid in self.grids(image)]

    def seen_with(self, levels: Levels) -> Self:
        """The same comparison with other levels that have the same number of subpixels."""
        return self._changed(levels=levels)

    def hasty(self) -> Self:
        """The same comparison with a single rendering of each code."""
        return self._changed(renderings=1)

    def _changed(self, **values: Any) -> Self:
        other = copy.copy(self)
        vars(other).update(values)
        return other

    def grids(self, image: Tensor) -> list[Tensor]:
        """The image (R,R), as far as it is known, on grids with `side` and fewer cells per side."""
        image = self.masked(image)
        image = adaptive_avg_pool2d(image[None], self.side)[0] if image.shape[0] > self.side else image
        grids = [image]
        while len(grids) < GRIDS and grids[-1].shape[0] >= HALVED_FROM:
            grids.append(avg_pool2d(grids[-1][None], 2, ceil_mode=True)[0])
        return grids

    def masked(self, image: Tensor) -> Tensor:
        """The image (R,R) with nothing in the pixels that the picture does not show."""
        return image if self.mask is None else image * self.mask

    def stabilized(self, image: Tensor) -> list[Tensor]:
        """The grids of an image, transformed to variance 1 / 4n everywhere."""
        return [self.levels.stabilized(grid, self.subpixels * 4**k) for k, grid in enumerate(self.grids(image))]

    def residuals(self, rendering: Tensor) -> list[Tensor]:
        """Target minus rendering (R,R) on every grid, after the transform to equal variance."""
        return [a - b for a, b in zip(self.stable, self.stabilized(rendering), strict=True)]

    def render(self, code: IFS, *path: int | str) -> Tensor:
        """The code rendered as the target was, (R,R), as far as that is known. The same path of a random stream gives
        the same points."""
        check_time()
        resolution = self.image.shape[0]
        once = {"independent": True} if self.renderings > 1 else {}  # a percent of the error matters then
        images = [self.levels.render(code, resolution, derive(self.seed, *path, *([n] if n else [])), **once)
                  for n in range(self.renderings)]
        return self.masked(torch.stack(images).mean(0).to(self.image))

    def error(self, rendering: Tensor) -> float:
        """The error of a rendering (R,R); lower is better."""
        residuals = self.residuals(rendering)
        sums = torch.stack([each.square().sum(dtype=torch.float64) for each in residuals]).tolist()
        parts = [each / n for each, n in zip(sums, self.lit, strict=True)]
        return 2 * self.subpixels * sum(parts) / len(parts)

    def angle(self, error: float) -> float:
        """The root mean square of arcsin sqrt I - arcsin sqrt J, in radians, that corresponds to an error."""
        return (error / (2 * self.subpixels)) ** 0.5

    def error_at(self, angle: float) -> float:
        """The error that corresponds to an angle."""
        return 2 * self.subpixels * angle**2

    def noise(self, code: IFS, shown: Tensor | None = None) -> float:
        """The error that the true code would have by chance, estimated from renderings of this code. shown: `render`
        of the code, where that is known."""
        shown = self.render(code) if shown is None else shown
        if self.levels.is_linear:  # renderings have less noise than the image
            drawn = (self.levels.noisy(code, len(shown), derive(self.seed, "again", n)).to(shown)
                     for n in range(NOISE_RENDERINGS))
            errors = [Comparison(each, self.levels).error(shown) for each in drawn]
            return max(LEAST_NOISE, sum(errors) / len(errors))
        other = Comparison(self.render(code, "again"), self.levels)
        return max(LEAST_NOISE, other.error(shown))

    def noise_ratio(self, code: IFS, rendering: Tensor) -> float:
        """How far the rendering (R,R) of a code is from the image, beside what the true code is by chance: about 1 for
        that. It is the error over `noise`; for a picture of dots, the ratio that allows for theirs if that is less."""
        ratio = self.error(rendering) / self.noise(code, rendering)
        if self.levels.is_grainy:
            return min(ratio, noise_ratio_of_dots(self.masked(self.image), rendering))
        return ratio

    def likeness(self, rendering: Tensor) -> float:
        """F1 within a pixel between a rendering (R,R) and the image, both thresholded at `Levels.lit_above`."""
        least = self.levels.lit_above
        masks = ((image > least).float()[None] for image in (rendering, self.image))
        return float(metrics.f1_1px(*masks))
