"""What moves work with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, TypeVar

import torch
from torch import Tensor

from ....ifs import affine
from ....ops.collage import BinnedMeasure, Descent, descend, pushforward
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from ..bins import binned, correction, grid_for, saturation_corrected
from ..image.gauss_newton import polished
from ..image.objective import ImageObjective, Rendered, error_of
from ..limits import SMALLER
from ..measure.windows import completed, seen
from ..simplify.loop import Price, pruned
from ..state import WeightedMaps

MISSING = 1e3      # cost of each map fewer than were asked for: more than any error
PROMISING = 1.25   # factor on the error up to which a code with a new map is polished
HOPEFUL = 4.0      # the same factor after a removal or a root, and for a line in another projection
NEW_STEPS = 2      # Gauss-Newton steps of a new map
REST_STEPS = 4     # Gauss-Newton steps of all maps after a removal or a root, which move further
# Of refinement.
COARSEST = 128     # cells per side of the first grid; each further grid has twice as many
GRIDS = 4          # grids that each error compares, each half as fine as the one before
RATE = 0.002       # learning rate on the first grid, canvas units, halved on each further grid: maps are nearly right

Value = TypeVar("Value")


class Latest(Generic[Value]):
    """A function of a code, which keeps its value for the code that it was asked about last. Codes are known by their
    numbers."""

    def __init__(self, function: Callable[[WeightedMaps], Value]):
        self.function, self.kept = function, dict[tuple[float, ...], Value]()

    def __call__(self, code: WeightedMaps) -> Value:
        numbers = _numbers(code)
        if numbers not in self.kept:
            self.keep(code, self.function(code))
        return self.kept[numbers]

    def keep(self, code: WeightedMaps, value: Value) -> None:
        """Keep a value that is known already."""
        self.kept = {_numbers(code): value}


def _numbers(code: WeightedMaps) -> tuple[float, ...]:
    return *code.maps.flatten().tolist(), *(() if code.weights is None else code.weights.tolist())


@dataclass(frozen=True)
class CorrectedMeasure:
    """The image's measure on a fine and a coarse grid, corrected for saturation with a code; the correction (R,R), and
    the sum of the corrected masses."""

    fine: BinnedMeasure
    coarse: BinnedMeasure
    correction: Tensor
    total: Tensor

    @classmethod
    def of(cls, masses: Tensor, code: WeightedMaps, objective: ImageObjective, seed: int) -> CorrectedMeasure:
        """The corrected measure of an image's masses (R,R)."""
        params = objective.params
        factors = correction(masses, code.code, objective.levels, params.saturation, seed)
        corrected = masses * factors
        size, known, resolution = grid_for(masses.shape[0], params.moves.grid), objective.levels.known, len(masses)
        grids = [seen(corrected, cells, known) for cells in (size, size // 2)]
        fine, coarse = completed(grids, code, resolution, known, seed)
        return cls(fine, coarse, factors, corrected.sum(dtype=torch.float64))

    def explained(self, rendered: Rendered, volume: Tensor, objective: ImageObjective) -> Tensor:
        """The part (G,G) of the measure that maps of a code of this volume tile, or that their rendering shows. If a
        map is missing, its copies are missing in the rendering too, but the other maps will show them once it is there.
        And where maps tile the measure unlike the grey levels suggest, the difference must not be filled."""
        measure = self.fine
        shares = affine.volumes(rendered.maps) / volume if rendered.weights is None else rendered.weights
        tiled = pushforward(rendered.maps[None], shares[None], measure.samples, measure.size)[0]
        drawn = objective.levels.measure(rendered.image) * self.correction
        if bool(drawn.any()):
            shown = binned(drawn, measure.size)
            tiled = torch.maximum(tiled, shown.bins * (drawn.sum(dtype=torch.float64) / self.total))
        return torch.minimum(tiled, measure.bins)


class Tools:
    """The objective, the price of a map, the deadline, and what is made of a code: its rendering, the noise of one,
    polished and pruned codes, and the image's measure, corrected for saturation. masses (R,R): of the image; noise:
    error between two renderings of one code."""

    def __init__(self, objective: ImageObjective, masses: Tensor, *, noise: float, seed: int = 0,
                 deadline: Deadline = NO_DEADLINE):
        self.objective, self.params, self.masses, self.seed = objective, objective.params, masses, seed
        levels = objective.levels  # without greys, small maps gather around a wrong one and hardly raise the error
        is_sure = levels.is_exact and levels.is_graded and levels.known is None  # nor where most of a map is not seen
        worth = 0.0 if is_sure else self.params.moves.worth
        self.price, self.deadline = Price(self.params.moves.price * noise, worth), deadline
        self.corrected_measure = Latest(
            lambda code: CorrectedMeasure.of(masses, code, objective, derive(seed, "correct")))
        self.shown = Latest(lambda code: objective.judge(code.maps, code.weights))
        self.noise = Latest(lambda code: objective.noise(code.code))

    def score(self, rendered: Rendered) -> float:
        """The error plus the price of the maps; lower is better."""
        missing = max(0, (self.params.maps or 0) - len(rendered.maps))
        return self.price.score(rendered.error, len(rendered.maps)) + MISSING * missing

    def pruned(self, rendered: Rendered) -> Rendered:
        """The code without maps that are not worth their price."""
        return pruned(self.objective, rendered, self.price, self.deadline)

    def polished(self, rendered: Rendered, steps: int, moving: Sequence[int] | None = None) -> Rendered:
        """The code after at most `steps` Gauss-Newton steps."""
        return polished(self.objective, rendered, steps, moving, deadline=self.deadline)

    def polished_last(self, new: Rendered, shown: Rendered) -> Rendered:
        """The new code with its last map polished, if the code is promising."""
        if new.error > PROMISING * shown.error:
            return new
        return self.polished(new, NEW_STEPS, [len(new.maps) - 1])

    def polished_all(self, new: Rendered, shown: Rendered) -> Rendered:
        """The new code with all maps polished, if the code is hopeful."""
        return self.polished(new, REST_STEPS) if new.error < HOPEFUL * shown.error else new

    def refined(self, maps: Tensor, weights: Tensor | None) -> Rendered:
        """The best rendering among the maps (N,6) and their refinements, moved together on ever finer grids.

        Before each grid, the code so far corrects the image's masses for saturation, so that the collage error nearly
        vanishes for the true code. weights (N,) are free to move; None: they are tied to |det| + 0.01.
        """
        refine, size, rate, known = self.params.refine, COARSEST, RATE, self.objective.levels.known
        best = now = self.objective.judge(maps, weights)
        finest = grid_for(self.masses.shape[0], refine.finest)
        while refine.steps and size <= finest:
            how = Descent(refine.steps, rate=rate, largest=self.objective.largest, smaller=SMALLER, prior=0.0,
                          tied=weights is None)
            corrected = saturation_corrected(self.masses, now.code, self.objective.levels, self.params.saturation,
                                             derive(self.seed, "refine", size))
            measure, = completed([seen(corrected, size, known, GRIDS)], now, len(corrected), known, self.seed)
            moved, shares, _ = descend(now.maps[None], now.probabilities[None], measure, how)
            now = self.objective.judge(moved[0], None if weights is None else shares[0] / shares[0].sum())
            best = min(best, now, key=error_of)
            size, rate = 2 * size, rate / 2
        return best
