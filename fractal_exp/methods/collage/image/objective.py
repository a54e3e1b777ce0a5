"""The objective of stage 3: each code is rendered as the image was, and both are compared pixel by pixel."""

from __future__ import annotations

import copy
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ....cameras.comparison import Comparison
from ....cameras.levels import Levels, stabilize
from ....ifs import attractor
from ....ifs.code import IFS
from ....runtime.seeds import derive
from .. import maps as affine
from ..params import CollageParams
from .frame import Frame


@dataclass(frozen=True)
class Rendered(affine.WeightedMaps):
    """A code with its rendering (R,R), the rendering's error (see `ImageObjective`), and the levels that it was
    rendered with."""

    image: Tensor
    error: float
    levels: Levels


class ImageObjective(Comparison):
    """A comparison with the target image that judges maps, and knows the frame that the attractor must fill, if any
    (`within`); the misfit adds to the error."""

    frame: Frame | None = None

    def __init__(self, image: Tensor, levels: Levels, params: CollageParams, seed: int = 0, renderings: int = 1):
        super().__init__(image, levels, seed, renderings)
        self.params = params

    def within(self, frame: Frame | None) -> ImageObjective:
        """The same objective with this frame."""
        other = copy.copy(self)
        other.frame = frame
        return other

    def own_frame(self) -> Frame | None:
        """The frame that the image fills, or None."""
        return Frame.of(self.image, self.levels, self.params.frame)

    def firm_frame(self) -> Frame | None:
        """The frame for firm polishes, or None."""
        return Frame.firm_of(self.image, self.levels, self.params.frame)

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

    def framed_error(self, rendered: Rendered) -> float:
        """The geometric mean of two errors of a binary image's code: that of its rendering, and that of the code scaled
        to fill the frame exactly. The image does not show the faint tips that decide an attractor's box, so a code may
        draw it well in a wrong frame. For images without a firm frame, the error of the rendering."""
        if self.firm_frame() is None:
            return rendered.error
        fitting = self.render(attractor.normalize(rendered.code))
        return (self.error(rendered.image) * self.error(fitting)) ** 0.5

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
