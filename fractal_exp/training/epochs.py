"""What trainings that read codes off pictures share: epochs of so many codes, each time with new pictures."""

from __future__ import annotations

from abc import abstractmethod
from functools import cached_property
from typing import Annotated

import numpy as np
import torch
from pydantic import Field
from torch import Tensor

from ..runtime.params import Positive, Share
from .codes import HELD_OUT, TRAINING, CodeTraining, Maps, draw
from .drawing import MAX_MAPS
from .loop import Batch, Recipe


class EpochRecipe(Recipe):
    """What such trainings have."""

    maps: Annotated[int, Field(ge=MAX_MAPS, le=64)] = 10
    """Number of maps that the network gives; the codes have 3 to 10."""
    side: Annotated[int, Field(ge=16, le=512)] = 128
    """Pixels a side of the pictures."""
    codes: Positive = 8000
    """Codes to learn from (8000 in the comparison); an epoch goes through all of them, with new pictures."""
    epochs: Positive = 60
    """Epochs at most."""
    decay: Share = 0.9
    """Factor on the learning rate after each epoch."""
    patience: Positive = 5
    """Epochs in a row without a lower held-out loss, after which the training ends."""
    points: Annotated[float, Field(ge=0, le=5)] = 0.7
    """The number of points of a picture is a target's, times a random factor whose logarithm is uniform in ± this."""
    symmetries: bool = True
    """Whether each picture of an epoch is turned by quarters and mirrored at random with its code, which leaves the
    distribution of the codes as it is."""


class EpochTraining(CodeTraining):
    """Such a training. A batch is images (B,S,S) and the numbers of their codes."""

    Params: type[EpochRecipe]
    params: EpochRecipe

    @abstractmethod
    def numbers(self, code: Maps) -> Tensor:
        """What is to be read off the picture of a code (n,6), float32."""

    @property
    def size(self) -> int:
        """Of a batch."""
        return min(self.params.batch, self.params.codes)

    @property
    def symmetries(self) -> bool:
        """Whether pictures are turned and mirrored."""
        return self.params.symmetries

    @property
    def every(self) -> int:
        return self.params.codes // self.size

    @property
    def steps(self) -> int:
        return self.params.epochs * self.every

    @property
    def patience(self) -> int | None:
        return self.params.patience

    def rate(self, step: int) -> float:
        return self.params.rate * self.params.decay ** (step // self.every)

    def batch(self, step: int) -> Batch:
        epoch, place = divmod(step, self.every)
        order = np.random.Generator(np.random.PCG64(self.stream(TRAINING, "order", epoch)))
        numbers = order.permutation(self.params.codes)[place * self.size:(place + 1) * self.size]
        codes = [self.code(int(number)) for number in numbers]
        if self.symmetries:
            rng = np.random.Generator(np.random.PCG64(self.stream(TRAINING, "symmetries", step)))
            codes = [turned(code, rng) for code in codes]
        return self._drawn(codes, self.stream(TRAINING, "pictures", step))

    @cached_property
    def held_out(self) -> Batch:
        """Pictures of codes that training never sees."""
        return self._drawn(self.held_out_codes(), self.stream(HELD_OUT, "pictures"))

    def _drawn(self, codes: list[Maps], seed: int) -> Batch:
        images = draw(codes, self.params.side, seed, self.params.points)
        return images, torch.stack([self.numbers(code) for code in codes])


def turned(code: Maps, rng: np.random.Generator) -> Maps:
    """The code (n,6) whose picture is turned by quarters and mirrored, one of the eight ways at random."""
    symmetry = np.eye(2)[rng.permutation(2)] * rng.choice([-1.0, 1.0], 2)
    linear = symmetry @ code[:, :4].reshape(-1, 2, 2) @ symmetry.T
    return np.concatenate([linear.reshape(-1, 4), code[:, 4:] @ symmetry.T], 1)
