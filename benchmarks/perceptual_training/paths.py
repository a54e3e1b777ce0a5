"""Codes along real fits: the paper's optimiser, begun with a code that was moved away, on its way back."""

from __future__ import annotations

import numpy as np
import torch

from fractal_exp.methods.chaotic.losses import DSSIM, MipMSE, WeightedSum
from fractal_exp.methods.chaotic.model import SVD, ForwardModel
from fractal_exp.runtime.seeds import derive
from fractal_exp.training.codes import rows

from .perturbations import ifs, perturbed
from .pictures import Path, random_code

RESOLUTION, TRAJECTORIES, LENGTH = 64, 200, 40
LEARNING_RATE = 0.02
FARTHEST = 0.3  # of the normal variate that moves the code away


def fit_path(seed: int, iterations: int = 60, steps: int = 10) -> Path:
    """The path of one fit: `steps` codes at even intervals, each in the frame that the model draws it in.

    The objective is the paper's without its perceptual term and its regulariser. Maps keep their numbers, so that a
    step's distance from the truth is that of the points of one address, however the fit ends.
    """
    truth = random_code(derive(seed, "truth"))
    rng = np.random.Generator(np.random.PCG64(derive(seed, "start")))
    begun = perturbed(truth, "all", FARTHEST * rng.uniform(0.1, 1), np.zeros(2), rng)
    model = ForwardModel(SVD(), resolution=RESOLUTION, maps=len(truth), trajectories=TRAJECTORIES, length=LENGTH)
    objective = WeightedSum({"mse": 10.0, "ssim": 1.0}, {"mse": MipMSE(), "ssim": DSSIM()})
    with torch.no_grad():
        objective.prepare(model(model.encode(ifs(truth)), derive(seed, "target")).image)
    raw = {name: value.requires_grad_() for name, value in model.encode(ifs(begun)).items()}
    optimizer, found = torch.optim.Adam(raw.values(), LEARNING_RATE), []
    for iteration in range(iterations):
        if iteration % max(1, iterations // steps) == 0:
            found.append(rows(model.code(raw, derive(seed, "frame"))))
        optimizer.zero_grad()
        objective(model(raw, derive(seed, "points", iteration)))[0].backward()
        optimizer.step()
        with torch.no_grad():
            for name, value in model.parameterization.project(raw).items():
                raw[name].copy_(value)
    return Path(truth, tuple(found))
