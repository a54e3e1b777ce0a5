"""The last stage: all maps moved together on ever finer grids, and the choice of what draws the picture best."""

from __future__ import annotations

import math
from collections.abc import Iterator

from torch import Tensor

from ..ifs import IFS
from ..ops.collage import BinnedMeasure, Descent, collage_error, descend
from ..seeds import derive
from . import maps as affine
from .measure import Levels, binned, desaturated

GRIDS = {128: Descent(steps=150, rate=0.002, largest=0.9995, tied=True),
         256: Descent(steps=120, rate=0.001, largest=0.9995, tied=True),
         512: Descent(steps=100, rate=0.0005, largest=0.9995, tied=True),
         1024: Descent(steps=80, rate=0.00025, largest=0.9995, tied=True)}
COMPARED = 4  # grids, each half as fine as the one before


def grid_for(resolution: int, wanted: int) -> int:
    """The power of two that a picture of this resolution can fill, `wanted` at most."""
    return min(wanted, 2 ** int(math.log2(1.3 * resolution)))


def refinements(code: IFS, masses: Tensor, levels: Levels, finest: int, seed: int) -> Iterator[IFS]:
    """The code after each grid up to `finest`, its chances those of |det| + 0.01.

    Before each, the picture's masses are corrected by what the code would have shown (`desaturated`), so that at the
    true code the collage error vanishes but for noise.
    """
    maps = affine.from_code(code)
    for size, how in GRIDS.items():
        if size > grid_for(masses.shape[0], finest):
            break
        corrected = desaturated(masses, code, levels, derive(seed, "refine", size))
        weights = affine.volumes(maps)
        maps, _, _ = (t[0] if t.ndim > 1 else t for t in descend(
            maps[None], (weights / weights.sum())[None], binned(corrected, size, COMPARED), how))
        code = affine.to_code(maps)
        yield code


class PictureError:
    """How far a code's picture is from the target's, as squared Hellinger distance over grids of the picture's own
    pixels and coarser; the code is drawn as the target was."""

    def __init__(self, masses: Tensor, levels: Levels, seed: int):
        size = grid_for(masses.shape[0], masses.shape[0])
        self.measure: BinnedMeasure = binned(masses, size, min(COMPARED, int(math.log2(size))))
        self.levels, self.resolution, self.seed = levels, masses.shape[0], derive(seed, "picture")

    def __call__(self, code: IFS) -> float:
        """0 for the same picture, 2 for pictures that share nothing."""
        shown = self.levels.measure(self.levels.observe(code, self.resolution, self.seed).to(self.measure.bins))
        if not bool(shown.sum() > 0):
            return 2.0
        bins = binned(shown, self.measure.size, 1).bins
        return float(collage_error(bins[None], self.measure)[0])
