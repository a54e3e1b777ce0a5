"""What a fit minimises: the error of a model's images of one target."""

from __future__ import annotations

import torch
from torch import Tensor

from .losses import WeightedSum, mse
from .model import ForwardModel, Parameterization, Parameters


class FitProblem:
    """The model and the objective on one target, as the optimiser sees them. Start points and map indices are drawn
    from the seed; raw parameters may carry a batch of codes."""

    def __init__(self, model: ForwardModel, objective: WeightedSum, target: Tensor):
        self.model, self.target = model, target
        self.objective = objective.prepare(target)

    @property
    def parameterization(self) -> Parameterization:
        """How raw parameters become maps."""
        return self.model.parameterization

    @property
    def waits(self) -> bool:
        """Whether `loss` waits for a GPU, so that no CUDA graph can record it."""
        return self.model.waits(self.target)

    def loss(self, raw: Parameters, seed: int | Tensor) -> tuple[Tensor, dict[str, Tensor]]:
        """The differentiable objective (…,) and its named terms."""
        return self.objective(self.model(raw, seed))

    @torch.no_grad()
    def energy(self, raw: Parameters, seed: int | Tensor) -> Tensor:
        """The energy (…,) that annealing compares: the plain mean squared error at full resolution."""
        return mse(self.model(raw, seed).image, self.target)

    @torch.no_grad()
    def draw(self, raw: Parameters, seed: int) -> Tensor:
        """The image (R,R) of the model, on the CPU."""
        return self.model(raw, seed).image.cpu()
