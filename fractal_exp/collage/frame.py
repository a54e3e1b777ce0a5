"""The frame that an attractor fills: what a picture tells of tips too faint to be seen in it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ..attractor import FRAME_SIDE, visible_tips
from . import maps as affine

SHORT, LONG = 0.93, 1.17  # times the frame's side: what the lit pixels of a picture that fills it span
BEYOND_PX = 1.0           # from here on a misfit counts in proportion, no longer in its square
SIGMA_PX = 0.05           # of a misfit that counts as much as the counting error of one pixel


@dataclass(frozen=True)
class Frame:
    """A target is brought to the canvas by its attractor's `visible_box`: centred, the longer side from -0.75 to 0.75.
    side: pixels a side of the picture. What is lit may exceed the frame, as that box leaves out the rarest tips."""

    side: int

    @classmethod
    def of(cls, image: Tensor) -> Frame | None:
        """That of an image (R,R), or None if what is lit in it spans too much or too little of it."""
        side = image.shape[0]
        lit = [image.amax(k).nonzero().flatten() for k in (0, 1)]
        if len(lit[0]) == 0:
            return None
        spans = [2 * float(each[-1] + 1 - each[0]) / side for each in lit]
        off = [abs(float(each[-1] + 1 + each[0]) / side - 1) for each in lit]
        fills = SHORT * FRAME_SIDE < max(spans) < LONG * FRAME_SIDE
        return cls(side) if fills and max(off) < (LONG - 1) * FRAME_SIDE else None

    def misfit(self, maps: Tensor, chances: Tensor) -> tuple[Tensor, Tensor]:
        """How far the attractor's visible box is from the frame, (3,) float64 pixels: its lower and its upper end along
        its longer side, and its centre along the other; and the derivatives (3,N,6) by the maps (N,6), which are those
        of the words that reach farthest, with chances (N,) held."""
        tips = [torch.from_numpy(word).long() for _, word in visible_tips(affine.to_code(maps, chances))]
        with torch.enable_grad():
            moving, weights = maps.detach().cpu().double().requires_grad_(), chances.detach().cpu().double()
            linear, offset = moving[:, :4].unflatten(1, (2, 2)), moving[:, 4:]
            average = (weights[:, None, None] * linear).sum(0)
            mean = torch.linalg.solve(torch.eye(2, dtype=torch.float64) - average, weights @ offset)
            right, top, left, bottom = (_image(linear, offset, word, mean) for word in tips)
            low, high = torch.stack([left[0], bottom[1]]), torch.stack([right[0], top[1]])
            along = int((high - low).argmax())
            across = 1 - along
            misfit = torch.stack([low[along] + FRAME_SIDE / 2, high[along] - FRAME_SIDE / 2,
                                  (low[across] + high[across]) / 2]) * (self.side / 2)
            slopes = [torch.autograd.grad(each, moving, retain_graph=True)[0] for each in misfit]
        return misfit.detach(), torch.stack(slopes)

    @staticmethod
    def penalty(misfit: Tensor, slopes: Tensor) -> tuple[float, Tensor, Tensor]:
        """Huber's of a misfit, in counting errors of a pixel, and its normal equations' part: what weighs less than in
        proportion cannot spoil a code that is wrong for other reasons. Weighed residuals (3,) and slopes (3,N,6)."""
        size = misfit.abs() / BEYOND_PX
        value = torch.where(size < 1, size.square(), 2 * size - 1).sum() * (BEYOND_PX / SIGMA_PX) ** 2
        weight = size.clamp_min(1).rsqrt() / SIGMA_PX
        return float(value), misfit * weight, slopes * weight[:, None, None]


def _image(linear: Tensor, offset: Tensor, word: Tensor, point: Tensor) -> Tensor:
    """Where the word's maps, the last one first, send the point."""
    for letter in word.flip(0):
        point = linear[letter] @ point + offset[letter]
    return point
