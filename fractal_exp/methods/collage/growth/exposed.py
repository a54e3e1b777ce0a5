"""A grey picture as a measure under an exposure: what growth aims at."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d

from ....cameras.levels import Levels
from ....ifs.canvas import pixel_to_canvas
from ....images.known import Known

SIDE = 256          # maximum side, pixels, of the picture at which growth aims; a larger one is shrunk
WHITEST = 0.985     # grey level from which a pixel counts as white, which would take infinite mass


@dataclass(frozen=True)
class Exposed:
    """A picture `grey` (R,R) in [0,1], with grey levels I = 1 - exp(-m), or I = m if it `is_linear`, for the mass m
    of a pixel. mass: the whole mass that a code's drawing has; None: any, for pictures whose exposure is not known.
    known: the part of the canvas that the picture shows; None: all of it."""

    grey: Tensor
    is_linear: bool = False
    mass: float | None = None
    known: Known | None = None

    @classmethod
    def of(cls, image: Tensor, levels: Levels) -> Exposed:
        """What an image (R,R) shows, on at most `SIDE` pixels a side."""
        image = image.cpu().float()
        grey = adaptive_avg_pool2d(image[None], SIDE)[0] if len(image) > SIDE else image
        return cls(grey, levels.is_linear, levels.whole_mass(len(grey)), levels.known)

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
        return self.grey if self.is_linear else -(1 - self.grey.clamp(max=WHITEST)).log()

    def shown(self, masses: Tensor) -> Tensor:
        """The grey levels (R,R) of masses."""
        return masses if self.is_linear else 1 - (-masses).exp()

    def slope(self, masses: Tensor) -> Tensor:
        """The derivative of `shown`."""
        return torch.ones_like(masses) if self.is_linear else (-masses).exp()

    def points(self, count: int, generator: torch.Generator) -> Tensor:
        """Points (count,2) of the canvas, distributed as the masses, one in each of `count` equal parts of them."""
        cumulative = self._cumulative
        places = (torch.arange(count) + torch.rand(count, generator=generator)) / count
        pixels = torch.searchsorted(cumulative, places.to(cumulative)).clamp_max(len(cumulative) - 1)
        rows = torch.stack([pixels // self.side, pixels % self.side], 1)
        return pixel_to_canvas(rows + torch.rand(count, 2, generator=generator), self.side)

    @cached_property
    def _cumulative(self) -> Tensor:
        total = self.masses.flatten().double().cumsum(0)
        return total / total[-1]
