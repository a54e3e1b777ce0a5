"""A grey picture as a measure under an exposure: what growth aims at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from ....cameras.levels import Levels, mean_of
from ....ifs.canvas import pixel_to_canvas
from ....images.known import Known
from ....rendering.curve import Curve

SIDE = 256          # maximum side, pixels, of the picture at which growth aims; a larger one is shrunk
WHITEST = 0.985     # share of ink from which a pixel counts as white, which would take infinite mass


@dataclass(frozen=True)
class Exposed:
    """A picture `grey` (R,R) in [0,1], and the tone curve by which its grey levels follow the masses of pixels.

    mass: the whole mass that a code's drawing has; None: any, for pictures whose exposure is not known. known: the part
    of the canvas that the picture shows; None: all of it.
    """

    grey: Tensor
    curve: Curve = Curve()
    mass: float | None = None
    known: Known | None = None

    @classmethod
    def of(cls, image: Tensor, levels: Levels) -> Exposed:
        """What an image (R,R) shows, on at most `SIDE` pixels a side."""
        image = image.cpu().float()
        grey = mean_of(image, SIDE) if len(image) > SIDE else image
        return cls(grey, levels.curve, levels.whole_mass(len(grey)), levels.known)

    @property
    def side(self) -> int:
        """R."""
        return len(self.grey)

    @cached_property
    def shows(self) -> Tensor:
        """1 where the picture shows the canvas, and 0 where it does not, (R,R)."""
        return torch.ones_like(self.grey) if self.known is None else self.known.mask(self.side).to(self.grey)

    @cached_property
    def masses(self) -> Tensor:
        """The masses (R,R) of pixels."""
        return self.curve.mass(self.grey, WHITEST)

    def slope(self, masses: Tensor) -> Tensor:
        """The derivatives (R,R) of grey levels by masses, at most as flat as in the whitest pixels that are told apart.
        The true ones vanish where white saturates, and nothing would draw mass out of such a pixel again."""
        return self.curve.slope(masses.clamp_max(float(self.curve.mass(torch.ones(()), WHITEST))))

    def points(self, count: int, generator: torch.Generator) -> Tensor:
        """Points (count,2) of the canvas, distributed as the masses, one in each of `count` equal parts of them."""
        places = (torch.arange(count) + torch.rand(count, generator=generator)) / count
        pixels = torch.searchsorted(self._cumulative, places.double()).clamp_max(self.side**2 - 1)
        rows = torch.stack([pixels // self.side, pixels % self.side], 1)
        return pixel_to_canvas(rows + torch.rand(count, 2, generator=generator), self.side)

    @cached_property
    def _cumulative(self) -> Tensor:
        total = self.masses.flatten().double().cumsum(0)
        return total / total[-1]
