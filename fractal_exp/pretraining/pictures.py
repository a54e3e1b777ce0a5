"""Random codes and their pictures to train on: of the suite's distribution, and never of a suite."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from ..ifs import attractor
from ..ifs.code import IFS
from ..perceptual_training import drawing
from ..perceptual_training.perturbations import Maps, table
from ..rendering.still import points_per_view
from ..runtime.seeds import derive
from ..suite import FIRST_TRAINING_SEED, TARGET_SUPERSAMPLE, draw_code

TRAINING, HELD_OUT = "training", "held-out"


def code_seed(seed: int, network: str, stream: str, number: int) -> int:
    """The seed of a code to train a network on, at least `suite.FIRST_TRAINING_SEED`: suites have lower ones."""
    return FIRST_TRAINING_SEED | derive(seed, "pretraining", network, stream, "code", number)


def training_code(seed: int) -> IFS:
    """The code of such a seed, of the suite's distribution, framed as targets are."""
    return attractor.normalize(draw_code(np.random.Generator(np.random.PCG64(seed)), {}))


def rows(code: IFS) -> Maps:
    """Its maps (N,6), rows a b c d e f, float64."""
    return torch.cat([code.linear.reshape(-1, 4), code.offset], 1).double().numpy()


def draw(codes: Sequence[Maps], side: int, seed: int, spread: float = 0.0) -> Tensor:
    """Images (B,S,S) of framed codes as `suite.target` draws them, the number of points times a random factor whose
    logarithm is uniform in ±spread."""
    rng = np.random.Generator(np.random.PCG64(seed))
    maps, p = table(list(codes))
    points = points_per_view(side) * np.exp(rng.uniform(-spread, spread, len(codes)))
    seeds = rng.integers(2**62, size=len(codes))
    return torch.from_numpy(drawing.draw(maps, p, seeds, points.astype(np.int64), side, TARGET_SUPERSAMPLE))
