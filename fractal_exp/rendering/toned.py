"""Pictures of a view with the tone of the picture that a code was found on: in greys, or in the code's colours."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ..ifs.code import IFS
from .tone import Tone, own_tone, softened, tone_of

TONE, COLOUR = "tone", "colour"   # the modes that may make such a picture


@dataclass(frozen=True)
class Toned:
    """How a view becomes a picture with a tone. `mode` is what must be drawn of it first: "density" (H,W), or for a
    picture in colours "tinted" (H,W,4).

    A picture in colours has the density, under the tone of the shape's cover, as its opacity. So a petal that covers
    its ground covers it in the drawing too, however light it is, and fine twigs stay fine.
    """

    tone: Tone
    mode: str = "density"

    @classmethod
    def of(cls, code: IFS, mode: str) -> Toned | None:
        """How this code is drawn in a mode; None if no tone belongs to it. Raises `InputError` if the mode is "tone"
        and the code has none."""
        if mode == TONE:
            return cls(tone_of(code))
        tone = own_tone(code) if mode == COLOUR else None
        cover = tone and tone.of_cover
        return cover and cls(cover, "tinted")

    def softened(self, drawn: Tensor) -> Tensor:
        """What was drawn, blurred as `tone.softened` blurs a density; colours count by their density."""
        if self.mode == "density":
            return softened(drawn)
        density, soft = drawn[..., 3], softened(drawn[..., 3])
        colours = [softened(density * drawn[..., channel]) / soft.clamp(min=1e-12) for channel in range(3)]
        return torch.stack([*colours, soft], -1)

    def exposure(self, soft: Tensor) -> float:
        """The exposure of what was softened."""
        return self.tone.exposure(soft if self.mode == "density" else soft[..., 3])

    def shown(self, soft: Tensor, exposure: float) -> Tensor:
        """The picture of what was softened: greys (H,W), or colours with their opacity (H,W,4)."""
        if self.mode == "density":
            return self.tone.grey(soft, exposure)
        return torch.cat([soft[..., :3], self.tone.grey(soft[..., 3:], exposure)], -1)

    def drawn(self, drawn: Tensor) -> Tensor:
        """The picture of a whole view."""
        soft = self.softened(drawn)
        return self.shown(soft, self.exposure(soft))
