"""The tone curve of a picture: which grey level a pixel shows for the mass in it."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

LEAST_SHARE = 1e-3   # of ink, up to which a root's slope is held: near black, a few pixels would outweigh all others


@dataclass(frozen=True)
class Curve:
    """Pixels of mass m, 0 or more, show the grey level I = (1 - exp(-m))^(1 / gamma), as ink of many small dots does,
    or I = m^(1 / gamma) if the curve is `linear`."""

    gamma: float = 1.0
    linear: bool = False

    def grey(self, mass: Tensor) -> Tensor:
        """Grey levels (…) of masses (…)."""
        if self.gamma == 1:  # a root would show that faint ink loses its digits
            return mass if self.linear else 1 - (-mass).exp()
        return self.displayed(mass if self.linear else -torch.expm1(-mass))

    def mass(self, grey: Tensor, whitest: float) -> Tensor:
        """Masses (…) of grey levels (…). whitest: the share of ink, below 1, that a white pixel counts as, since white
        would take infinite mass; a linear curve has no such limit."""
        share = grey.clamp_min(0) ** self.gamma
        return share if self.linear else -(1 - share.clamp(max=whitest)).log()

    def slope(self, mass: Tensor) -> Tensor:
        """The derivative (…) of `grey`; for shares of ink below `LEAST_SHARE`, the root's slope is the one there."""
        along = torch.ones_like(mass) if self.linear else (-mass).exp()
        if self.gamma == 1:
            return along
        share = mass if self.linear else -torch.expm1(-mass)
        return along * share.clamp_min(LEAST_SHARE) ** (1 / self.gamma - 1) / self.gamma

    def displayed(self, share: Tensor) -> Tensor:
        """Grey levels (…) of shares of ink (…), after a display with this gamma."""
        return share.clamp_min(0) ** (1 / self.gamma)
