"""Large neighbourhood search again, one map at a time, judged by the picture itself.

What is left to find after `search` are maps so small, thin or faint that they weigh next to nothing as a measure, yet
are seen, and small copies that lie the wrong way round. Drawing a code tells at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import torch
from torch import Tensor

from ...ifs.code import PROBABILITY_FLOOR
from ...ops.collage import BinnedMeasure, Descent, descend, pushforward
from ...runtime.seeds import derive, generator
from . import maps as affine
from .births import candidates, flattened, mirrored, turned, visible_weights
from .frame import Frame
from .jacobian import Redrawn, played
from .lines import profiled
from .measure import binned, correction, halve
from .picture import Drawn, Picture
from .polish import fitted_into_frame, never, polished
from .refine import grid_for, refined
from .rounding import Rounding
from .search import Tiling
from .superfluous import needed, without_superfluous

PRICE = 0.04                   # of a map, in units of a drawing's noise
CANDIDATES, MOVED, DRAWN = 24, 6, 3   # maps born in a move; those of them that are moved finely, and drawn
WIDTHS = (1, 0.25, 0.03)       # times that of a new image, drawn as well
THIN = 0.1                     # times its length: the width of an image that is a line
WIDEST_PX = 2                  # four standard deviations of it
PROFILED, PROFILE_POINTS = 2, 50_000   # lines drawn of those that the light along one tells of, from so many points
SIZES = (0.02, 0.95)           # of the larger singular values at birth
ROUGHLY = Descent(steps=40, rate=0.02, prior=0.0, largest=0.98)
FINELY = Descent(steps=20, rate=0.005, prior=0.0, largest=0.98)
SETTLED, LENIENCE = 1.05, 0.005   # times the noise of a drawing, an error that the true code may have; more a move
OWN_WEIGHTS = 0.8              # times the error with tied ones: what makes weights of its own worth it
FAR = 30                       # noises from which on the frame tells nothing
UNSETTLED, CLOSE = 1.1, 6      # times a drawing's noise: errors between which the dearest polish is worth while,
REDRAWN = 3                    # of so many steps
ROOTS_ERROR, LOW = 30, 0.5     # times the error before, or this if that is lower: of a root that may be one
ROOTS_MAPS = 10                # up to so many maps, where the code is hopeless: N maps take 1.5 N² drawings
ORDERS, ROOTED = (2, 3), 2     # roots that are tried, and of how many of the largest maps at the start
MISSING = 1e3                  # the price of a map fewer than there must be
HOPELESS = 0.4                 # radians, rms (`Picture.angle`): from here on a picture is taken to be of no code
PROMISING, HOPEFUL = 1.25, 4   # times the error before: worth a polish of a new map, and of all where some are gone
POLISH, DRAWINGS = 8, 4        # steps of all maps at the start and the end, and drawings at the very end


class _Measures(NamedTuple):
    """The picture's measure, corrected by what the code of these maps hides of its own, on a fine grid and a coarse
    one; the correction (R,R), and the sum of what it was applied to."""

    maps: Tensor
    fine: BinnedMeasure
    coarse: BinnedMeasure
    correction: Tensor
    total: Tensor


class PictureSearch:
    """A `Picture` searched from a tiling; noise: of its drawings. Every random number derives from the seed and the
    number of the step."""

    def __init__(self, picture: Picture, masses: Tensor, *, noise: float, finest: int = 256, seed: int = 0,
                 fixed: int | None = None, most: int | None = None, late: Callable[[], bool] = never):
        self.picture, self.masses, self.finest, self.seed = picture, masses, finest, seed
        self.price, self.late = PRICE * noise, late
        self.fixed, self.most = fixed, most
        self._shown: Drawn | None = None
        self._measured: _Measures | None = None
        self._noise: tuple[Tensor, float] | None = None

    def resume(self, tiling: Tiling) -> Tiling:
        """The best drawing of the tiling and its refinements, with its own weights or those of |det| + 0.01."""
        tied, own = (self._polished(refined(self.picture, self.masses, tiling.maps, weights, self.finest, self.seed),
                                    POLISH // 2) for weights in (None, tiling.weights))
        best = self._polished(self._needed(self._simpler(tied, own)), POLISH // 2)
        for chosen in affine.volumes(best.maps).argsort(descending=True)[:0 if self.fixed else ROOTED].tolist():
            if self.late():
                break
            rooted = min((self._rooted(best, chosen, order) for order in ORDERS), key=self._score)
            if self._score(rooted) < self._score(best):
                return self._tiling(self._polished(rooted, POLISH // 2))
        return self._tiling(best)

    def step(self, now: Tiling, number: int) -> Tiling:
        """`now`, or a better neighbour."""
        g = generator(self.seed, "picture step", number)
        shown = self._drawn(now)
        new = self._move(shown, g)(shown, g)
        if self._score(new) >= self._score(shown):
            return now
        return self._tiling(self._polished(new, 1))

    def tidied(self, now: Tiling) -> Tiling:
        """Without maps that the picture does not ask for, and polished for long."""
        shown = self._drawn(now)
        new = self._polished(self._needed(shown), POLISH)
        return self._tiling(new) if self._score(new) < self._score(shown) else now

    def finish(self, now: Tiling) -> Tiling:
        """Tidied, and polished on several drawings at once, whose noise is less, if it is noise that is left."""
        tidied = self.tidied(now)
        if self.is_hopeless(tidied):
            return tidied
        found = self._drawn(tidied)
        if found.weights is not None:
            tied = self._polished(self.picture.judge(found.maps), POLISH)
            found = self._simpler(tied, found)
        last = self._last_judged(found)
        near = self.noises(self._tiling(last)) < FAR
        fewer = without_superfluous(self.picture, last, self.price, self.fixed or 0, near=near, late=self.late)
        if len(fewer.maps) < len(last.maps):
            last = min(last, self._last_judged(fewer), key=self._score)
        return self._tiling(last)

    def _last_judged(self, found: Drawn) -> Drawn:
        """After the last polish, drawn once."""
        last = self._last_polish(found)
        return self.picture.judge(last.maps, last.weights)

    def _last_polish(self, found: Drawn) -> Drawn:
        """Polished on several drawings at once, whose noise is less, and into the frame; and where more than noise is
        left, by the slopes of drawings."""
        careful = self._careful()
        frame = Frame.of(self.picture.image) if self.noises(self._tiling(found)) < FAR else None
        best = fitted_into_frame(careful, careful.judge(found.maps, found.weights), POLISH, frame, late=self.late)
        noises = self.noises(self._tiling(self.picture.judge(best.maps, best.weights)))
        if UNSETTLED < noises < CLOSE and not self.late():
            once = self.picture.within(Frame.of(self.picture.image))
            last = polished(once, once.judge(best.maps, best.weights), REDRAWN, late=self.late, slopes=Redrawn,
                            alone=True)
            best = min(best, careful.judge(last.maps, last.weights), key=_error)
        return best

    def _careful(self) -> Picture:
        return Picture(self.picture.image, self.picture.levels, self.seed, DRAWINGS, self.picture.maps_at_once)

    def simplified(self, now: Tiling) -> Tiling | None:
        """With simple numbers rounded, or None if there are none."""
        careful = self._careful()
        found, held = Rounding(careful, self.late).simplified(careful.judge(now.maps, now.chances))
        return self._tiling(self.picture.judge(found.maps, found.weights)) if held else None

    def judged(self, tiling: Tiling) -> Tiling:
        """The tiling with the error and score that it has here."""
        return self._tiling(self.picture.judge(tiling.maps, tiling.chances))

    def settled(self, now: Tiling, moves: int) -> bool:
        """Whether the code draws the picture as well as the true one would; after many moves, nearly as well."""
        return self.noises(now) < SETTLED + LENIENCE * moves and len(now.maps) >= (self.fixed or 0)

    def noises(self, now: Tiling) -> float:
        """The error, in units of that of another drawing of the same code."""
        shown = self._drawn(now)
        if self._noise is None or self._noise[0] is not shown.maps:
            self._noise = shown.maps, self.picture.noise(shown.code)
        return shown.error / self._noise[1]

    def is_hopeless(self, code: Drawn | Tiling) -> bool:
        """Whether the code is so far from the picture that there may be none: what is dear and only leads to a true
        code, as roots of one of many maps, the last polish and another round, is then in vain."""
        return self.picture.angle(code.error) >= HOPELESS

    @staticmethod
    def _simpler(tied: Drawn, own: Drawn) -> Drawn:
        """Weights of its own must be worth it: they follow noise, and stay behind where the maps move."""
        return own if own.error < OWN_WEIGHTS * tied.error else tied

    # -- parts of a step ----------------------------------------------------------------------------------------------

    def _move(self, shown: Drawn, g: torch.Generator) -> Callable[[Drawn, torch.Generator], Drawn]:
        """What to do, by chance."""
        n = len(shown.maps)
        full, fewer = n >= (self.fixed or self.most or n + 1), n > 2 and not self.fixed
        chances = {self._birth: 0.36 * (not full), self._turned: 0.24 * (n > 1), self._replaced: 0.15 * (n > 1),
                   self._fewer: 0.17 * fewer, self._root: 0.08 * fewer}
        return list(chances)[int(torch.multinomial(torch.tensor(list(chances.values())), 1, generator=g))]

    def _small(self, shown: Drawn, g: torch.Generator, count: int = 1) -> list[int]:
        """Maps by chance, small ones more often."""
        return torch.multinomial(1 / affine.volumes(shown.maps).cpu(), count, generator=g).tolist()

    def _birth(self, shown: Drawn, g: torch.Generator) -> Drawn:
        """A map more."""
        return self._fitted(self._grown(shown, shown, None, g), shown)

    def _turned(self, shown: Drawn, g: torch.Generator) -> Drawn:
        """A map turned or mirrored in its place."""
        gone = self._small(shown, g)
        rest, old = self.picture.without(shown, gone), shown.maps[gone[0]]
        found = [self._fitted(self._grown(rest, shown, old, g), shown)]
        if self.picture.levels.graded and self._is_line(old, shown) and not self.late():
            found += self._relaid(rest, shown, gone[0])
        return min(found, key=_error)

    def _replaced(self, shown: Drawn, g: torch.Generator) -> Drawn:
        """Another map instead of one."""
        return self._fitted(self._grown(self.picture.without(shown, self._small(shown, g)), shown, None, g), shown)

    def _fewer(self, shown: Drawn, g: torch.Generator) -> Drawn:
        """One to three maps gone: small ones that make up for what is wrong in another hold it where it is."""
        most = min(len(shown.maps) - 2, 3)
        gone = self._small(shown, g, 1 + int(torch.randint(most, (), generator=g)))
        return self._settled(self.picture.without(shown, gone), shown)

    def _root(self, shown: Drawn, g: torch.Generator) -> Drawn:
        """The square or cube root of a large map instead of it, and what is then superfluous gone: an attractor is also
        that of the code in which f stands squared and the other maps g have company, f∘g."""
        chosen = int(torch.multinomial(affine.volumes(shown.maps).cpu(), 1, generator=g))
        return self._rooted(shown, chosen, ORDERS[int(torch.randint(len(ORDERS), (), generator=g))])

    def _rooted(self, shown: Drawn, chosen: int, order: int) -> Drawn:
        """The code with the root f of one map, or as it is if that map has none. What was found beside a power of f may
        be f∘g instead of g: both are given to choose from."""
        if len(shown.maps) > ROOTS_MAPS and self.is_hopeless(shown):
            return shown
        root = affine.root(shown.maps[chosen], order)
        if root is None:
            return shown
        others = torch.cat([shown.maps[:chosen], shown.maps[chosen + 1:]])
        alone = self.picture.judge(torch.cat([root[None], others]))
        if alone.error > ROOTS_ERROR * max(shown.error, LOW):
            return shown
        both = self.picture.judge(torch.cat([root[None], others, affine.preceded(root, others)]))
        new = self._needed(both)
        return shown if len(new.maps) > (self.most or len(new.maps)) else self._settled(new, shown)

    def _fitted(self, new: Drawn, shown: Drawn) -> Drawn:
        """With its last map polished, if that is promising."""
        if new.error > PROMISING * shown.error:
            return new
        return self._polished(new, 2, [len(new.maps) - 1])

    def _settled(self, new: Drawn, shown: Drawn) -> Drawn:
        """With all maps polished, if there is hope."""
        return self._polished(new, 4) if new.error < HOPEFUL * shown.error else new

    def _grown(self, drawn: Drawn, shown: Drawn, old: Tensor | None, g: torch.Generator) -> Drawn:
        """A part of the shown code and the likeliest of many maps born where it lacks mass, or, with an old one (6,)
        that is missing in it, of many turned ones."""
        measures = self._measures(shown)
        measure, coarse = measures.fine, measures.coarse
        volume = affine.volumes(shown.maps).sum()
        explained = self._explained(drawn, measures, volume)
        drawings = []
        if old is not None:
            born = turned(old, measure, CANDIDATES, g)
            if affine.thinness(old, measure) < THIN:  # no grid tells which way a line lies
                lines = flattened(born, measure, WIDTHS[-1])
                drawings += [self._with(drawn, each, affine.volumes(each[None])[0] / volume) for each in lines]
        else:
            wanted = (measure.bins.clamp_min(0).sqrt() - explained.clamp_min(0).sqrt()).square() + 1e-12
            born = candidates(wanted, wanted, measure, SIZES, CANDIDATES, CANDIDATES // 2, g)
        background, coarsely = explained[None], halve(explained[None], coarse.size)
        lacking = (measure.bins - explained).clamp_min(0).sum()
        weights = (affine.volumes(born) / volume).clamp_max(lacking).clamp_min(1e-6)
        weights = visible_weights(born, weights, coarse, coarsely)
        born, weights, errors = descend(born[:, None], weights[:, None], coarse, ROUGHLY, backgrounds=coarsely)
        best = errors.argsort()[:MOVED]
        born, weights, errors = descend(born[best], weights[best], measure, FINELY, backgrounds=background)
        best = errors.argsort()[:DRAWN]
        born, weights = born[best, 0], weights[best, 0]
        first = torch.cat([flattened(born[:1], measure, width) for width in WIDTHS])
        widths = [self._with(drawn, each, weights[0]) for each in first]
        width = min(range(len(WIDTHS)), key=lambda k: widths[k].error)
        drawings += [*widths, *(self._with(drawn, each, weight) for each, weight in
                     zip(flattened(born[1:], measure, WIDTHS[width]), weights[1:], strict=True))]
        likeliest = min(drawings, key=_error).maps[-1]
        for model in (likeliest, old) if old is not None else (likeliest,):
            drawings += [self._with(drawn, each, weights[0]) for each in mirrored(model, measure)]
        return min(drawings, key=_error)

    def _is_line(self, old: Tensor, shown: Drawn) -> bool:
        """Whether the image of the map (6,) is thin, and within the pixels that it crosses."""
        measure = self._measures(shown).fine
        side = self.picture.image.shape[0]
        return affine.thinness(old, measure) < THIN and 2 * side * affine.width(old, measure) < WIDEST_PX

    def _relaid(self, rest: Drawn, shown: Drawn, gone: int) -> list[Drawn]:
        """The rest of the code and the map that is gone, a line, in the other ways that the light along it tells of;
        the hopeful ones polished."""
        volumes = affine.volumes(rest.maps).sum() + PROBABILITY_FLOOR
        share = PROBABILITY_FLOOR / volumes if rest.weights is None else shown.chances[gone]
        points = played(shown.maps, shown.chances, PROFILE_POINTS, derive(self.picture.seed, "profile"))
        lines = profiled(shown.maps[gone], float(share), points, self.picture.image, rest.image,
                         self.picture.levels.supersample, PROFILED)
        drawings = [self._with(rest, each, share) for each in lines]
        return [self._polished(each, 3, [len(each.maps) - 1]) for each in drawings
                if each.error < HOPEFUL * shown.error]

    def _explained(self, drawn: Drawn, measures: _Measures, volume: Tensor) -> Tensor:
        """The part (G,G) of the measure that maps of a code of this volume tile or their drawing shows. Where a map is
        missing, so are its copies in the drawing, which the other maps will show as soon as it is there; and what
        tiles the measure in another way than the grey levels tell is not to be filled up."""
        measure = measures.fine
        shares = affine.volumes(drawn.maps) / volume if drawn.weights is None else drawn.weights
        tiled = pushforward(drawn.maps[None], shares[None], measure.samples, measure.size)[0]
        seen = self.picture.levels.measure(drawn.image) * measures.correction
        if bool(seen.any()):
            tiled = torch.maximum(tiled, binned(seen, measure.size).bins * (seen.sum() / measures.total))
        return torch.minimum(tiled, measure.bins)

    def _measures(self, shown: Drawn) -> _Measures:
        if self._measured is None or self._measured.maps is not shown.maps:
            factors = correction(self.masses, shown.code, self.picture.levels, derive(self.seed, "correct"))
            corrected = self.masses * factors
            size = grid_for(self.masses.shape[0], 128)
            self._measured = _Measures(shown.maps, binned(corrected, size), binned(corrected, size // 2), factors,
                                       corrected.sum())
        return self._measured

    # -- codes and drawings -------------------------------------------------------------------------------------------

    def _needed(self, drawn: Drawn) -> Drawn:
        return needed(self.picture, drawn, self.price, self.fixed or 0, late=self.late)

    def _polished(self, drawn: Drawn, steps: int, moving: Sequence[int] | None = None) -> Drawn:
        return polished(self.picture, drawn, steps, moving, late=self.late)

    def _with(self, drawn: Drawn, born: Tensor, weight: Tensor) -> Drawn:
        return self.picture.judge(torch.cat([drawn.maps, born[None]]),
                                  None if drawn.weights is None else torch.cat([drawn.weights, weight[None]]))

    def _score(self, drawn: Drawn) -> float:
        missing = max(0, (self.fixed or 0) - len(drawn.maps))
        return drawn.error + self.price * len(drawn.maps) + MISSING * missing

    def _tiling(self, drawn: Drawn) -> Tiling:
        # as one that is resumed has them
        self._shown = drawn if drawn.weights is None else replace(drawn, weights=drawn.chances)
        return Tiling(drawn.maps, drawn.chances, drawn.error, self._score(drawn))

    def _drawn(self, now: Tiling) -> Drawn:
        if self._shown is None or self._shown.maps is not now.maps:
            self._shown = self.picture.judge(now.maps, now.chances)
        return self._shown


def _error(drawn: Drawn) -> float:
    return drawn.error
