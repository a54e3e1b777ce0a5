"""Random codes and their pictures to train on: of the suite's distribution, and never of a suite."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from functools import lru_cache
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from ..ifs import affine, attractor
from ..ifs.code import IFS, PROBABILITY_FLOOR
from ..methods.pretrained import Pretrained
from ..rendering.still import points_per_view
from ..runtime.seeds import derive
from ..suite import FIRST_TRAINING_SEED, TARGET_SUPERSAMPLE, draw_code
from . import drawing
from .loop import Training

Maps = np.ndarray  # (N,6), rows a b c d e f of x' = a x + b y + e, y' = c x + d y + f, float64
TRAINING, HELD_OUT = "training", "held-out"


class CodeTraining(Training):
    """The training of a method's network on random codes."""

    method: ClassVar[type[Pretrained]]  # what the network is for

    def network(self) -> nn.Module:
        return self.method.built(self.recipe(), self.stream("initial"))

    @abstractmethod
    def errors(self, network: nn.Module, device: str) -> dict[str, Tensor]:
        """The loss on each held-out code (B,) as `held_out`, and that of a trivial answer under a name of its own."""

    def judge(self, network: nn.Module, device: str) -> dict[str, float]:
        return {name: float(values.double().mean()) for name, values in self.errors(network, device).items()}

    def stream(self, *path: int | str) -> int:
        """A seed of this training for a purpose."""
        return derive(self.seed, "pretraining", self.method.name, *path)

    @lru_cache(None)  # noqa: B019 — lives as long as the training
    def code(self, number: int) -> Maps:
        """A code to learn from."""
        return rows(training_code(code_seed(self.seed, self.method.name, TRAINING, number)))

    def held_out_codes(self) -> list[Maps]:
        """Codes that training never sees."""
        return [rows(training_code(code_seed(self.seed, self.method.name, HELD_OUT, number)))
                for number in range(self.params.held_out)]


def code_seed(seed: int, network: str, stream: str, number: int) -> int:
    """The seed of a code to train a network on, at least `suite.FIRST_TRAINING_SEED`: suites have lower ones."""
    return FIRST_TRAINING_SEED | derive(seed, "pretraining", network, stream, "code", number)


def training_code(seed: int) -> IFS:
    """The code of such a seed, of the suite's distribution, framed as targets are."""
    return attractor.normalize(draw_code(np.random.Generator(np.random.PCG64(seed)), {}))


def rows(code: IFS) -> Maps:
    """Its maps (N,6), rows a b c d e f, float64."""
    return affine.from_code(code).detach().double().numpy()


def similar(maps: Maps, scale: float, shift: np.ndarray) -> Maps:
    """The code whose attractor is scale · A + shift."""
    linear = maps[:, :4].reshape(-1, 2, 2)
    return np.concatenate([maps[:, :4], scale * maps[:, 4:] + shift - linear @ shift], 1)


def probabilities(maps: Maps) -> np.ndarray:
    """The probabilities (N,) of the maps, |det| + 0.01 normalised."""
    p = np.abs(maps[:, 0] * maps[:, 3] - maps[:, 1] * maps[:, 2]) + PROBABILITY_FLOOR
    return p / p.sum()


def table(codes: Sequence[Maps]) -> tuple[np.ndarray, np.ndarray]:
    """The maps (B,10,6) of many codes and their probabilities (B,10), filled up with maps of no probability."""
    maps, p = np.zeros((len(codes), drawing.MAX_MAPS, 6)), np.zeros((len(codes), drawing.MAX_MAPS))
    for row, code in enumerate(codes):
        maps[row, :len(code)] = code
        p[row, :len(code)] = probabilities(code)
    return maps, p


def draw(codes: Sequence[Maps], side: int, seed: int, spread: float = 0.0) -> Tensor:
    """Images (B,S,S) of framed codes as `suite.target` draws them, the number of points times a random factor whose
    logarithm is uniform in ±spread."""
    rng = np.random.Generator(np.random.PCG64(seed))
    points = points_per_view(side) * np.exp(rng.uniform(-spread, spread, len(codes)))
    seeds = rng.integers(2**62, size=len(codes))
    return torch.from_numpy(drawing.draw(*table(codes), seeds, points.astype(np.int64), side, TARGET_SUPERSAMPLE))
