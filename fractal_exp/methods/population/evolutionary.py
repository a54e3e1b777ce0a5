"""Evolutionary programming: every code has one child, and tournaments decide who stays.

Source: Nettleton and Garigliano 1994, as "Learning Image Fractals" (Eurographics 2025, section 5.1) set it up for its
comparison.
"""

from __future__ import annotations

import math
from typing import Annotated

import torch
from pydantic import Field
from torch import Tensor

from ...ifs.affine import rotation
from ...runtime.params import Amount, Positive
from ...runtime.seeds import generator
from ..stepwise import State, Stepwise
from .search import Overlap, PopulationParams, PopulationWalk, bounded, with_best


class EvolutionaryParams(PopulationParams):
    """The parameters of evolutionary programming."""

    generations: Positive = 1000
    """Generations; each draws as many children as there are codes (1000 in the paper's comparison)."""
    opponents: Annotated[int, Field(ge=1, le=1000)] = 5
    """Random members that each code is compared with in a tournament (5 in the paper's comparison)."""
    matrix_spread: Amount = 0.1
    """Largest standard deviation of the change of a matrix entry from parent to child."""
    matrix_rate: Amount = 1 / 500
    """Its square is this times 1 - f, where f is the parent's fitness (1/500 in the paper's comparison)."""
    offset_spread: Amount = 5.0
    """Largest standard deviation of the change of an offset, before tanh."""
    offset_rate: Amount = 5.0
    """Its square is this times 1 - f."""


def fitness(overlap: Overlap, as_released: bool = False) -> Tensor:
    """f = (|A ∧ B| - |A ⊕ B|) / |A| of every code, (P,), at most 1. A is the shape of the image. As released, the
    divisor is the number of all pixels: f is then near 0 for every code, and steps never become small."""
    return (overlap.both - overlap.mismatched).double() / (overlap.pixels if as_released else overlap.shape)


def step_sizes(cost: Tensor, params: EvolutionaryParams) -> Tensor:
    """Standard deviations (P,1,6) of a child's six numbers about its parent's, from the parent's 1 - f, (P,)."""
    cost = cost.float().clamp_min(0)
    matrix = (params.matrix_rate * cost).sqrt().clamp_max(params.matrix_spread)
    offset = (params.offset_rate * cost).sqrt().clamp_max(params.offset_spread)
    return torch.stack([matrix] * 4 + [offset] * 2, -1)[:, None]


def tournament(cost: Tensor, opponents: Tensor, kept: int) -> Tensor:
    """The `kept` members of highest score, (kept,), the earlier first where scores are alike. The score of a member of
    cost (Q,) is how many of its opponents (Q,K), given by number, are no fitter than itself."""
    score = (cost[opponents] >= cost[:, None]).sum(1)
    return score.argsort(descending=True, stable=True)[:kept]


class EvolutionaryWalk(PopulationWalk):
    """Evolutionary programming on one image. What is lowered is 1 - f."""

    params: EvolutionaryParams

    def step(self, state: State, number: int) -> State:
        random = generator(self.seed, "generation", number)
        noise = torch.randn(state["genome"].shape, generator=random).to(self.device)
        children = bounded(state["genome"] + noise * step_sizes(state["cost"], self.params), self.params.bound)
        if self.params.as_released:
            children = children.clamp(-1, 1)  # offsets, before tanh; matrices are within the bound
        genome = torch.cat([state["genome"], children])
        cost = torch.cat([state["cost"], self.cost(children)])
        drawn = torch.randint(len(cost), (len(cost), self.params.opponents), generator=random).to(self.device)
        stay = tournament(cost, drawn, self.params.population)
        return with_best(genome, cost, state) | {"genome": genome[stay], "cost": cost[stay]}

    def evaluations(self, steps: int) -> int:
        return self.params.population * (steps + 1)

    def cost(self, genome: Tensor) -> Tensor:
        return 1 - fitness(self.canvas.overlap(self.maps(genome)), self.params.as_released)

    def initial(self) -> Tensor:
        """Rotations or reflections of random angle about two singular values from U(0, bound), with offsets from
        U(-1, 1) before tanh; as released, all matrices are the identity as far as the bound lets them."""
        random, shape = generator(self.seed, "initial"), (self.params.population, self.params.maps)
        angle = 2 * math.pi * torch.rand(2, *shape, generator=random)
        size = self.params.bound * torch.rand(2, *shape, generator=random)
        size[1] *= 1 - 2 * torch.randint(0, 2, shape, generator=random)
        offset = 2 * torch.rand(*shape, 2, generator=random) - 1
        linear = rotation(angle[0]) @ torch.diag_embed(size.movedim(0, -1)) @ rotation(angle[1])
        if self.params.as_released:
            linear = torch.eye(2).expand_as(linear)
        return bounded(torch.cat([linear.flatten(-2), offset], -1), self.params.bound)


class Evolutionary(Stepwise):
    """Evolutionary programming on codes of a fixed number of maps (Nettleton and Garigliano 1994)."""

    unit = "generations"
    budget = 1000  # as published: two minutes or so of one core
    Params, walk = EvolutionaryParams, EvolutionaryWalk
    params: EvolutionaryParams
