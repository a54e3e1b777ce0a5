"""The frame that an attractor fills. It constrains tips that are too faint to be seen in the image."""

from __future__ import annotations

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ....cameras.levels import Levels
from ....ifs.attractor import FRAME_SIDE, visible_tips
from .. import maps as affine
from ..params.image import FrameParams


@dataclass(frozen=True)
class Frame:
    """Targets are placed on the canvas by a box: it is centred, and its longer side spans [-0.75, 0.75]. For the random
    suite and the classics this is the attractor's `visible_box`. For a picture file it is the box of the lit pixels,
    which misses faint tips such as a fern's stem by some pixels. Lit pixels may exceed the frame, because the visible
    box leaves out the rarest tips.

    side: pixels per side of the image; sigma_px, beyond_px: see `FrameParams`.
    """

    side: int
    sigma_px: float
    beyond_px: float

    @classmethod
    def of(cls, image: Tensor, levels: Levels, params: FrameParams) -> Frame | None:
        """The frame that an image (R,R) fills, or None. Linear images and pictures that others drew have no frame."""
        return None if levels.is_linear or not levels.is_exact else cls._of(image, params, params.shortest)

    @classmethod
    def firm_of(cls, image: Tensor, levels: Levels, params: FrameParams) -> Frame | None:
        """The frame of a binary image (R,R), of which its lit pixels may fall far short; None for all other images."""
        return None if levels.is_graded or not params.firm else cls._of(image, params, params.binary_shortest)

    @classmethod
    def _of(cls, image: Tensor, params: FrameParams, shortest: float) -> Frame | None:
        """None if the lit pixels span too much or too little of the canvas."""
        side = image.shape[0]
        lit = [image.amax(k).nonzero().flatten() for k in (0, 1)]
        if len(lit[0]) == 0 or not params.enabled:
            return None
        spans = [2 * float(each[-1] + 1 - each[0]) / side for each in lit]
        off = [abs(float(each[-1] + 1 + each[0]) / side - 1) for each in lit]
        fills = shortest * FRAME_SIDE < max(spans) < params.longest * FRAME_SIDE
        if not fills or max(off) >= (params.longest - 1) * FRAME_SIDE:
            return None
        return cls(side, params.sigma_px, params.beyond_px)

    def firmer(self, factor: float) -> Frame:
        """The same frame with a larger weight."""
        return replace(self, sigma_px=self.sigma_px / factor**0.5)

    def misfit(self, maps: Tensor, probabilities: Tensor) -> Tensor:
        """Misfit (3,) float64, pixels, of the attractor's visible box in the frame, for maps (N,6) and probabilities
        (N,): of its lower and upper end along its longer side, and of its centre along the other side."""
        low, high = _box([tip for tip, _ in visible_tips(affine.to_code(maps, probabilities))])
        return self._misfit(low, high)

    def enlargement(self, maps: Tensor, probabilities: Tensor) -> float:
        """The factor on all offsets that makes the longer side of the attractor's box as long as the frame."""
        low, high, _ = self.misfit(maps, probabilities)
        return FRAME_SIDE / (FRAME_SIDE + 2 / self.side * float(high - low))

    def jacobian(self, maps: Tensor, probabilities: Tensor) -> Tensor:
        """The derivatives (3,N,6) of `misfit` by the maps: those of the words that reach farthest, for fixed
        probabilities."""
        words = [torch.from_numpy(word).long() for _, word in visible_tips(affine.to_code(maps, probabilities))]
        with torch.enable_grad():
            moving, weights = maps.detach().cpu().double().requires_grad_(), probabilities.detach().cpu().double()
            linear, offset = moving[:, :4].unflatten(1, (2, 2)), moving[:, 4:]
            average = (weights[:, None, None] * linear).sum(0)
            mean = torch.linalg.solve(torch.eye(2, dtype=torch.float64) - average, weights @ offset)
            tips = [sign * _image(linear, offset, word, mean)[axis]
                    for word, axis, sign in zip(words, (0, 1, 0, 1), (1, 1, -1, -1), strict=True)]
            misfit = self._misfit(*_box(tips))
            return torch.stack([torch.autograd.grad(each, moving, retain_graph=True)[0] for each in misfit])

    def _misfit(self, low: Tensor, high: Tensor) -> Tensor:
        along = int((high - low).argmax())
        across = 1 - along
        return torch.stack([low[along] + FRAME_SIDE / 2, high[along] - FRAME_SIDE / 2,
                            (low[across] + high[across]) / 2]) * (self.side / 2)

    def penalty(self, misfit: Tensor) -> tuple[float, Tensor]:
        """Huber's loss of a misfit (3,), in counting errors of a pixel, and the residual weights (3,) that follow from
        it. A large misfit weighs less than its square, so it cannot spoil a code that is wrong for other reasons."""
        size = misfit.abs() / self.beyond_px
        value = torch.where(size < 1, size.square(), 2 * size - 1).sum() * (self.beyond_px / self.sigma_px) ** 2
        return float(value), size.clamp_min(1).rsqrt() / self.sigma_px


def _box(tips: list) -> tuple[Tensor, Tensor]:
    """The lower and the upper corner, (2,) each, of a box from its reach to the right, top, left and bottom."""
    right, top, left, bottom = (torch.as_tensor(tip, dtype=torch.float64) for tip in tips)
    return torch.stack([-left, -bottom]), torch.stack([right, top])


def _image(linear: Tensor, offset: Tensor, word: Tensor, point: Tensor) -> Tensor:
    """Where the word sends the point. Its last map is applied first."""
    for letter in word.flip(0):
        point = linear[letter] @ point + offset[letter]
    return point
