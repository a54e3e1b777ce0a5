"""The paper's method at sizes that take moments."""

import torch

from fractal_exp.methods.chaotic.losses import DSSIM, MipMSE, Regularizer, WeightedSum
from fractal_exp.methods.chaotic.method import Chaotic
from fractal_exp.methods.chaotic.model import SVD, ForwardModel
from fractal_exp.methods.chaotic.optimizers import Alternating, AnnealingOnly, GradientDescent, NoisyGradientDescent

OPTIMIZERS = {
    "alternating": lambda: Alternating(every=3, candidates=2), "gradient": GradientDescent,
    "noisy": NoisyGradientDescent, "annealing": AnnealingOnly,
}


class Breaking(GradientDescent):
    """Gradient descent that meets a NaN in one iteration."""

    def __init__(self, iteration: int, **options):
        super().__init__(**options)
        self.iteration = iteration

    def change_gradients(self, iteration):
        if iteration == self.iteration:
            self.raw["offset"].grad += torch.nan


def fit(optimizer=None, *, iterations=12, parameterization=None, **options) -> Chaotic:
    model = ForwardModel(parameterization or SVD(), resolution=32, maps=3, trajectories=60, length=30)
    objective = WeightedSum({"mse": 10, "ssim": 1, "regularizer": 0.01},
                            {"mse": MipMSE(), "ssim": DSSIM(), "regularizer": Regularizer()})
    return Chaotic(model, objective, optimizer or GradientDescent(), iterations=iterations, **options)


def random(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)
