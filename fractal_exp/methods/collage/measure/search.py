"""Large neighbourhood search over sets of maps: remove some, add new ones, move all, prune.

The scheme is Shaw's (1998), with a continuous repair. One score judges all sets (eq. 5 of docs/method.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ....ops.collage import BinnedMeasure, Descent, collage_error, descend, pushforward
from ....ops.collage.reference import displacement_squared
from ....runtime.params import Interval
from ....runtime.seeds import derive, generator
from .. import maps as affine
from ..bins import attractor_bins, binned, grid_for
from ..params import CollageParams
from ..params.fields import DescentSteps
from ..state import Candidate
from .births import Birthplace


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
        search, births = params.search, params.births
        return cls(search.grid, search.price, search.prior, births.count, births.medium)

    @classmethod
    def detail(cls, params: CollageParams) -> Regime:
        """Stage 2."""
        search, births = params.search, params.births
        return cls(search.detail_grid, search.detail_price, search.detail_prior, births.detail_count, births.small)


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
                 smaller_limit: float = 1.0):
        size = grid_for(masses.shape[0], regime.grid, params.descent)
        self.params, self.regime, self.seed, self.smaller_limit = params, regime, seed, smaller_limit
        self.measure, self.coarse = (binned(masses, cells, params.descent)
                                     for cells in (size, size // params.search.coarser))
        self.slack = params.search.slack * self.measure.bins

    # -- judging ------------------------------------------------------------------------------------------------------

    def cheap_score(self, maps: Tensor, weights: Tensor, error: float) -> float:
        """The score without the attractor's term, which takes longer than all other terms."""
        descent = self.params.descent
        share, tied = weights / weights.sum(), affine.volumes(maps)
        untied = float((share * (share / (tied / tied.sum())).log().square()).sum())
        near = (1 - displacement_squared(maps, self.measure.mean, self.measure.covariance)
                / descent.identity_radius**2).clamp_min(0)
        identity = descent.identity_weight * float((weights * near.square()).sum())
        return error + self._price(len(maps)) + self.regime.prior / 2 * untied + identity

    def _price(self, count: int) -> float:
        """Price of `count` maps. By default, a map too many costs more than it can ever explain."""
        fixed, most = self.params.maps, self.params.most_maps
        excess = max(0, count - (fixed or most or count))
        short = max(0, (fixed or 0) - count)
        return self.regime.price * count + self.params.search.wrong_number * (excess + short)

    def judged(self, maps: Tensor, weights: Tensor, error: float) -> Candidate:
        """The candidate with its score."""
        search = self.params.search
        bins = attractor_bins(maps, weights, self.measure.size, points=search.attractor_points,
                              seed=derive(self.seed, "a"), camera=self.params.camera)
        far = float(collage_error(bins[None], self.measure)[0])
        return Candidate(maps, weights, error,
                         self.cheap_score(maps, weights, error) + search.attractor_weight * far)

    def descend_batch(self, maps: Tensor, weights: Tensor, how: DescentSteps) -> tuple[Tensor, Tensor, Tensor]:
        """A batch of maps (B,N,6) and weights (B,N) after descent on the whole measure, and its errors (B,)."""
        return descend(maps, weights, self.measure, self._descent(how), backgrounds=self.slack[None])

    def descend_one(self, maps: Tensor, weights: Tensor, how: DescentSteps) -> tuple[Tensor, Tensor, float]:
        """One set of maps (N,6) and weights (N,) after descent, and its error."""
        m, w, e = self.descend_batch(maps[None], weights[None], how)
        return m[0], w[0], float(e[0])

    def _descent(self, how: DescentSteps) -> Descent:
        return descent_of(self.params, how, prior=self.regime.prior, smaller=self.smaller_limit)

    # -- starting -----------------------------------------------------------------------------------------------------

    def start(self) -> Candidate:
        """The best mixture of random sets. Each set descends on the coarse grid. Then non-negative least squares
        weights all their maps together, and leaves most weights at zero."""
        search, births, g = self.params.search, self.params.births, generator(self.seed, "start")
        count, slack = search.start_sets * search.start_maps, search.slack
        matrices = affine.random_matrices(count, *births.medium, births.least_ratio, g, reflections=births.reflections)
        place = self.coarse.samples.cpu()[torch.multinomial(self.coarse.samples[:, 2].cpu(), count, True,
                                                            generator=g), :2]
        some = affine.sending(matrices, self.coarse.mean.cpu().expand(count, 2), place)
        some = some.view(search.start_sets, search.start_maps, 6).to(self.slack.device)
        weights = affine.volumes(some)
        weights = (1 - slack) * weights / weights.sum(1, keepdim=True)
        pool, _, _ = descend(some, weights, self.coarse, self._descent(search.start),
                             backgrounds=slack * self.coarse.bins[None])
        return self._mixture(pool.view(-1, 6), self.coarse, search.start_mixture)

    def mixed(self, pool: Tensor) -> Candidate:
        """The best mixture of maps (M,6) from several searches: right maps recur, wrong ones differ."""
        limit = self.smaller_limit + self.params.search.limit_tolerance
        return self._mixture(pool[affine.smaller_singular(pool) < limit], self.measure,
                             self.params.search.restarts_mixture)

    def _mixture(self, pool: Tensor, grid: BinnedMeasure, most: int) -> Candidate:
        """Weight maps (M,6) by non-negative least squares, keep the `most` heaviest, move them and prune them."""
        from scipy.optimize import nnls

        search = self.params.search
        columns = pushforward(pool[:, None].contiguous(), torch.ones_like(pool[:, :1]), grid.samples, grid.size)
        scale = (grid.bins + search.mixture_floor).rsqrt()
        found, _ = nnls((columns * scale).flatten(1).T.cpu().double().numpy(),
                        (grid.bins * scale).flatten().cpu().double().numpy())
        best = np.argsort(-found)[:max(most, self.params.maps or 0)]
        best = torch.from_numpy(best[found[best] >= min(search.least_weight, found.max())].copy())
        weights = torch.from_numpy(found).float()[best]
        weights = (1 - search.slack) * (weights / weights.sum()).to(pool)
        return self.merged(self.pruned(*self.descend_one(pool[best.to(pool.device)], weights, search.mix)))

    def resume(self, found: Candidate) -> Candidate:
        """A candidate of an earlier stage, moved and pruned on this measure."""
        search = self.params.search
        weights = (1 - search.slack) * found.probabilities
        return self.merged(self.pruned(*self.descend_one(found.maps, weights, search.resume)))

    # -- one move -----------------------------------------------------------------------------------------------------

    def step(self, now: Candidate, number: int) -> Candidate:
        """The better of `now` and the best of its neighbours."""
        search, g = self.params.search, generator(self.seed, "step", number)
        sets = self._with_births([self._ruined(now, g) for _ in range(search.proposals)], g)
        batch = _padded([(each.maps, each.weights) for each in sets])
        maps, weights, errors = self.descend_batch(*batch, search.neighbour)
        scores = []
        for i, each in enumerate(sets):
            n = len(each.maps)
            scores.append(self.cheap_score(maps[i, :n], weights[i, :n], float(errors[i])))
        best = int(np.argmin(scores))
        count, error = len(sets[best].maps), float(errors[best])
        if error > search.accept_error * now.error + search.prices * self.regime.price:
            return now
        new = self.pruned(maps[best, :count], weights[best, :count], error)
        if new.score > search.accept_score * now.score:
            return now
        new = self.judged(*self.descend_one(new.maps, new.own_weights, search.accept))
        return self.merged(new) if new.score < now.score else now

    def _ruined(self, now: Candidate, g: torch.Generator) -> _Ruined:
        """The set without some maps, which are close together or anywhere."""
        search, n = self.params.search, len(now.maps)
        if n == 1 or torch.rand((), generator=g) < search.add_only:
            return _Ruined(now.maps, now.own_weights, False, 1 + int(torch.randint(search.add_most, (), generator=g)))
        gone = 1
        while gone < min(n - 1, search.remove_most) and torch.rand((), generator=g) < search.remove_another:
            gone += 1
        if torch.rand((), generator=g) < search.remove_anywhere:
            order = torch.randperm(n, generator=g)
        else:
            centers = (now.maps[:, :4].unflatten(1, (2, 2)) @ self.measure.mean + now.maps[:, 4:]).cpu()
            order = (centers - centers[torch.randint(n, (), generator=g)]).norm(dim=1).argsort()
        keep = order[gone:].sort().values.to(now.maps.device)
        large = bool(torch.rand((), generator=g) < search.large_birth)
        return _Ruined(now.maps[keep], now.own_weights[keep], large, 1 + int(torch.randint(gone, (), generator=g)))

    def _with_births(self, sets: list[_Ruined], g: torch.Generator) -> list[_Ruined]:
        """The sets with their new maps. Maps are added one after another, but to all sets at once."""
        params = self.params
        for turn in range(max(each.births for each in sets)):
            active = [i for i, each in enumerate(sets) if turn < each.births]
            backgrounds = torch.stack([self._explained(sets[i].maps, sets[i].weights) for i in active])
            sizes = [params.births.large if sets[i].large and turn == 0 else self.regime.sizes for i in active]
            born, masses = self._births(backgrounds, sizes, g)
            for row, i in enumerate(active):
                best = torch.rand((), generator=g) < params.search.best_birth
                pick = 0 if best else int(torch.randint(born.shape[1], (), generator=g))
                old = sets[i]
                sets[i] = _Ruined(torch.cat([old.maps, born[row, pick][None]]),
                                  torch.cat([old.weights, masses[row, pick][None]]), old.large, old.births)
        return sets

    def _births(self, backgrounds: Tensor, sizes: list[Interval], g: torch.Generator) -> tuple[Tensor, Tensor]:
        params = self.params
        coarse, fine = (descent_of(params, how, smaller=self.smaller_limit) for how in (params.births.coarse,
                                                                                  params.births.fine))
        place = Birthplace(self.measure, self.coarse, coarse, fine, self.regime.candidates, params.births)
        return place.births(backgrounds, sizes, 1 - params.search.slack, g)

    def _explained(self, maps: Tensor, weights: Tensor) -> Tensor:
        return self.slack + pushforward(maps[None], weights[None], self.measure.samples, self.measure.size)[0]

    # -- simplifying --------------------------------------------------------------------------------------------------

    def pruned(self, maps: Tensor, weights: Tensor, error: float) -> Candidate:
        """The set without maps whose removal, once the others have moved, improves the score."""
        search, score = self.params.search, self.cheap_score(maps, weights, error)
        while len(maps) > 2:  # one map alone has a point as its attractor
            n = len(maps)
            too_many = n > (self.params.maps or self.params.most_maps or n)
            if not (search.pruning or too_many):
                break
            without = weights.expand(n, n) * (1 - torch.eye(n, device=weights.device))
            without = without * (weights.sum() / without.sum(1, keepdim=True))
            bins = pushforward(maps.expand(n, n, 6), without, self.measure.samples, self.measure.size) + self.slack
            errors = collage_error(bins, self.measure)
            tried = errors.argsort()[:search.prune_tried]
            if not too_many:
                rise = max(search.prices * self.regime.price, search.prune_share * error)
                tried = tried[errors[tried] <= error + rise]
            if len(tried) == 0:
                break
            m, w, e = self.descend_batch(maps.expand(len(tried), n, 6).contiguous(), without[tried].contiguous(),
                                         search.prune)
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
        if not self.params.search.merging:
            return now
        one = torch.ones(len(now.maps), 1, device=now.maps.device)
        images = pushforward(now.maps[:, None].contiguous(), one, self.coarse.samples, self.coarse.size)
        roots = images.flatten(1).clamp_min(0).sqrt()
        near = (roots @ roots.T > self.params.search.same_affinity).fill_diagonal_(True)
        leader = near.float().argmax(1)
        leaders = leader.unique()
        if len(leaders) == len(now.maps):
            return now
        weights = torch.stack([now.own_weights[leader == i].sum() for i in leaders])
        merged = self.judged(*self.descend_one(now.maps[leaders], weights, self.params.search.merge))
        return merged if merged.score < now.score else now


def descent_of(params: CollageParams, how: DescentSteps, *, prior: float = 0.0, smaller: float = 1.0,
               tied: bool = False) -> Descent:
    """A descent with these steps and the settings that all descents share."""
    common = params.descent
    return Descent(how.steps, rate=how.rate, weight_rate=common.weight_rate, decay=common.decay, largest=how.largest,
                   smaller=smaller, prior=prior, identity_radius=common.identity_radius,
                   identity_weight=common.identity_weight, tied=tied, beta_1=common.beta_1, beta_2=common.beta_2,
                   epsilon=common.epsilon)


def _padded(sets: list[tuple[Tensor, Tensor]]) -> tuple[Tensor, Tensor]:
    """One batch (B,N,6), (B,N) of sets of different sizes. Weights are zero where there is no map."""
    most = max(len(maps) for maps, _ in sets)
    maps = torch.stack([torch.cat([m, m.new_zeros(most - len(m), 6)]) for m, _ in sets])
    return maps, torch.stack([torch.cat([w, w.new_zeros(most - len(w))]) for _, w in sets])
