"""The training of neural regression: the numbers of random codes, to be read off their pictures.

Source: Graham and Demers 2021; "Learning Image Fractals" (Eurographics 2025, section 5.1) trained on 8000 codes, sorted
by singular values.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated, Any

import numpy as np
import torch
from pydantic import Field, model_validator
from torch import Tensor, nn

from ..errors import InputError
from ..methods.neural_regression.method import NeuralRegression
from ..runtime.params import Amount, Positive, Some
from .codes import Maps
from .epochs import EpochRecipe, EpochTraining
from .loop import Batch

RELEASED_DECAY, RELEASED_RESIDUAL = 0.9, 0.01  # of the rate at every step; of the deviations, whatever the scale
CODES_OF_THE_MEAN = 1000  # a code takes hundredths of a second to frame, and a training may have only seconds


class RegressionRecipe(EpochRecipe):
    """How the network of neural regression is trained."""

    rate: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1e-3
    """Learning rate of Adam at first (0.001 in the comparison)."""
    weight_decay: Amount = 1e-4
    """Weight decay of Adam (0.0001 in the comparison)."""
    channels: Annotated[tuple[Positive, ...], Some] = (32, 64, 128)
    """Channels of the blocks, each of which halves the side (32, 64 and 128 in the comparison)."""
    hidden: Positive = 256
    """Numbers between the two dense layers (256 in the comparison)."""
    residual: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 0.01
    """Scale of the deviations from the identity (0.01 in the comparison; 1 learns more quickly)."""
    as_released: bool = False
    """Whether to train as in the program released with the paper: the rate times 0.9 at every step, one code a step, no
    activation between the dense layers, no turned pictures, and the last state is kept."""

    @model_validator(mode="after")
    def _side_fits(self) -> RegressionRecipe:
        whole = 1 << len(self.channels)
        if self.side % whole or self.side < whole:
            raise InputError(f"side must be a multiple of {whole}, as {len(self.channels)} blocks halve it, got "
                             f"{self.side}")
        return self


class RegressionTraining(EpochTraining):
    """The training of neural regression. The loss is the mean squared error of all 6 N numbers; predicting the mean of
    the codes is what it must beat."""

    method = NeuralRegression
    Params = RegressionRecipe
    params: RegressionRecipe

    def recipe(self) -> dict[str, Any]:
        return super().recipe() | ({"residual": RELEASED_RESIDUAL} if self.params.as_released else {})

    @property
    def size(self) -> int:
        return 1 if self.params.as_released else super().size

    @property
    def symmetries(self) -> bool:
        return super().symmetries and not self.params.as_released

    @property
    def patience(self) -> int | None:
        return None if self.params.as_released else super().patience

    @property
    def keeps_best(self) -> bool:
        return not self.params.as_released

    def network(self) -> nn.Module:
        return super().network().to(memory_format=torch.channels_last)

    def rate(self, step: int) -> float:
        return self.params.rate * RELEASED_DECAY**step if self.params.as_released else super().rate(step)

    def loss(self, network: nn.Module, batch: Batch) -> Tensor:
        images, numbers = batch
        return (network(images) - numbers).square().mean()

    def errors(self, network: nn.Module, device: str) -> dict[str, Tensor]:
        images, numbers = (part.to(device) for part in self.held_out)
        errors = torch.cat([(network(some) - truth).square().mean((1, 2)) for some, truth in
                            zip(images.split(self.params.batch), numbers.split(self.params.batch), strict=True)])
        return {"held_out": errors, "mean_code": self.mean_code_errors}

    @cached_property
    def mean_code_errors(self) -> Tensor:
        """Of the mean of the first thousand codes that are learnt from, or of all if they are fewer, as the answer to
        every held-out picture."""
        count = min(self.params.codes, CODES_OF_THE_MEAN)
        known = torch.stack([self.numbers(self.code(number)) for number in range(count)]).double()
        return (self.held_out[1] - known.mean(0)).square().mean((1, 2))

    def numbers(self, code: Maps) -> Tensor:
        """(N,6)."""
        return torch.from_numpy(sorted_rows(code, self.params.maps)).float()


def sorted_rows(code: Maps, maps: int) -> Maps:
    """The maps (n,6) of a code as (N,6), n <= N: by falling largest singular value, the first ones repeated until there
    are N, each beside its copy. The attractor stays the same."""
    stretch = np.linalg.norm(code[:, :4].reshape(-1, 2, 2), ord=2, axis=(1, 2))
    order = np.argsort(-stretch, kind="stable")
    return code[order[np.sort(np.arange(maps) % len(code))]]
