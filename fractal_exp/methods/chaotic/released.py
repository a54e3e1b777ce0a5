"""What the program released with the paper does otherwise than the text: `method=chaotic_released` takes all of it
together (docs/deviations.md)."""

from __future__ import annotations

import torch
from torch import Tensor

from ...errors import InputError
from .losses import Regularizer, condition
from .model import SVD, Maps, Parameters
from .optimizers import Alternating, Step
from .problem import FitProblem
from .rendering import Rendering


class QR(SVD):
    """M = U diag(sigmoid(singular)) V^T with the factors Q of the QR decompositions of free entries, which are never
    projected. Both are reflections whose first entry is at most 0. So no M has a negative determinant, and one that
    turns by more than 90° can stretch along some axes only; hence no code can be taken up."""

    takes_codes = False

    def encode(self, linear: Tensor, offset: Tensor) -> dict[str, Tensor]:
        raise InputError("the released parameterisation does not reach every map, and takes no code; take model=svd")

    def decode(self, raw: Parameters) -> Maps:
        return super().decode({**raw, "u": householder(raw["u"]), "v": householder(raw["v"])})

    def project(self, raw: Parameters) -> dict[str, Tensor]:
        return dict(raw)


def householder(matrix: Tensor) -> Tensor:
    """The factor Q of the QR decomposition of matrices (…,2,2), as LAPACK makes it: the reflection whose first column
    has the direction of the matrix's, or the opposite one, so that its first entry is at most 0."""
    first = matrix[..., 0]
    side = torch.where(first[..., :1] < 0, 1.0, -1.0)
    cos, sin = (side * first / first.norm(dim=-1, keepdim=True).clamp_min(1e-12)).unbind(-1)
    return torch.stack([torch.stack([cos, sin], -1), torch.stack([sin, -cos], -1)], -2)


class MeanCondition(Regularizer):
    """sum_i (s_i1² + s_i2² + |b_i|²) + condition_weight mean_i ((s_i1 + 1)/(s_i2 + 1))²."""

    def forward(self, rendering: Rendering) -> Tensor:
        small = (rendering.singular.square() + rendering.offset.square()).sum((-2, -1))
        return small + self.condition_weight * condition(rendering.singular).square().mean(-1)


class FixedCentre(Alternating):
    """Alternating descent and annealing whose candidates are all proposed about the state before the phase. Each is
    compared with the one accepted before it; the last one accepted is where the phase leads to."""

    @torch.no_grad()
    def _anneal(self, problem: FitProblem, iteration: int, temperature: float, step: Step) -> int:
        moves, seeds = self.draws(iteration)
        noise = {name: torch.stack([move.noise[name] for move in moves]) for name in self.raw}
        proposed = self.annealing.propose(self.raw, problem.parameterization, temperature, noise)
        energy, accepted = self._current_energy(problem, iteration, step, seeds[0]), []
        for place in range(0, self.candidates, self.at_a_time):
            some = slice(place, place + self.at_a_time)
            energies = problem.energy({name: value[some] for name, value in proposed.items()},
                                      torch.tensor(seeds[1:][some])).tolist()
            for number, there in enumerate(energies, place):
                if self.annealing.accepts(there - energy, temperature, moves[number].u):
                    energy = there
                    accepted.append(number)
        if accepted:
            self._move_to({name: value[accepted[-1]] for name, value in proposed.items()})
        return len(accepted)
