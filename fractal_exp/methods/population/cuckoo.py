"""Cuckoo search: Lévy flights away from the best code, and nests that are partly built anew.

Source: Quirce et al. 2017, after Yang and Deb, "Cuckoo search via Lévy flights", 2009, as "Learning Image Fractals"
(Eurographics 2025, section 5.1) compared with it.
"""

from __future__ import annotations

import math
from typing import Annotated

import torch
from pydantic import Field
from torch import Tensor

from ...runtime.params import Amount, Positive, Share
from ...runtime.seeds import generator
from ..stepwise import State, Stepwise
from .search import Overlap, PopulationParams, PopulationWalk, bounded, with_best


class CuckooParams(PopulationParams):
    """The parameters of cuckoo search; `population` is the number of nests."""

    generations: Positive = 2500
    """Generations; each draws every nest twice (2500 in the paper's comparison)."""
    exponent: Annotated[float, Field(gt=0.3, lt=2)] = 1.5
    """Exponent beta of the Lévy flight (Yang and Deb 2009: 1.5)."""
    flight: Amount = 0.01
    """Length of the flights (Yang and Deb 2009: 0.01)."""
    abandoned: Share = 0.25
    """Chance of a number to be changed when nests are abandoned (Yang and Deb 2009: 0.25); as released, of a nest."""


def mismatch(overlap: Overlap, as_released: bool = False) -> Tensor:
    """|A ⊕ B| over all pixels, (P,), which is lowered. As released it is raised: what is lowered is then its rest."""
    wrong = overlap.mismatched.double() / overlap.pixels
    return 1 - wrong if as_released else wrong


def mantegna_sigma(exponent: float) -> float:
    """The standard deviation of u in a Lévy step u / |v|^(1/beta), with v from N(0,1) (Mantegna 1994)."""
    above = math.gamma(1 + exponent) * math.sin(math.pi * exponent / 2)
    below = math.gamma((1 + exponent) / 2) * exponent * 2 ** ((exponent - 1) / 2)
    return (above / below) ** (1 / exponent)


def levy_steps(shape: torch.Size | tuple[int, ...], exponent: float, random: torch.Generator) -> Tensor:
    """Steps of a Lévy flight by Mantegna's algorithm: symmetric, with tails of the exponent."""
    u = mantegna_sigma(exponent) * torch.randn(shape, generator=random)
    return u / torch.randn(shape, generator=random).abs().clamp_min(1e-12) ** (1 / exponent)


class CuckooWalk(PopulationWalk):
    """Cuckoo search on one image; its genomes are the nests."""

    params: CuckooParams

    def initial(self) -> Tensor:
        shape, bound = (self.params.population, self.params.maps), self.params.bound
        numbers = 2 * torch.rand(*shape, 6, generator=generator(self.seed, "initial")) - 1
        return torch.cat([bound * numbers[..., :4], numbers[..., 4:]], -1)

    def step(self, state: State, number: int) -> State:
        random = generator(self.seed, "generation", number)
        flown = with_best(*self._fly(state, random), state)
        return with_best(*self._abandon(flown["genome"], flown["cost"], random), flown)

    def _fly(self, state: State, random: torch.Generator) -> tuple[Tensor, Tensor]:
        """Every nest flies, the farther the farther it is from the best one; it stays where that is no better."""
        nests = state["genome"]
        levy = levy_steps(nests.shape, self.params.exponent, random) * torch.randn(nests.shape, generator=random)
        flown = self._held(nests + self.params.flight * levy.to(self.device) * (nests - state["best"]))
        return self._better(nests, state["cost"], flown)

    def _abandon(self, nests: Tensor, cost: Tensor, random: torch.Generator) -> tuple[Tensor, Tensor]:
        """Some numbers of every nest move by a share of the difference of two others."""
        if self.params.as_released:
            return self._replace(nests, cost, random)
        changed = torch.rand(nests.shape, generator=random) < self.params.abandoned
        first, second = (torch.randperm(len(nests), generator=random).to(self.device) for _ in range(2))
        share = float(torch.rand((), generator=random))
        built = self._held(nests + share * (nests[first] - nests[second]) * changed.to(self.device))
        return self._better(nests, cost, built)

    def _replace(self, nests: Tensor, cost: Tensor, random: torch.Generator) -> tuple[Tensor, Tensor]:
        """As released: some nests move, for better or worse; each matrix and each offset by a share of its own."""
        changed = (torch.rand(len(nests), generator=random) < self.params.abandoned).to(self.device)
        first, second = torch.randint(0, len(nests), (2, len(nests)), generator=random).to(self.device)
        share = torch.rand(*nests.shape[:2], 2, generator=random).to(self.device)
        share = share.repeat_interleave(torch.tensor([4, 2], device=self.device), -1)
        built = self._held(nests + share * (nests[first] - nests[second]) * changed[:, None, None])
        return built, torch.where(changed, self.cost(built), cost)

    def _better(self, nests: Tensor, cost: Tensor, new: Tensor) -> tuple[Tensor, Tensor]:
        new_cost = self.cost(new)
        better = new_cost < cost
        return torch.where(better[:, None, None], new, nests), torch.where(better, new_cost, cost)

    def _held(self, nests: Tensor) -> Tensor:
        """Entries within ±bound, offsets within ±1."""
        return bounded(nests, self.params.bound).clamp(-1, 1)

    def evaluations(self, steps: int) -> int:
        return self.params.population * (2 * steps + 1)

    def maps(self, genome: Tensor) -> Tensor:
        """As released, offsets go through tanh."""
        return super().maps(genome) if self.params.as_released else genome

    def cost(self, genome: Tensor) -> Tensor:
        return mismatch(self.canvas.overlap(self.maps(genome)), self.params.as_released)


class Cuckoo(Stepwise):
    """Cuckoo search on codes of a fixed number of maps (Quirce et al. 2017)."""

    unit = "generations"
    budget = 500  # that one core draws in two minutes or so: each draws every code twice
    Params, walk = CuckooParams, CuckooWalk
    params: CuckooParams
