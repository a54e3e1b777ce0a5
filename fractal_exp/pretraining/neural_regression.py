"""The training of neural regression: the numbers of random codes, to be read off their pictures.

Source: Graham and Demers 2021; "Learning Image Fractals" (Eurographics 2025, section 5.1) trained on 8000 codes, sorted
by singular values.
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import Annotated, Any

import numpy as np
import torch
from pydantic import Field, model_validator
from torch import Tensor, nn

from ..errors import InputError
from ..methods.neural_regression.method import NeuralRegression
from ..perceptual_training.drawing import MAX_MAPS
from ..perceptual_training.perturbations import Maps
from ..runtime.params import Amount, Positive, Share
from ..runtime.seeds import derive
from . import pictures
from .loop import Batch, Recipe, Training

RELEASED_DECAY, RELEASED_RESIDUAL = 0.9, 0.01  # of the rate at every step; of the deviations, whatever the scale


class RegressionRecipe(Recipe):
    """How the network of neural regression is trained."""

    maps: Annotated[int, Field(ge=MAX_MAPS, le=64)] = 10
    """Number of maps of the code that the network gives; the codes have 3 to 10."""
    side: Annotated[int, Field(ge=16, le=512)] = 128
    """Pixels a side of the pictures."""
    channels: tuple[Positive, ...] = (32, 64, 128)
    """Channels of the blocks, each of which halves the side (32, 64 and 128 in the comparison)."""
    hidden: Positive = 256
    """Numbers between the two dense layers (256 in the comparison)."""
    residual: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.01
    """Scale of the deviations from the identity (0.01 in the comparison; 1 learns more quickly)."""
    codes: Positive = 8000
    """Codes to learn from (8000 in the comparison); an epoch goes through all of them, with new pictures."""
    epochs: Positive = 60
    """Epochs at most."""
    rate: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1e-3
    """Learning rate of Adam at first (0.001 in the comparison)."""
    decay: Share = 0.9
    """Factor on the learning rate after each epoch."""
    weight_decay: Amount = 1e-4
    """Weight decay of Adam (0.0001 in the comparison)."""
    patience: Positive = 5
    """Epochs in a row without a lower held-out loss, after which the training ends."""
    points: Amount = 0.7
    """The number of points of a picture is a target's, times a random factor whose logarithm is uniform in ± this."""
    symmetries: bool = True
    """Whether each picture of an epoch is turned by quarters and mirrored at random with its code, which leaves the
    distribution of the codes as it is. As released there is nothing of the kind."""
    as_released: bool = False
    """Whether to train as in the program released with the paper: the rate times 0.9 at every step, one code a step, no
    activation between the dense layers, and the last state is kept."""

    @model_validator(mode="after")
    def _side_fits(self) -> RegressionRecipe:
        whole = 1 << len(self.channels)
        if self.side % whole or self.side < whole:
            raise InputError(f"side must be a multiple of {whole}, as {len(self.channels)} blocks halve it, got "
                             f"{self.side}")
        return self


class RegressionTraining(Training):
    """The training of neural regression. The loss is the mean squared error of all 6 N numbers; predicting the mean of
    the codes is what it must beat."""

    method = NeuralRegression
    Params = RegressionRecipe
    params: RegressionRecipe

    def recipe(self) -> dict[str, Any]:
        return super().recipe() | ({"residual": RELEASED_RESIDUAL} if self.params.as_released else {})

    @property
    def size(self) -> int:
        """Of a batch."""
        return 1 if self.params.as_released else min(self.params.batch, self.params.codes)

    @property
    def every(self) -> int:
        return self.params.codes // self.size

    @property
    def steps(self) -> int:
        return self.params.epochs * self.every

    @property
    def patience(self) -> int | None:
        return None if self.params.as_released else self.params.patience

    @property
    def keeps_best(self) -> bool:
        return not self.params.as_released

    def network(self) -> nn.Module:
        network = self.method.built(self.recipe(), self._seed("initial"))
        return network.to(memory_format=torch.channels_last)

    def rate(self, step: int) -> float:
        decays = step if self.params.as_released else step // self.every
        return self.params.rate * (RELEASED_DECAY if self.params.as_released else self.params.decay) ** decays

    def batch(self, step: int) -> Batch:
        epoch, place = divmod(step, self.every)
        order = np.random.Generator(np.random.PCG64(self._seed(pictures.TRAINING, "order", epoch)))
        numbers = order.permutation(self.params.codes)[place * self.size:(place + 1) * self.size]
        codes = [self._code(int(number)) for number in numbers]
        if self.params.symmetries and not self.params.as_released:
            rng = np.random.Generator(np.random.PCG64(self._seed(pictures.TRAINING, "symmetries", step)))
            codes = [turned(code, rng) for code in codes]
        return self._drawn(codes, self._seed(pictures.TRAINING, "pictures", step))

    def loss(self, network: nn.Module, batch: Batch) -> Tensor:
        images, numbers = batch
        return (network(images) - numbers).square().mean()

    def judge(self, network: nn.Module, device: str) -> dict[str, float]:
        images, numbers = (part.to(device) for part in self._held_out)
        errors = torch.cat([(network(some) - truth).square().mean((1, 2)) for some, truth in
                            zip(images.split(self.params.batch), numbers.split(self.params.batch), strict=True)])
        return {"held_out": float(errors.double().mean()), "mean_code": self._mean_code_loss}

    @cached_property
    def _held_out(self) -> Batch:
        codes = [self._made(pictures.HELD_OUT, number) for number in range(self.params.held_out)]
        return self._drawn(codes, self._seed(pictures.HELD_OUT, "pictures"))

    @cached_property
    def _mean_code_loss(self) -> float:
        """Of the mean of the codes that are learnt from, as the answer to every held-out picture."""
        known = torch.stack([self._numbers(self._code(number)) for number in range(self.params.codes)]).double()
        return float((self._held_out[1] - known.mean(0)).square().mean())

    def _drawn(self, codes: list[Maps], seed: int) -> Batch:
        images = pictures.draw(codes, self.params.side, seed, self.params.points)
        return images, torch.stack([self._numbers(code) for code in codes])

    def _numbers(self, code: Maps) -> Tensor:
        return torch.from_numpy(sorted_rows(code, self.params.maps)).float()

    @lru_cache(None)  # noqa: B019 — lives as long as the training
    def _code(self, number: int) -> Maps:
        return self._made(pictures.TRAINING, number)

    def _made(self, stream: str, number: int) -> Maps:
        return pictures.rows(pictures.training_code(pictures.code_seed(self.seed, self.method.name, stream, number)))

    def _seed(self, *path: int | str) -> int:
        return derive(self.seed, "pretraining", self.method.name, *path)


def turned(code: Maps, rng: np.random.Generator) -> Maps:
    """The code (n,6) whose picture is turned by quarters and mirrored, one of the eight ways at random."""
    symmetry = np.eye(2)[rng.permutation(2)] * rng.choice([-1.0, 1.0], 2)
    linear = symmetry @ code[:, :4].reshape(-1, 2, 2) @ symmetry.T
    return np.concatenate([linear.reshape(-1, 4), code[:, 4:] @ symmetry.T], 1)


def sorted_rows(code: Maps, maps: int) -> Maps:
    """The maps (n,6) of a code as (N,6), n <= N: by falling largest singular value, the first ones repeated until there
    are N, each beside its copy. The attractor stays the same."""
    stretch = np.linalg.norm(code[:, :4].reshape(-1, 2, 2), ord=2, axis=(1, 2))
    order = np.argsort(-stretch, kind="stable")
    return code[order[np.sort(np.arange(maps) % len(code))]]
