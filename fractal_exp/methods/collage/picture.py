"""A picture as the judge of codes: each code is drawn as the picture was, and both are compared pixel by pixel."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, avg_pool2d

from ...ifs.code import IFS
from ...runtime.seeds import derive
from . import maps as affine
from .frame import Frame
from .measure import Levels

GRIDS = 4          # compared, each half as fine as the one before
FINEST = 512       # cells a side of the first
LEAST_NOISE = 1e-3
SMALL = 4          # drawings whose mean tells what a smaller picture would show


@dataclass(frozen=True)
class Drawn:
    """Maps (N,6) with weights (N,), or None for chances in proportion to |det| + 0.01; the code's drawing (R,R), as
    the picture was drawn, and its error (see `Picture`)."""

    maps: Tensor
    weights: Tensor | None
    image: Tensor
    error: float

    @property
    def chances(self) -> Tensor:
        """(N,), summing to 1."""
        return affine.normalized(affine.volumes(self.maps) if self.weights is None else self.weights)

    @property
    def code(self) -> IFS:
        """The code of the maps."""
        return affine.to_code(self.maps, self.weights)


class Picture:
    """The target image (R,R) in [0,1], and how far drawings are from it.

    A pixel of which a share I of n subpixels is lit has a counting error that depends on I; arcsin(sqrt(I)) has the
    variance 1/4n whatever I is (Anscombe 1948), so that faint tips count for what they are worth. The error is
    mean over grids of sum 2n (arcsin sqrt I - arcsin sqrt J)² / (lit cells of the target), with the n of the finest
    grid on all: of the order of 0.1 for two drawings of one code, 0.3 for pixels that only share their brightness.
    The mean of several drawings has less noise. maps_at_once: how many maps are polished together, as memory allows;
    frame: which the attractor must fill, if there is one (`within`); what it misses of it adds to the error.
    """

    frame: Frame | None = None

    def __init__(self, image: Tensor, levels: Levels, seed: int = 0, drawings: int = 1, maps_at_once: int = 1_000_000):
        self.maps_at_once = maps_at_once
        self.image, self.levels, self.seed, self.drawings = image, levels, derive(seed, "picture"), drawings
        self.side = min(image.shape[0], FINEST)
        self.subpixels = (levels.supersample * image.shape[0] / self.side) ** 2
        self.stable = self.stabilized(image)
        self.lit = [max(1, int((grid > 0).sum())) for grid in self.grids(image)]

    def within(self, frame: Frame | None) -> Picture:
        """The same, with this frame."""
        other = copy.copy(self)
        other.frame = frame
        return other

    def hasty(self) -> Picture:
        """The same, with a single drawing of each code."""
        other = copy.copy(self)
        other.drawings = 1
        return other

    def grids(self, image: Tensor) -> list[Tensor]:
        """The image (R,R) on grids of `side` and fewer cells a side."""
        image = adaptive_avg_pool2d(image[None], self.side)[0] if image.shape[0] > self.side else image
        grids = [image]
        while len(grids) < GRIDS and grids[-1].shape[0] >= 8:
            grids.append(avg_pool2d(grids[-1][None], 2, ceil_mode=True)[0])
        return grids

    def stabilized(self, image: Tensor) -> list[Tensor]:
        """The grids of an image, of variance 1 / 4n everywhere."""
        return [stabilize(grid, self.subpixels * 4**k) for k, grid in enumerate(self.grids(image))]

    def residuals(self, drawn: Tensor) -> list[Tensor]:
        """Target minus drawing (R,R), of equal variance, on every grid."""
        return [a - b for a, b in zip(self.stable, self.stabilized(drawn), strict=True)]

    def draw(self, code: IFS, *path: int | str) -> Tensor:
        """(R,R), as the target was drawn; the same path of a random stream gives the same points."""
        resolution = self.image.shape[0]
        once = {"reuse": 1} if self.drawings > 1 else {}  # where a percent of the error counts
        images = [self.levels.observe(code, resolution, derive(self.seed, *path, *([n] if n else [])), **once)
                  for n in range(self.drawings)]
        return torch.stack(images).mean(0).to(self.image)

    def judge(self, maps: Tensor, weights: Tensor | None = None) -> Drawn:
        """The code of these maps, drawn."""
        image = self.draw(affine.to_code(maps, weights))
        drawn = Drawn(maps, weights, image, self.error(image))
        if self.frame is None:
            return drawn
        misses, _ = self.frame.penalty(self.frame.misfit(maps, drawn.chances))
        return replace(drawn, error=drawn.error + misses / (self.lit[0] * len(self.lit)))

    def without(self, drawn: Drawn, gone: list[int]) -> Drawn:
        """The code without some of its maps."""
        keep = [i for i in range(len(drawn.maps)) if i not in gone]
        return self.judge(drawn.maps[keep], None if drawn.weights is None else drawn.chances[keep])

    def error(self, drawn: Tensor) -> float:
        """Of a drawing (R,R); lower is better."""
        sums = torch.stack([residual.square().sum() for residual in self.residuals(drawn)]).tolist()
        parts = [each / n for each, n in zip(sums, self.lit, strict=True)]
        return 2 * self.subpixels * sum(parts) / len(parts)

    def angle(self, error: float) -> float:
        """The root mean square of arcsin sqrt I - arcsin sqrt J, in radians, that an error stands for."""
        return (error / (2 * self.subpixels)) ** 0.5

    def noise(self, code: IFS) -> float:
        """The error that the true code would have by chance, told from two drawings of this one."""
        other = Picture(self.draw(code, "again"), self.levels)
        return max(LEAST_NOISE, other.error(self.draw(code)))


def reduced(image: Tensor, size: int, code: IFS, levels: Levels, seed: int) -> Tensor:
    """The picture (R,R) at a smaller size (S,S), as it would have been drawn.

    `levels.shrunk` errs where the shape is finer than a pixel, by many times the noise of a drawing; but a code that is
    nearly right shows by how much, drawn at both sizes. The difference is undone between levels of equal variance.
    """
    subpixels = levels.supersample**2
    shrunk = levels.shrunk(image, size)
    large = levels.shrunk(levels.observe(code, image.shape[0], derive(seed, "large")).to(image), size)
    small = torch.stack([levels.observe(code, size, derive(seed, "small", n)).to(image) for n in range(SMALL)]).mean(0)
    stable = stabilize(shrunk, subpixels) - stabilize(large, subpixels) + stabilize(small, subpixels)
    share = stable.clamp(0, torch.pi / 2).sin().square()
    found = ((share * (subpixels + 0.75) - 0.375) / subpixels).clamp(0, 1)
    return torch.where(shrunk > 0, found, 0)


def stabilize(image: Tensor, subpixels: float) -> Tensor:
    """arcsin sqrt of grey levels that are shares of so many subpixels (Anscombe 1948)."""
    return ((image * subpixels + 0.375) / (subpixels + 0.75)).clamp(0, 1).sqrt().asin()


def stabilizing_slope(image: Tensor, subpixels: float) -> Tensor:
    """The derivative of `stabilize`."""
    share = ((image * subpixels + 0.375) / (subpixels + 0.75)).clamp(0, 1)
    return 0.5 * (share * (1 - share)).clamp_min(1e-4).rsqrt()
