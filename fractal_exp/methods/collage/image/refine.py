"""All maps moved together on ever finer grids of the measure."""

from __future__ import annotations

from torch import Tensor

from ....ops.collage import Descent, descend
from ....runtime.seeds import derive
from ..bins import binned, grid_for
from ..measure.saturation import saturation_corrected
from .objective import ImageObjective, Rendered


def refined(objective: ImageObjective, masses: Tensor, maps: Tensor, weights: Tensor | None, seed: int) -> Rendered:
    """The best rendering among the maps (N,6) and their refinements on ever finer grids.

    Before each grid, the code so far corrects the image's masses (R,R) for saturation, so that the collage error nearly
    vanishes for the true code. weights (N,) are free to move; None: they are tied to |det| + 0.01.
    """
    params, refine = objective.params, objective.params.refine
    best = now = objective.judge(maps, weights)
    size, rate = refine.coarsest, refine.rate
    finest = grid_for(masses.shape[0], refine.finest)
    while refine.steps and size <= finest:
        how = Descent(refine.steps, rate=rate, largest=refine.largest, prior=0.0, tied=weights is None)
        corrected = saturation_corrected(masses, now.code, objective.levels, params.saturation,
                                         derive(seed, "refine", size))
        measure = binned(corrected, size, refine.grids)
        moved, shares, _ = descend(now.maps[None], now.probabilities[None], measure, how)
        now = objective.judge(moved[0], None if weights is None else shares[0] / shares[0].sum())
        best = min(best, now, key=lambda rendered: rendered.error)
        size, rate = 2 * size, rate / 2
    return best
