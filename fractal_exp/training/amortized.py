"""The training of amortised set prediction: each map of a random code is to be found by one of the network's answers.

Source: Yamaguti 2026; the matching is that of Carion et al., "End-to-End Object Detection with Transformers" (2020).
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import torch
import torch.nn.functional as F
from pydantic import Field, model_validator
from scipy.optimize import linear_sum_assignment
from torch import Tensor, nn

from ..errors import InputError
from ..methods.amortized.method import Amortized
from ..runtime.params import Amount, Positive, Some
from .codes import Maps
from .epochs import EpochRecipe, EpochTraining
from .loop import Batch


class AmortizedRecipe(EpochRecipe):
    """How the network of amortised set prediction is trained."""

    codes: Positive = 200_000
    """Codes to learn from; an epoch goes through all of them, with new pictures."""
    rate: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 5e-4
    """Learning rate of Adam at first."""
    channels: Annotated[tuple[Annotated[int, Field(ge=4, multiple_of=4)], ...], Some] = (32, 64, 128, 256)
    """Channels of the residual blocks, each of which halves the side."""
    heads: Positive = 4
    """Heads of the attention that pools pixels into maps."""
    hidden: Positive = 256
    """Numbers of the perceptron that reads a map."""
    presence: Amount = 0.1
    """Weight of the cross-entropy of whether a map is there, beside the squared error of its numbers."""

    @model_validator(mode="after")
    def _heads_fit(self) -> AmortizedRecipe:
        if self.channels[-1] % self.heads:
            raise InputError(f"the last of channels must be a multiple of heads, got {self.channels[-1]} and "
                             f"{self.heads}")
        return self


class AmortizedTraining(EpochTraining):
    """The training of amortised set prediction. What it must beat are its own answers to other codes' pictures: a set
    that is the same for all pictures gets no less."""

    method = Amortized
    Params = AmortizedRecipe
    params: AmortizedRecipe

    def loss(self, network: nn.Module, batch: Batch) -> Tensor:
        images, numbers = batch
        return self.set_loss(network(images), numbers).mean()

    def set_loss(self, found: tuple[Tensor, Tensor], numbers: Tensor) -> Tensor:
        """Of each code (B,): the mean squared error of the matched maps, and the weighted cross-entropy."""
        maps, logits = found
        present, slots = numbers.isfinite().all(2), match(maps, numbers)
        matched = maps.gather(1, slots[:, :, None].expand(-1, -1, maps.shape[2]))
        squares = (matched - numbers.nan_to_num()).square().mean(2) * present
        there = torch.zeros_like(logits).scatter(1, slots, present.to(logits))
        presence = F.binary_cross_entropy_with_logits(logits, there, reduction="none").mean(1)
        return squares.sum(1) / present.sum(1) + self.params.presence * presence

    def errors(self, network: nn.Module, device: str) -> dict[str, Tensor]:
        images, numbers = (part.to(device) for part in self.held_out)
        found = [network(some) for some in images.split(self.params.batch)]
        maps, logits = (torch.cat(parts) for parts in zip(*found, strict=True))
        other = maps.roll(1, 0), logits.roll(1, 0)
        return {name: self.set_loss(answers, numbers).detach()
                for name, answers in (("held_out", (maps, logits)), ("other_pictures", other))}

    def numbers(self, code: Maps) -> Tensor:
        """(N,6), NaN where the code has fewer maps."""
        rows = torch.full((self.params.maps, 6), torch.nan)
        rows[:len(code)] = torch.from_numpy(code).float()
        return rows


def match(maps: Tensor, truth: Tensor) -> Tensor:
    """Which of the maps (B,M,6) stands for each map of the truth (B,N,6), N <= M, so that the sum of the squared errors
    of matrices and offsets is least (the Hungarian method): numbers (B,N). No two stand for the same.

    The rows of NaN, where a code has fewer maps, get the maps that are left. All codes go to the CPU in one transfer.
    """
    costs = torch.cdist(truth.double().nan_to_num(), maps.detach().double()).square()
    costs = (costs * truth.isfinite().all(2, keepdim=True)).nan_to_num().cpu().numpy()  # `train` refuses a NaN itself
    slots = np.stack([linear_sum_assignment(cost)[1] for cost in costs])
    return torch.from_numpy(slots).to(maps.device)
