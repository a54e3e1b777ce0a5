"""All maps moved together on ever finer grids of the measure."""

from __future__ import annotations

import math

from torch import Tensor

from ...ops.collage import Descent, descend
from ...runtime.seeds import derive
from .measure import binned, desaturated
from .picture import Drawn, Picture

RATES = {128: 0.002, 256: 0.001, 512: 0.0005}
STEPS = 120


def grid_for(resolution: int, wanted: int) -> int:
    """The power of two that a picture of this resolution can fill, `wanted` at most."""
    return min(wanted, 2 ** int(math.log2(1.3 * resolution)))


def refined(picture: Picture, masses: Tensor, maps: Tensor, weights: Tensor | None, finest: int, seed: int) -> Drawn:
    """The best drawing of the maps (N,6) and what becomes of them on grids of 128 to `finest` cells a side.

    Before each, the picture's masses (R,R) are corrected by what the code would have shown (`desaturated`), so that at
    the true code the collage error nearly vanishes. weights (N,) are free to move; None: those of |det| + 0.01.
    """
    best = now = picture.judge(maps, weights)
    for size, rate in RATES.items():
        if size > grid_for(masses.shape[0], finest):
            break
        how = Descent(STEPS, rate=rate, largest=0.9995, prior=0.0, tied=weights is None)
        measure = binned(desaturated(masses, now.code, picture.levels, derive(seed, "refine", size)), size, 4)
        moved, shares, _ = descend(now.maps[None], now.chances[None], measure, how)
        now = picture.judge(moved[0], None if weights is None else shares[0] / shares[0].sum())
        best = min(best, now, key=lambda drawn: drawn.error)
    return best
