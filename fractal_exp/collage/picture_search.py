"""Large neighbourhood search again, one map at a time, judged by the picture itself.

What is left to find after `search` are maps so small, thin or faint that they weigh next to nothing as a measure, yet
are seen, and small copies that lie the wrong way round. Drawing a code tells at once.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, avg_pool2d

from ..ops.collage import BinnedMeasure, Descent, descend, pushforward
from ..seeds import derive, generator
from . import maps as affine
from .births import candidates, turned
from .measure import binned, desaturated, halve
from .picture import Drawn, Picture
from .polish import never, polished
from .refine import grid_for, refined
from .search import Tiling

PRICE = 0.04                   # of a map, in units of a drawing's noise
CANDIDATES, MOVED, DRAWN = 24, 6, 3   # maps born in a move; those of them that are moved finely, and drawn
SIZES = (0.02, 0.6)            # of the larger singular values at birth
ROUGHLY = Descent(steps=40, rate=0.02, prior=0.0, largest=0.98)
FINELY = Descent(steps=20, rate=0.005, prior=0.0, largest=0.98)
SETTLED = 1.05                 # times the noise of a drawing: an error that the true code may have
OWN_WEIGHTS = 0.8              # times the error with tied ones: what makes weights of its own worth it
MISSING = 1e3                  # the price of a map fewer than there must be
PROMISING = 1.25               # times the score before: what is worth a polish
BIRTHS, TURNS, REPLACEMENTS = 0.5, 0.25, 0.2   # the chances of a move; the rest are removals
POLISH = 8                     # steps of all maps at the start and the end


class PictureSearch:
    """A `Picture` searched from a tiling; noise: of its drawings. Every random number derives from the seed and the
    number of the step."""

    def __init__(self, picture: Picture, masses: Tensor, *, noise: float, finest: int = 256, seed: int = 0,
                 fixed: int | None = None, most: int | None = None, late: Callable[[], bool] = never):
        self.picture, self.masses, self.finest, self.seed = picture, masses, finest, seed
        self.price, self.late = PRICE * noise, late
        self.fixed, self.most = fixed, most
        self._shown: Drawn | None = None
        self._measured: tuple[Tensor, tuple[BinnedMeasure, BinnedMeasure]] | None = None
        self._noise: tuple[Tensor, float] | None = None

    def resume(self, tiling: Tiling) -> Tiling:
        """The best drawing of the tiling and its refinements, with its own weights or those of |det| + 0.01."""
        tied, own = (self._polished(refined(self.picture, self.masses, tiling.maps, weights, self.finest, self.seed),
                                    POLISH // 2) for weights in (None, tiling.weights))
        return self._tiling(self._polished(self._simpler(tied, own), POLISH // 2))

    def step(self, now: Tiling, number: int) -> Tiling:
        """`now`, or a better neighbour."""
        g = generator(self.seed, "picture step", number)
        shown = self._drawn(now)
        kind, gone = self._move(shown, g)
        keep = [i for i in range(len(shown.maps)) if i != gone]
        without = self._judge(shown, keep) if kind in ("replace", "remove") else shown
        if kind == "remove":
            new = without
        else:
            born = self._born(shown, keep, without, None if kind != "turn" else gone, g)
            new = min((self._judge(shown, keep, *pair) for pair in born), key=lambda drawn: drawn.error)
            if new.error < PROMISING * shown.error:
                new = self._polished(new, 2, [len(new.maps) - 1])
        if self._score(new) >= self._score(shown):
            return now
        return self._tiling(self._polished(new, 1))

    def finish(self, now: Tiling) -> Tiling:
        """Polished once more."""
        found = self._polished(self._drawn(now), POLISH)
        if found.weights is not None:
            tied = self._polished(self.picture.judge(found.maps), POLISH)
            found = self._simpler(tied, found)
        return self._tiling(found)

    def settled(self, now: Tiling) -> bool:
        """Whether the code draws the picture as well as the true one would."""
        shown = self._drawn(now)
        if self._noise is None or self._noise[0] is not shown.maps:
            self._noise = shown.maps, self.picture.noise(shown.code)
        return shown.error < SETTLED * self._noise[1] and len(shown.maps) >= (self.fixed or 0)

    @staticmethod
    def _simpler(tied: Drawn, own: Drawn) -> Drawn:
        """Weights of its own must be worth it: they follow noise, and stay behind where the maps move."""
        return own if own.error < OWN_WEIGHTS * tied.error else tied

    # -- parts of a step ----------------------------------------------------------------------------------------------

    def _move(self, shown: Drawn, g: torch.Generator) -> tuple[str, int | None]:
        """What to do, and the map that goes for it, small ones more often."""
        n, roll = len(shown.maps), float(torch.rand((), generator=g))
        small = int(torch.multinomial(1 / affine.volumes(shown.maps).cpu(), 1, generator=g))
        full = n >= (self.fixed or self.most or n + 1)
        if not full and (n < 2 or roll < BIRTHS):
            return "birth", None
        if roll < BIRTHS + TURNS:
            return "turn", small
        if roll < BIRTHS + TURNS + REPLACEMENTS or self.fixed or n < 3:
            return "replace", small
        return "remove", small

    def _born(self, shown: Drawn, keep: list[int], without: Drawn, turning: int | None, g: torch.Generator
              ) -> list[tuple[Tensor, Tensor]]:
        """The likeliest of many new maps (6,) beside those kept, with their weights."""
        measure, coarse = self._measures(shown)
        background = pushforward(shown.maps[keep][None], shown.chances[keep][None], measure.samples, measure.size)
        if turning is not None:
            born = turned(shown.maps[turning], measure, CANDIDATES, g)
        else:
            wanted = self._unexplained(without, measure.size)
            born = candidates(wanted, wanted, measure, SIZES, CANDIDATES, CANDIDATES // 2, g)
        lacking = (measure.bins - background[0]).clamp_min(0).sum()
        weights = (affine.volumes(born) / affine.volumes(shown.maps).sum()).clamp_max(lacking).clamp_min(1e-6)
        born, weights, errors = descend(born[:, None], weights[:, None], coarse, ROUGHLY,
                                        backgrounds=halve(background, coarse.size))
        best = errors.argsort()[:MOVED]
        born, weights, errors = descend(born[best], weights[best], measure, FINELY, backgrounds=background)
        return [(born[i, 0], weights[i]) for i in errors.argsort()[:DRAWN]]

    def _unexplained(self, without: Drawn, size: int) -> Tensor:
        """Where (G,G) the picture is brighter than the drawing, by significance."""
        residual = self.picture.residuals(without.image)[0]
        lit = self.picture.grids(self.picture.image)[0] > 0
        missing = avg_pool2d(residual[None], 3, 1, 1)[0].clamp_min(0).square() * lit
        return adaptive_avg_pool2d(missing[None], size)[0] + 1e-9

    def _measures(self, shown: Drawn) -> tuple[BinnedMeasure, BinnedMeasure]:
        """The picture's measure, corrected by what the code hides of its own, on a fine grid and a coarse one."""
        if self._measured is None or self._measured[0] is not shown.maps:
            corrected = desaturated(self.masses, shown.code, self.picture.levels, derive(self.seed, "correct"))
            size = grid_for(self.masses.shape[0], 128)
            self._measured = shown.maps, (binned(corrected, size), binned(corrected, size // 2))
        return self._measured[1]

    # -- codes and drawings -------------------------------------------------------------------------------------------

    def _polished(self, drawn: Drawn, steps: int, moving: list[int] | None = None) -> Drawn:
        return polished(self.picture, drawn, steps, moving, late=self.late)

    def _judge(self, shown: Drawn, keep: list[int], born: Tensor | None = None, weight: Tensor | None = None) -> Drawn:
        maps = shown.maps[keep] if born is None else torch.cat([shown.maps[keep], born[None]])
        weights = None
        if shown.weights is not None:
            weights = shown.chances[keep] if weight is None else torch.cat([shown.chances[keep], weight])
        return self.picture.judge(maps, weights)

    def _score(self, drawn: Drawn) -> float:
        missing = max(0, (self.fixed or 0) - len(drawn.maps))
        return drawn.error + self.price * len(drawn.maps) + MISSING * missing

    def _tiling(self, drawn: Drawn) -> Tiling:
        self._shown = drawn
        return Tiling(drawn.maps, drawn.chances, drawn.error, self._score(drawn))

    def _drawn(self, now: Tiling) -> Drawn:
        if self._shown is None or self._shown.maps is not now.maps:
            self._shown = self.picture.judge(now.maps, now.chances)
        return self._shown
