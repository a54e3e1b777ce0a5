"""Large neighbourhood search over sets of maps: remove some, let new ones be born, move all, drop what is not needed.

Shaw 1998 gave the scheme its name; here the repair is continuous. All sets are judged by one score.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from ...ifs.code import IFS
from ...ops.collage import BinnedMeasure, Descent, collage_error, descend, pushforward
from ...ops.collage.reference import displacement_squared
from ...runtime.seeds import derive, generator
from . import maps as affine
from .births import LARGE, MEDIUM, SMALL, births
from .measure import attractor_bins, binned

SLACK = 0.5          # the part of the measure that is there already: see `Search`
ROUNDING = 1e-4      # of a singular value
LEAST = 0.002        # weight in a mixture
SAME = 0.9           # Bhattacharyya affinity of two maps' images above which they are one
LONG, SHORT, POLISH = (Descent(steps=n, rate=r) for n, r in ((150, 0.015), (50, 0.01), (50, 0.004)))
TEST = Descent(steps=25, rate=0.006)
START = Descent(steps=150, rate=0.03, largest=0.97)


@dataclass(frozen=True)
class Tiling:
    """Maps (N,6) and weights (N,) that sum to 1 - SLACK, their collage error, and the score: less is better."""

    maps: Tensor
    weights: Tensor
    error: float
    score: float = float("inf")

    @property
    def chances(self) -> Tensor | None:
        """The weights (N,), summing to 1, or None if they are those of |det| + 0.01."""
        own, tied = affine.normalized(self.weights), affine.normalized(affine.volumes(self.maps))
        return None if torch.allclose(own, tied, rtol=1e-5, atol=1e-7) else own

    @property
    def code(self) -> IFS:
        """The code of the maps."""
        return affine.to_code(self.maps, self.chances)


@dataclass(frozen=True)
class Judge:
    """score = collage error + `attractor` · error of the attractor's own measure, of `points` points + `price` a map
    + half of `prior` · sum w log² (w / p), p in proportion to |det| + 0.01."""

    price: float = 2e-4
    prior: float = 0.01
    attractor: float = 0.5
    points: int = 200_000


class Search:
    """One measure at one resolution, searched from a state or from nothing.

    Maps explain the measure in addition to `SLACK` of itself. Without slack, a set that leaves anything out is
    punished so hard that wrong maps are kept to fill the holes; with it, a map is worth what it explains, whatever
    else is missing, and right maps are found one by one. At a true code the error vanishes with any slack.

    size, coarse: cells a side of the grid that judges and of the one where maps are born; fine_details: whether small
    maps are looked for; fixed: the number of maps where it is known, most: its upper bound; smaller: what the smaller
    singular value of a map may be. Every random number derives from the seed and the number of the step.
    """

    def __init__(self, masses: Tensor, *, size: int, coarse: int, judge: Judge | None = None, seed: int = 0,
                 fine_details: bool = False, fixed: int | None = None, most: int | None = None, proposals: int = 2,
                 count: int = 48, kept: int = 4, smaller: float = 1.0):
        self.judge = judge or Judge()
        self.measure, self.coarse = binned(masses, size), binned(masses, coarse)
        self.slack = SLACK * self.measure.bins
        self.seed, self.fine_details = seed, fine_details
        self.fixed, self.most, self.proposals, self.count, self.kept = fixed, most, proposals, count, kept
        self.smaller = smaller

    # -- judging ------------------------------------------------------------------------------------------------------

    def cheap_score(self, maps: Tensor, weights: Tensor, error: float) -> float:
        """The score without the attractor, which costs more than all the rest."""
        share, tied = weights / weights.sum(), affine.volumes(maps)
        untied = float((share * (share / (tied / tied.sum())).log().square()).sum())
        near = (1 - displacement_squared(maps, self.measure.mean, self.measure.covariance)
                / LONG.identity_radius**2).clamp_min(0)
        identity = LONG.identity_weight * float((weights * near.square()).sum())
        return error + self._price(len(maps)) + self.judge.prior / 2 * untied + identity

    def _price(self, count: int) -> float:
        """Of so many maps; one that is not allowed costs more than it can ever explain."""
        excess = max(0, count - (self.fixed or self.most or count))
        short = max(0, (self.fixed or 0) - count)
        return self.judge.price * count + excess + short

    def judged(self, maps: Tensor, weights: Tensor, error: float) -> Tiling:
        """The tiling with its score."""
        bins = attractor_bins(maps, weights, self.measure.size, points=self.judge.points, seed=derive(self.seed, "a"))
        far = float(collage_error(bins[None], self.measure)[0])
        return Tiling(maps, weights, error, self.cheap_score(maps, weights, error) + self.judge.attractor * far)

    def moved(self, maps: Tensor, weights: Tensor, how: Descent) -> tuple[Tensor, Tensor, Tensor]:
        """A batch (B,N,6), (B,N) after descent on the whole measure."""
        return descend(maps, weights, self.measure, replace(how, prior=self.judge.prior, smaller=self.smaller),
                       backgrounds=self.slack[None])

    def move(self, maps: Tensor, weights: Tensor, how: Descent) -> tuple[Tensor, Tensor, float]:
        """One set (N,6), (N,) after descent."""
        m, w, e = self.moved(maps[None], weights[None], how)
        return m[0], w[0], float(e[0])

    # -- starting -----------------------------------------------------------------------------------------------------

    def start(self, sets: int = 40, maps: int = 8) -> Tiling:
        """The best mixture of what random sets become on the coarse grid: each is moved, then weights for all their
        maps together are found by non-negative least squares, which leaves most at zero."""
        g = generator(self.seed, "start")
        matrices = affine.random_matrices(sets * maps, *MEDIUM, g)
        place = self.coarse.samples.cpu()[torch.multinomial(self.coarse.samples[:, 2].cpu(), sets * maps, True,
                                                            generator=g), :2]
        some = affine.sending(matrices, self.coarse.mean.cpu().expand(sets * maps, 2), place).view(sets, maps, 6)
        some = some.to(self.slack.device)
        weights = affine.volumes(some)
        weights = (1 - SLACK) * weights / weights.sum(1, keepdim=True)
        pool, _, _ = descend(some, weights, self.coarse, replace(START, smaller=self.smaller),
                             backgrounds=SLACK * self.coarse.bins[None])
        return self._mixture(pool.view(-1, 6), self.coarse, 14)

    def mixed(self, pool: Tensor) -> Tiling:
        """The best mixture of maps (M,6) that several searches found: right ones recur, wrong ones differ."""
        return self._mixture(pool[affine.smaller_singular(pool) < self.smaller + ROUNDING], self.measure, 24)

    def _mixture(self, pool: Tensor, grid: BinnedMeasure, most: int) -> Tiling:
        """What becomes of at most so many maps (M,6) with the weights of non-negative least squares."""
        from scipy.optimize import nnls

        columns = pushforward(pool[:, None].contiguous(), torch.ones_like(pool[:, :1]), grid.samples, grid.size)
        scale = (grid.bins + 1e-4).rsqrt()
        found, _ = nnls((columns * scale).flatten(1).T.cpu().double().numpy(),
                        (grid.bins * scale).flatten().cpu().double().numpy())
        best = np.argsort(-found)[:max(most, self.fixed or 0)]
        best = torch.from_numpy(best[found[best] >= min(LEAST, found.max())].copy())
        weights = torch.from_numpy(found).float()[best]
        weights = (1 - SLACK) * (weights / weights.sum()).to(pool)
        return self.unique(self.pruned(*self.move(pool[best.to(pool.device)], weights, LONG)))

    def resume(self, maps: Tensor, weights: Tensor) -> Tiling:
        """The tiling of maps found elsewhere, moved and pruned by this measure."""
        weights = (1 - SLACK) * weights / weights.sum()
        return self.unique(self.pruned(*self.move(maps, weights, Descent(steps=100, rate=0.004))))

    # -- one step -----------------------------------------------------------------------------------------------------

    def step(self, now: Tiling, number: int) -> Tiling:
        """The better of `now` and the best of `proposals` neighbours."""
        g = generator(self.seed, "step", number)
        sets = [self._ruined(now, g) for _ in range(self.proposals)]
        for turn in range(max(adds for *_, adds in sets)):
            active = [i for i, (*_, adds) in enumerate(sets) if turn < adds]
            backgrounds = torch.stack([self._explained(*sets[i][:2]) for i in active])
            sizes = [self._size(sets[i][2] and turn == 0) for i in active]
            born, masses = births(self.coarse, self.measure, backgrounds, (1 - SLACK) / 1.1, sizes,
                                  count=self.count, kept=self.kept, smaller=self.smaller, generator=g)
            for row, i in enumerate(active):
                maps, weights, large, adds = sets[i]
                pick = 0 if torch.rand((), generator=g) < 0.7 else int(torch.randint(self.kept, (), generator=g))
                sets[i] = (torch.cat([maps, born[row, pick][None]]), torch.cat([weights, masses[row, pick][None]]),
                           large, adds)
        maps, weights, errors = self.moved(*_padded([(m, w) for m, w, *_ in sets]), SHORT)
        scores = []
        for i, (m, *_) in enumerate(sets):
            scores.append(self.cheap_score(maps[i, :len(m)], weights[i, :len(m)], float(errors[i])))
        best = int(np.argmin(scores))
        count, error = len(sets[best][0]), float(errors[best])
        if error > 1.5 * now.error + 8 * self.judge.price:
            return now
        new = self.pruned(maps[best, :count], weights[best, :count], error)
        if new.score > 1.3 * now.score:
            return now
        new = self.judged(*self.move(new.maps, new.weights, POLISH))
        return self.unique(new) if new.score < now.score else now

    def _ruined(self, now: Tiling, g: torch.Generator) -> tuple[Tensor, Tensor, bool, int]:
        """The set without some maps, close together or anywhere; whether a large map is wanted; how many births."""
        n = len(now.maps)
        if n == 1 or torch.rand((), generator=g) < 0.3:
            return now.maps, now.weights, False, 1 + int(torch.randint(2, (), generator=g))
        gone = 1
        while gone < min(n - 1, 6) and torch.rand((), generator=g) < 0.6:
            gone += 1
        if torch.rand((), generator=g) < 0.4:
            order = torch.randperm(n, generator=g)
        else:
            centers = (now.maps[:, :4].unflatten(1, (2, 2)) @ self.measure.mean + now.maps[:, 4:]).cpu()
            order = (centers - centers[torch.randint(n, (), generator=g)]).norm(dim=1).argsort()
        keep = order[gone:].sort().values.to(now.maps.device)
        large = bool(torch.rand((), generator=g) < 0.5)
        return now.maps[keep], now.weights[keep], large, 1 + int(torch.randint(gone, (), generator=g))

    def _size(self, large: bool) -> tuple[float, float]:
        return LARGE if large else SMALL if self.fine_details else MEDIUM

    def _explained(self, maps: Tensor, weights: Tensor) -> Tensor:
        return self.slack + pushforward(maps[None], weights[None], self.measure.samples, self.measure.size)[0]

    # -- simplifying --------------------------------------------------------------------------------------------------

    def pruned(self, maps: Tensor, weights: Tensor, error: float) -> Tiling:
        """The set without the maps whose removal, after the others have moved, does not worsen the score."""
        score = self.cheap_score(maps, weights, error)
        while len(maps) > 2:
            n = len(maps)
            too_many = n > (self.fixed or self.most or n)
            without = weights.expand(n, n) * (1 - torch.eye(n, device=weights.device))
            without = without * (weights.sum() / without.sum(1, keepdim=True))
            bins = pushforward(maps.expand(n, n, 6), without, self.measure.samples, self.measure.size) + self.slack
            errors = collage_error(bins, self.measure)
            tried = errors.argsort()[:3]
            if not too_many:
                tried = tried[errors[tried] <= error + max(8 * self.judge.price, 0.3 * error)]
            if len(tried) == 0:
                break
            m, w, e = self.moved(maps.expand(len(tried), n, 6).contiguous(), without[tried].contiguous(), TEST)
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

    def unique(self, now: Tiling) -> Tiling:
        """The set with maps of nearly the same image made one, if that is better: two halves of a map hold each other
        in place, as do a map and its composition with a symmetry, and no removal of one alone would ever pay."""
        one = torch.ones(len(now.maps), 1, device=now.maps.device)
        images = pushforward(now.maps[:, None].contiguous(), one, self.coarse.samples, self.coarse.size)
        roots = images.flatten(1).clamp_min(0).sqrt()
        near = roots @ roots.T > SAME
        leader = near.float().argmax(1)
        leaders = leader.unique()
        if len(leaders) == len(now.maps):
            return now
        weights = torch.stack([now.weights[leader == i].sum() for i in leaders])
        merged = self.judged(*self.move(now.maps[leaders], weights, replace(SHORT, rate=0.006)))
        return merged if merged.score < now.score else now


def _padded(sets: list[tuple[Tensor, Tensor]]) -> tuple[Tensor, Tensor]:
    """One batch (B,N,6), (B,N) of sets of different sizes, weights zero where there is no map."""
    most = max(len(maps) for maps, _ in sets)
    maps = torch.stack([torch.cat([m, m.new_zeros(most - len(m), 6)]) for m, _ in sets])
    return maps, torch.stack([torch.cat([w, w.new_zeros(most - len(w))]) for _, w in sets])
