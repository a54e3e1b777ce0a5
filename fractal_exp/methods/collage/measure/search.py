"""Large neighbourhood search over sets of maps: remove some, add new ones, move all, prune.

The scheme is Shaw's (1998), with a continuous repair. One score judges all sets (eq. 5 of docs/method.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor
from torch.nn.utils.rnn import pad_sequence

from ....cameras.points import TRAJECTORY, WARMUP
from ....ifs import affine
from ....ops.collage import BinnedMeasure, Descent, collage_error, descend, orbit_bins, pushforward
from ....ops.collage.reference import displacement_squared
from ....runtime.params import Interval
from ....runtime.seeds import derive, generator
from ..bins import binned, grid_for
from ..limits import SMALLER, largest_for, limited
from ..params import CollageParams
from ..state import Candidate
from .births import LARGE, LEAST_RATIO, MEDIUM, SMALL, births

COARSER = 2                  # times fewer cells per side of the grid on which random sets and new maps first descend
# Of a score.
PRICE, DETAIL_PRICE = 2e-4, 1e-4   # cost of a map in stages 1 and 2
PRIOR, DETAIL_PRIOR = 0.01, 0.03   # strength of the prior that pulls weights towards |det| + 0.01 in stages 1 and 2
WRONG_NUMBER = 1.0           # cost of each map too many (for `maps` or `at_most`) or too few (for `maps`)
ATTRACTOR_WEIGHT = 0.5       # of the collage error of the attractor's own measure
ATTRACTOR_POINTS = 200_000   # of the chaos game that estimate this measure
# Of mixtures.
START_SETS, START_MAPS = 40, 8   # random sets that the first mixture of a restart is made from, and maps in each
START_MIXTURE = 14           # maximum number of maps in this mixture
RESTARTS_MIXTURE = 24        # maximum number of maps in the mixture of all restarts
LEAST_WEIGHT = 0.002         # minimum weight of a map in a mixture
MIXTURE_FLOOR = 1e-4         # added to the mass of a cell; its square root divides the cell's residual in least squares
LIMIT_TOLERANCE = 1e-4       # by which a map in a mixture may exceed the limit of the smaller singular value: rounding
# Of a move.
ADD_ONLY = 0.3               # probability that it adds maps without removing any
ADD_MOST = 2                 # maximum number of maps added by such a move; other moves add as many as they removed
REMOVE_ANOTHER = 0.6         # probability, after each removed map, that one more is removed
REMOVE_MOST = 6              # maximum number of maps removed
REMOVE_ANYWHERE = 0.4        # probability that they are drawn from all maps, instead of those nearest to one
LARGE_BIRTH = 0.5            # probability that the first birth after a removal is sought among large maps
BEST_BIRTH = 0.7             # probability that a birth takes the best of the kept candidates, instead of any of them
PRICES = 8.0                 # number of map prices by which the error may rise on the way to a better set
ACCEPT_ERROR = 1.5           # factor on the error, besides these prices, up to which a neighbour is considered further
ACCEPT_SCORE = 1.3           # factor on the score up to which it is considered further after pruning
PRUNE_TRIED = 3              # maps whose removal is tried at a time: those whose absence raises the error least
PRUNE_SHARE = 0.3            # share by which a removal may raise the error to be tried, if it is more than these prices
SAME_AFFINITY = 0.9          # Bhattacharyya affinity of the images of two maps above which merging them is tried
# Descents, within the limits of the shape that is searched.
START = Descent(150, rate=0.03)                 # of the random sets of a restart
MIX = Descent(150, rate=0.015)                  # of a mixture
RESUME = Descent(100, rate=0.004)               # of a set from an earlier stage
NEIGHBOUR = Descent(50, rate=0.01)              # of the neighbours in a move
ACCEPT = Descent(50, rate=0.004)                # of the accepted neighbour
PRUNE = Descent(25, rate=0.006)                 # of a set without one of its maps
MERGE = Descent(50, rate=0.006)                 # of a set after two maps were merged


@dataclass(frozen=True)
class Regime:
    """What differs between stages 1 and 2: cells per side, the price of a map, the strength of the weight prior, the
    number of candidates per birth, and the range of their larger singular value unless large maps are sought."""

    grid: int
    price: float
    prior: float
    candidates: int
    sizes: Interval

    @classmethod
    def whole(cls, params: CollageParams) -> Regime:
        """Stage 1."""
        return cls(params.search.grid, PRICE, PRIOR, params.births.count, MEDIUM)

    @classmethod
    def detail(cls, params: CollageParams) -> Regime:
        """Stage 2."""
        return cls(params.search.detail_grid, DETAIL_PRICE, DETAIL_PRIOR, params.births.count // 2, SMALL)


@dataclass(frozen=True)
class _Ruined:
    """A set without some of its maps, the number of births that replace them, and whether the first is to be large."""

    maps: Tensor
    weights: Tensor
    large: bool
    births: int


class MeasureSearch:
    """The search on one measure at one resolution, from a candidate or from random maps.

    A share `slack` of the measure counts as explained from the start. Without slack, a set that leaves anything out is
    punished so hard that wrong maps are kept to fill the holes. With it, each map is worth what it explains, whatever
    else is missing, so right maps are found one by one. The error of a true code vanishes with any slack.

    masses (R,R): of the image's pixels; smaller_limit: upper limit of a map's smaller singular value. Every random
    number derives from the seed and the move's number.
    """

    def __init__(self, masses: Tensor, regime: Regime, params: CollageParams, seed: int = 0,
                 smaller_limit: float = SMALLER):
        size = grid_for(masses.shape[0], regime.grid)
        self.params, self.regime, self.seed, self.smaller_limit = params, regime, seed, smaller_limit
        self._aim_at(*(self._binned(masses, cells) for cells in (size, size // COARSER)))

    def _binned(self, masses: Tensor, size: int) -> BinnedMeasure:
        return binned(masses, size)

    def _aim_at(self, measure: BinnedMeasure, coarse: BinnedMeasure) -> None:
        self.measure, self.coarse, self.largest = measure, coarse, largest_for(measure.covariance)
        self.slack = self.params.search.slack * measure.bins

    # -- judging ------------------------------------------------------------------------------------------------------

    def cheap_score(self, maps: Tensor, weights: Tensor, error: float) -> float:
        """The score without the attractor's term, which takes longer than all other terms."""
        share, tied = weights / weights.sum(), affine.volumes(maps)
        untied = float((share * (share / (tied / tied.sum())).log().square()).sum())
        near = (1 - displacement_squared(maps, self.measure.mean, self.measure.covariance)
                / Descent.identity_radius**2).clamp_min(0)
        identity = Descent.identity_weight * float((weights * near.square()).sum())
        return error + self._price(len(maps)) + self.regime.prior / 2 * untied + identity

    def _price(self, count: int) -> float:
        """Price of `count` maps. By default, a map too many costs more than it can ever explain."""
        fixed, most = self.params.maps, self.params.most_maps
        excess = max(0, count - (fixed or most or count))
        short = max(0, (fixed or 0) - count)
        return self.regime.price * count + WRONG_NUMBER * (excess + short)

    def judged(self, maps: Tensor, weights: Tensor, error: float) -> Candidate:
        """The candidate with its score."""
        drawable = limited(maps, weights, self.largest)
        if drawable is not maps and not torch.equal(drawable, maps):
            maps, error = drawable, self._error(drawable, weights)
        far = float(collage_error(self._attractor(maps, weights)[None], self.measure)[0])
        return Candidate(maps, weights, error, self.cheap_score(maps, weights, error) + ATTRACTOR_WEIGHT * far)

    def _error(self, maps: Tensor, weights: Tensor) -> float:
        """The collage error."""
        return float(collage_error(self._explained(maps, weights)[None], self.measure)[0])

    def _attractor(self, maps: Tensor, weights: Tensor) -> Tensor:
        """The measure (G,G) of the attractor."""
        count = ATTRACTOR_POINTS // (TRAJECTORY - WARMUP)
        return orbit_bins(maps[None], weights / weights.sum(), self.measure.size, seed=derive(self.seed, "a"),
                          trajectories=count, length=TRAJECTORY, warmup=WARMUP)[0]

    def descend_batch(self, maps: Tensor, weights: Tensor, how: Descent) -> tuple[Tensor, Tensor, Tensor]:
        """A batch of maps (B,N,6) and weights (B,N) after descent on the whole measure, and its errors (B,)."""
        return descend(maps, weights, self.measure, self._descent(how), backgrounds=self.slack[None])

    def descend_one(self, maps: Tensor, weights: Tensor, how: Descent) -> tuple[Tensor, Tensor, float]:
        """One set of maps (N,6) and weights (N,) after descent, and its error."""
        m, w, e = self.descend_batch(maps[None], weights[None], how)
        return m[0], w[0], float(e[0])

    def _descent(self, how: Descent) -> Descent:
        return replace(how, prior=self.regime.prior, largest=self.largest, smaller=self.smaller_limit)

    # -- starting -----------------------------------------------------------------------------------------------------

    def start(self) -> Candidate:
        """The best mixture of random sets. Each set descends on the coarse grid, without a map that stretches: one
        explains much of any shape, and wrong sets grow around it. Then non-negative least squares weights all their
        maps together, and leaves most weights at zero."""
        count, slack, g = START_SETS * START_MAPS, self.params.search.slack, generator(self.seed, "start")
        matrices = affine.random_matrices(count, *MEDIUM, LEAST_RATIO, g, reflections=self.params.births.reflections)
        place = self.coarse.samples.cpu()[torch.multinomial(self.coarse.samples[:, 2].cpu(), count, True,
                                                            generator=g), :2]
        some = affine.sending(matrices, self.coarse.mean.cpu().expand(count, 2), place)
        some = some.view(START_SETS, START_MAPS, 6).to(self.slack.device)
        weights = affine.volumes(some)
        weights = (1 - slack) * weights / weights.sum(1, keepdim=True)
        pool, _, _ = descend(some, weights, self.coarse, replace(self._descent(START), largest=SMALLER),
                             backgrounds=slack * self.coarse.bins[None])
        return self.mixture_of(pool.view(-1, 6), self.coarse, START_MIXTURE)

    def mixed(self, pool: Tensor, best: Candidate) -> Candidate:
        """The best mixture of maps (M,6) from several searches, whose best set is `best`: right maps recur, wrong ones
        differ."""
        limit = self.smaller_limit + LIMIT_TOLERANCE
        return self.mixture_of(pool[affine.smaller_singular(pool) < limit], self.measure, RESTARTS_MIXTURE)

    def mixture_of(self, pool: Tensor, grid: BinnedMeasure, most: int) -> Candidate:
        """Weight maps (M,6) by non-negative least squares, keep the `most` heaviest, move them and prune them."""
        from scipy.optimize import nnls

        columns = pushforward(pool[:, None].contiguous(), torch.ones_like(pool[:, :1]), grid.samples, grid.size)
        scale = (grid.bins + MIXTURE_FLOOR).rsqrt()
        scale = scale if grid.known is None else scale * grid.known
        found, _ = nnls((columns * scale).flatten(1).T.cpu().double().numpy(),
                        (grid.bins * scale).flatten().cpu().double().numpy())
        best = np.argsort(-found)[:max(most, self.params.maps or 0)]
        best = torch.from_numpy(best[found[best] >= min(LEAST_WEIGHT, found.max())].copy())
        weights = torch.from_numpy(found).float()[best]
        weights = (1 - self.params.search.slack) * (weights / weights.sum()).to(pool)
        return self.merged(self.pruned(*self.descend_one(pool[best.to(pool.device)], weights, MIX)))

    def resume(self, found: Candidate) -> Candidate:
        """A candidate of an earlier stage, moved and pruned on this measure."""
        weights = (1 - self.params.search.slack) * found.probabilities
        return self.merged(self.pruned(*self.descend_one(found.maps, weights, RESUME)))

    # -- one move -----------------------------------------------------------------------------------------------------

    def step(self, now: Candidate, number: int) -> Candidate:
        """The better of `now` and the best of its neighbours."""
        g = generator(self.seed, "step", number)
        sets = self._with_births([self._ruined(now, g) for _ in range(self.params.search.proposals)], g)
        tried = self._neighbours([(each.maps, each.weights) for each in sets])
        maps, weights, error = min(tried, key=lambda each: self.cheap_score(*each))
        if error > ACCEPT_ERROR * now.error + PRICES * self.regime.price:
            return now
        new = self.pruned(maps, weights, error)
        if new.score > ACCEPT_SCORE * now.score:
            return now
        new = self.judged(*self.descend_one(new.maps, new.own_weights, ACCEPT))
        return self.merged(new) if new.score < now.score else now

    def _neighbours(self, sets: list[tuple[Tensor, Tensor]]) -> list[tuple[Tensor, Tensor, float]]:
        """Sets of maps (N,6) and weights (N,) after descent, with their errors."""
        padded, shares = (pad_sequence([each[k] for each in sets], batch_first=True) for k in (0, 1))
        maps, weights, errors = self.descend_batch(padded, shares, NEIGHBOUR)   # a weight of 0: no map
        return [(maps[i, :len(m)], weights[i, :len(m)], float(errors[i])) for i, (m, _) in enumerate(sets)]

    def _ruined(self, now: Candidate, g: torch.Generator) -> _Ruined:
        """The set without some maps, which are close together or anywhere."""
        n = len(now.maps)
        if n == 1 or torch.rand((), generator=g) < ADD_ONLY:
            return _Ruined(now.maps, now.own_weights, False, 1 + int(torch.randint(ADD_MOST, (), generator=g)))
        gone = 1
        while gone < min(n - 1, REMOVE_MOST) and torch.rand((), generator=g) < REMOVE_ANOTHER:
            gone += 1
        if torch.rand((), generator=g) < REMOVE_ANYWHERE:
            order = torch.randperm(n, generator=g)
        else:
            centers = (now.maps[:, :4].unflatten(1, (2, 2)) @ self.measure.mean + now.maps[:, 4:]).cpu()
            order = (centers - centers[torch.randint(n, (), generator=g)]).norm(dim=1).argsort()
        keep = order[gone:].sort().values.to(now.maps.device)
        large = bool(torch.rand((), generator=g) < LARGE_BIRTH)
        return _Ruined(now.maps[keep], now.own_weights[keep], large, 1 + int(torch.randint(gone, (), generator=g)))

    def _with_births(self, sets: list[_Ruined], g: torch.Generator) -> list[_Ruined]:
        """The sets with their new maps. Maps are added one after another, but to all sets at once."""
        for turn in range(max(each.births for each in sets)):
            active = [i for i, each in enumerate(sets) if turn < each.births]
            backgrounds = torch.stack([self._explained(sets[i].maps, sets[i].weights) for i in active])
            sizes = [LARGE if sets[i].large and turn == 0 else self.regime.sizes for i in active]
            born, masses = births((self.measure, self.coarse), backgrounds, sizes, self.regime.candidates,
                                  1 - self.params.search.slack, (self.largest, self.smaller_limit),
                                  self.params.births, g)
            for row, i in enumerate(active):
                best = torch.rand((), generator=g) < BEST_BIRTH
                pick = 0 if best else int(torch.randint(born.shape[1], (), generator=g))
                old = sets[i]
                sets[i] = _Ruined(torch.cat([old.maps, born[row, pick][None]]),
                                  torch.cat([old.weights, masses[row, pick][None]]), old.large, old.births)
        return sets

    def _explained(self, maps: Tensor, weights: Tensor) -> Tensor:
        return self.slack + pushforward(maps[None], weights[None], self.measure.samples, self.measure.size)[0]

    # -- simplifying --------------------------------------------------------------------------------------------------

    def pruned(self, maps: Tensor, weights: Tensor, error: float) -> Candidate:
        """The set without maps whose removal, once the others have moved, improves the score."""
        score = self.cheap_score(maps, weights, error)
        while len(maps) > 2:  # one map alone has a point as its attractor
            n = len(maps)
            too_many = n > (self.params.maps or self.params.most_maps or n)
            if not (self.params.search.pruning or too_many):
                break
            without = weights.expand(n, n) * (1 - torch.eye(n, device=weights.device))
            without = without * (weights.sum() / without.sum(1, keepdim=True))
            bins = pushforward(maps.expand(n, n, 6), without, self.measure.samples, self.measure.size) + self.slack
            errors = collage_error(bins, self.measure)
            tried = errors.argsort()[:PRUNE_TRIED]
            if not too_many:
                rise = max(PRICES * self.regime.price, PRUNE_SHARE * error)
                tried = tried[errors[tried] <= error + rise]
            if len(tried) == 0:
                break
            m, w, e = self.descend_batch(maps.expand(len(tried), n, 6).contiguous(), without[tried].contiguous(),
                                         PRUNE)
            options = []
            for i, dropped in enumerate(tried.tolist()):
                keep = torch.arange(n, device=maps.device) != dropped
                options.append((self.cheap_score(m[i, keep], w[i, keep], float(e[i])), m[i, keep], w[i, keep],
                                float(e[i])))
            best = min(options, key=lambda option: option[0])
            if best[0] >= score and not too_many:
                break
            score, maps, weights, error = best
        return self.judged(maps, weights, error)

    def merged(self, now: Candidate) -> Candidate:
        """Merge maps with nearly the same image, if that is better. Two halves of a map hold each other in place, as do
        a map and its composition with a symmetry: removing only one of them would never pay."""
        one = torch.ones(len(now.maps), 1, device=now.maps.device)
        images = pushforward(now.maps[:, None].contiguous(), one, self.coarse.samples, self.coarse.size)
        roots = images.flatten(1).clamp_min(0).sqrt()
        near = (roots @ roots.T > SAME_AFFINITY).fill_diagonal_(True)
        leader = near.float().argmax(1)
        leaders = leader.unique()
        if len(leaders) == len(now.maps):
            return now
        weights = torch.stack([now.own_weights[leader == i].sum() for i in leaders])
        merged = self.judged(*self.descend_one(now.maps[leaders], weights, MERGE))
        return merged if merged.score < now.score else now
