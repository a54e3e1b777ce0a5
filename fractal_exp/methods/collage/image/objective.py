"""The objective of stage 3: each code is rendered as the image was, both are compared pixel by pixel, and the attractor
must fill the frame of the image. The frame constrains tips that are too faint to be seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import torch
from torch import Tensor

from ....cameras.camera import Camera
from ....cameras.comparison import Comparison
from ....cameras.levels import Levels, stabilize
from ....ifs import affine, attractor
from ....ifs.attractor import FRAME_SIDE, visible_tips
from ....ifs.code import IFS
from ....ifs.contraction import AVERAGE
from ....runtime.seeds import derive
from ..limits import LARGEST, largest_for, limited
from ..params import CollageParams, FrameParams
from ..state import Candidate, WeightedMaps

HOPELESS = 0.4          # error, radians rms, from which the image may show no attractor
# Of the frame.
SHORTEST = 0.93         # minimum span of the lit pixels, relative to the frame's side, for an image to fill its frame
BINARY_SHORTEST = 0.55  # the same for the firm polishes of a binary image, which does not show faint tips
LONGEST = 1.17          # maximum span; the lit pixels may also lie off the canvas's centre by as much
SIGMA_PX = 0.05         # misfit, pixels, that counts as much as the counting error of one pixel
BEYOND_PX = 1.0         # misfit, pixels, above which the loss is linear (Huber 1964)
FAR = 30.0              # noise ratio from which the frame is ignored, except by firm polishes, and codes not rounded
FIRM_ABOVE = 1.2        # noise ratio above which a code counts as not nearly right: it is polished firmly in the frame
FIRM_ONLY = 2.0         # noise ratio above which a round ends with that: parts of a pixel do not matter yet


@dataclass(frozen=True)
class Rendered(WeightedMaps):
    """A code with its rendering (R,R), the rendering's error (see `ImageObjective`), and the levels that it was
    rendered with."""

    image: Tensor
    error: float
    levels: Levels

    def candidate(self, camera: Camera | None = None) -> Candidate:
        """The code as a stage hands it on: weights that are not tied become probabilities, the score is the error."""
        weights = None if self.weights is None else self.probabilities
        return Candidate(self.maps, weights, self.error, self.error, camera)


class ImageObjective(Comparison):
    """A comparison with the target image that judges maps, and knows the frame that the attractor must fill, if any
    (`within`); the misfit adds to the error."""

    frame: Frame | None = None

    def __init__(self, image: Tensor, levels: Levels, params: CollageParams, seed: int = 0, renderings: int = 1):
        super().__init__(image, levels, seed, renderings)
        self.params = params

    @cached_property
    def largest(self) -> float:
        """The upper limit of the larger singular value of a map."""
        lit = self.image > 0
        if not bool(lit.any()):
            return LARGEST
        return largest_for(torch.cov(lit.nonzero().T.double(), aweights=self.image[lit].double(), correction=0))

    def within(self, frame: Frame | None) -> ImageObjective:
        return self._changed(frame=frame)

    def own_frame(self) -> Frame | None:
        """The frame that the image fills, or None."""
        return Frame.of(self.image, self.levels, self.params.frame)

    def firm_frame(self) -> Frame | None:
        """The frame for firm polishes, or None."""
        return Frame.firm_of(self.image, self.levels, self.params.frame)

    def judge(self, maps: Tensor, weights: Tensor | None = None) -> Rendered:
        """The code of these maps, rendered and compared. Maps that no code may have are limited first."""
        maps = limited(maps, weights, self.largest)
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

    def likenesses(self, shown: Rendered) -> tuple[float, float]:
        """The likeness of a code's drawing to a picture that others drew (F1 within a pixel), and its attractor's."""
        from ....likeness import likeness_of_attractor  # such pictures alone need it

        return self.likeness(shown.image), likeness_of_attractor(shown.code, self.image, self.levels)

    def likeness_of(self, shown: Rendered) -> float:
        """The likeness of a code's drawing, or of its attractor if that is lower and the image shows all of it."""
        return min(self.likenesses(shown)) if self.levels.is_whole else self.likeness(shown.image)

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
        return self.angle(error) >= HOPELESS


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


@dataclass(frozen=True)
class Frame:
    """Targets are placed on the canvas by a box: it is centred, and its longer side spans [-0.75, 0.75]. For the random
    suite and the classics this is the attractor's `visible_box`. For a picture file it is the box of the lit pixels,
    which misses faint tips such as a fern's stem by some pixels. Lit pixels may exceed the frame, because the visible
    box leaves out the rarest tips. A picture that shows a part of its shape has no frame.

    side: pixels per side of the image; sigma_px: misfit that counts as much as the counting error of one pixel.
    """

    side: int
    sigma_px: float = SIGMA_PX

    @classmethod
    def of(cls, image: Tensor, levels: Levels, params: FrameParams) -> Frame | None:
        """The frame that an image (R,R) fills, or None. Linear images and pictures that others drew have no frame."""
        has_none = levels.is_linear or not levels.is_exact or levels.known is not None
        return None if has_none else cls._of(image, params, SHORTEST)

    @classmethod
    def firm_of(cls, image: Tensor, levels: Levels, params: FrameParams) -> Frame | None:
        """The frame of a binary image (R,R), of which its lit pixels may fall far short; None for all other images."""
        has_none = levels.is_graded or not params.firm or levels.known is not None
        return None if has_none else cls._of(image, params, BINARY_SHORTEST)

    @classmethod
    def _of(cls, image: Tensor, params: FrameParams, shortest: float) -> Frame | None:
        """None if the lit pixels span too much or too little of the canvas."""
        side = image.shape[0]
        lit = [image.amax(k).nonzero().flatten() for k in (0, 1)]
        if len(lit[0]) == 0 or not params.enabled:
            return None
        spans = [2 * float(each[-1] + 1 - each[0]) / side for each in lit]
        off = [abs(float(each[-1] + 1 + each[0]) / side - 1) for each in lit]
        fills = shortest * FRAME_SIDE < max(spans) < LONGEST * FRAME_SIDE
        if not fills or max(off) >= (LONGEST - 1) * FRAME_SIDE:
            return None
        return cls(side)

    def misfit(self, maps: Tensor, probabilities: Tensor) -> Tensor:
        """Misfit (3,) float64, pixels, of the attractor's visible box in the frame, for maps (N,6) and probabilities
        (N,): of its lower and upper end along its longer side, and of its centre along the other side."""
        box = torch.from_numpy(attractor.visible_box(affine.to_code(maps, probabilities)))
        return self._misfit(box[:2], box[2:])

    def enlargement(self, maps: Tensor, probabilities: Tensor) -> float:
        """The factor on all offsets that makes the longer side of the attractor's box as long as the frame."""
        low, high, _ = self.misfit(maps, probabilities)
        return FRAME_SIDE / (FRAME_SIDE + 2 / self.side * float(high - low))

    def jacobian(self, maps: Tensor, probabilities: Tensor) -> Tensor:
        """The derivatives (3,N,6) of `misfit` by the maps: those of the words that reach farthest, for fixed
        probabilities. 0 for a code that contracts on average only, in which no word does."""
        code = affine.to_code(maps, probabilities)
        if code.contraction.kind == AVERAGE:
            return torch.zeros(3, *maps.shape, dtype=torch.float64)
        words = [torch.from_numpy(word).long() for _, word in visible_tips(code)]
        with torch.enable_grad():
            moving, weights = maps.detach().cpu().double().requires_grad_(), probabilities.detach().cpu().double()
            linear, offset = moving[:, :4].unflatten(1, (2, 2)), moving[:, 4:]
            average = (weights[:, None, None] * linear).sum(0)
            mean = torch.linalg.solve(torch.eye(2, dtype=torch.float64) - average, weights @ offset)
            tips = [sign * _image(linear, offset, word, mean)[axis]
                    for word, axis, sign in zip(words, (0, 1, 0, 1), (1, 1, -1, -1), strict=True)]
            right, top, left, bottom = tips
            misfit = self._misfit(torch.stack([-left, -bottom]), torch.stack([right, top]))
            return torch.stack([torch.autograd.grad(each, moving, retain_graph=True)[0] for each in misfit])

    def _misfit(self, low: Tensor, high: Tensor) -> Tensor:
        along = int((high - low).argmax())
        across = 1 - along
        return torch.stack([low[along] + FRAME_SIDE / 2, high[along] - FRAME_SIDE / 2,
                            (low[across] + high[across]) / 2]) * (self.side / 2)

    def penalty(self, misfit: Tensor) -> tuple[float, Tensor]:
        """Huber's loss of a misfit (3,), in counting errors of a pixel, and the residual weights (3,) that follow from
        it. A large misfit weighs less than its square, so it cannot spoil a code that is wrong for other reasons."""
        size = misfit.abs() / BEYOND_PX
        value = torch.where(size < 1, size.square(), 2 * size - 1).sum() * (BEYOND_PX / self.sigma_px) ** 2
        return float(value), size.clamp_min(1).rsqrt() / self.sigma_px


def _image(linear: Tensor, offset: Tensor, word: Tensor, point: Tensor) -> Tensor:
    """Where the word sends the point. Its last map is applied first."""
    for letter in word.flip(0):
        point = linear[letter] @ point + offset[letter]
    return point
