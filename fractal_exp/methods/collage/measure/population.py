"""Many sets with the same number of maps: each set descends alone, and sets are crossed.

A set of given size that must explain the whole measure has many local optima. But a right map of one set may be missing
in another, and the descent of a set is quick. So a genetic algorithm whose children descend (a memetic
algorithm, Moscato 1989) finds the code where no single set would.
"""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from ....ifs import affine
from ....ifs.canvas import pixel_to_canvas
from ....ops.collage import Descent, descend, pushforward
from ....runtime.seeds import generator
from ..bins import binned, grid_for
from ..params import CollageParams

CROSSED = 0.5        # probability that a child takes maps from another set, instead of random maps
TWO = 0.45           # probability that two maps are replaced, not one
GRID = 32            # cells per side on which sets descend
SIZES = 0.15, 0.85   # range of the larger singular value of a random map
LEAST_RATIO = 0.2    # minimum ratio of its singular values
FAINT = 0.02         # mass of a cell, relative to the mean cell, up to which it is no sample
ANYWHERE = 1e-9      # mass added to each cell when a map is born where mass is missing: perhaps none is
ALIKE = 0.002        # relative difference of errors below which two sets count as one; a random set replaces it
DESCENT = Descent(80, rate=0.03, largest=0.95)   # of each set


class Population:
    """Sets of `count` maps that explain the measure of masses (R,R), best first: `maps` (P,N,6), `weights` (P,N) and
    their collage `errors` (P,). Every random number derives from the seed and the generation's number."""

    def __init__(self, masses: Tensor, count: int, params: CollageParams, seed: int = 0):
        self.params, self.count, self.seed = params.population, count, seed
        self.reflections = params.births.reflections
        measure = binned(masses, grid_for(masses.shape[0], GRID))
        samples = measure.samples[measure.samples[:, 2] > FAINT / measure.size**2].clone()
        samples[:, 2] /= samples[:, 2].sum()
        self.measure = replace(measure, samples=samples)  # without faint samples: there are many, and they tell little
        self.generation = 0
        first = self._descended(*self._random(self.params.first, generator(seed, "first")))
        self.maps, self.weights, self.errors = (each[:self.params.size] for each in _sorted(*first))

    @property
    def probabilities(self) -> Tensor:
        """(P,N); each set sums to 1."""
        return self.weights / self.weights.sum(1, keepdim=True)

    def advance(self) -> None:
        """One generation: each set's child replaces it if it is better."""
        self.generation += 1
        g = generator(self.seed, "generation", self.generation)
        children = [self._child(i, g) for i in range(len(self.maps))]
        maps, weights, errors = self._descended(*(torch.stack(each) for each in zip(*children, strict=True)))
        better = errors < self.errors
        self._replace(better, maps[better], weights[better], errors[better])
        alike = torch.zeros_like(better)
        alike[1:] = self.errors[1:] - self.errors[:-1] < ALIKE * self.errors[:-1]
        if bool(alike.any()):
            self._replace(alike, *self._descended(*self._random(int(alike.sum()), g)))

    def _replace(self, which: Tensor, maps: Tensor, weights: Tensor, errors: Tensor) -> None:
        self.maps[which], self.weights[which], self.errors[which] = maps, weights, errors
        self.maps, self.weights, self.errors = _sorted(self.maps, self.weights, self.errors)

    def _child(self, parent: int, g: torch.Generator) -> tuple[Tensor, Tensor]:
        """A set with one or two maps replaced, by maps of another set or by random maps where mass is missing."""
        maps, weights = self.maps[parent].clone(), self.weights[parent].clone()
        crossed = bool(torch.rand((), generator=g) < CROSSED)
        many = min(self.count - 1, 1 + int(torch.rand((), generator=g) < TWO))
        order = torch.randperm(self.count, generator=g).to(maps.device)
        gone, kept = order[:many], order[many:]
        if crossed:
            other = int(torch.randint(len(self.maps), (), generator=g))
            taken = torch.randperm(self.count, generator=g)[:many].to(maps.device)
            maps[gone], weights[gone] = self.maps[other, taken], self.weights[other, taken]
            return maps, weights
        there = pushforward(maps[None, kept], weights[None, kept], self.measure.samples, self.measure.size)[0]
        lacking = (self.measure.bins - there).clamp_min(0) + ANYWHERE
        maps[gone] = self._born(lacking, many, g)
        weights[gone] = affine.volumes(maps[gone])
        return maps, weights

    def _random(self, sets: int, g: torch.Generator) -> tuple[Tensor, Tensor]:
        """Sets (n,N,6) of random maps anywhere on the measure, and their weights (n,N)."""
        maps = self._born(self.measure.bins, sets * self.count, g).view(sets, self.count, 6)
        return maps, affine.volumes(maps)

    def _born(self, wanted: Tensor, count: int, g: torch.Generator) -> Tensor:
        """Random maps (count,6) that send the mean of the measure to places drawn from `wanted` (G,G)."""
        size = wanted.shape[0]
        cell = torch.multinomial(wanted.flatten().cpu(), count, replacement=True, generator=g)
        place = pixel_to_canvas(torch.stack([cell // size, cell % size], 1) + 0.5, size)
        matrices = affine.random_matrices(count, *SIZES, LEAST_RATIO, g, reflections=self.reflections)
        return affine.sending(matrices, self.measure.mean.cpu().expand(count, 2), place).to(wanted)

    def _descended(self, maps: Tensor, weights: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        return descend(maps, weights / weights.sum(1, keepdim=True), self.measure, DESCENT)


def _sorted(maps: Tensor, weights: Tensor, errors: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Best first."""
    order = errors.argsort()
    return maps[order], weights[order], errors[order]
