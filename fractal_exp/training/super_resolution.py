"""The training of super-resolution: pieces of pictures of random fractals, and the same eight times as fine.

Source: Liang et al. 2021 (SwinIR, section 4.1). "Learning Image Fractals" (Eurographics 2025, section 5.1) trained it
on 10 000 fractals.
"""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

import numpy as np
import torch
from pydantic import Field, model_validator
from torch import Tensor, nn

from ..errors import InputError
from ..methods.super_resolution.method import SuperResolution
from ..rendering.still import points_per_view
from ..runtime.params import Positive
from ..suite import TARGET_SUPERSAMPLE
from . import drawing
from .codes import HELD_OUT, TRAINING, CodeTraining, Maps, similar, table
from .loop import Batch, Recipe

POINTS = 2048  # of an attractor; pieces are taken about one of them
HALVED = (0.5, 0.8, 0.9, 0.95)  # shares of the steps at which the rate is halved (Liang et al. 2021)


class SuperResolutionRecipe(Recipe):
    """How the network of super-resolution is trained."""

    width: Positive = 180
    """Channels of the deep features (180 by Liang et al.)."""
    groups: Positive = 6
    """Residual groups (6 by Liang et al.),"""
    layers: Positive = 6
    """each of so many Swin blocks (6 by Liang et al.)."""
    heads: Positive = 6
    """Heads of the attention (6 by Liang et al.)."""
    window: Annotated[int, Field(ge=2)] = 8
    """Pixels a side within which pixels attend to each other (8 by Liang et al.)."""
    features: Positive = 64
    """Channels of the upsampling (64 by Liang et al.)."""
    factor: Annotated[int, Field(ge=2, le=16)] = 8
    """How many times pictures are enlarged, a power of 2 (8 in the paper's comparison)."""
    side: Annotated[int, Field(ge=16, le=4096)] = 1000
    """Pixels a side of the whole pictures that pieces are taken from (1000 in the paper's comparison),"""
    patch: Annotated[int, Field(ge=8)] = 48
    """and of a piece before it is enlarged (48 by Liang et al.)."""
    supersample: Annotated[int, Field(ge=1, le=16)] = 4
    """Subpixels a side of a pixel of the fine pieces; points are fewer in the same measure, so that grey levels are
    those of a target (16)."""
    codes: Positive = 10_000
    """Codes to learn from (10 000 in the paper's comparison); they come back with other pieces."""
    steps: Positive = 500_000
    """Steps (500 000 by Liang et al.)."""
    every: Positive = 5000
    """Steps from one look at the held-out pieces to the next."""
    rate: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 2e-4
    """Learning rate of Adam at first (0.0002 by Liang et al.); halved after 50, 80, 90 and 95% of the steps."""
    held_out: Positive = 64
    """Codes that are held out, a piece of each."""

    @model_validator(mode="after")
    def _sizes_fit(self) -> SuperResolutionRecipe:
        if self.factor & (self.factor - 1):
            raise InputError(f"factor must be a power of 2, got {self.factor}")
        if self.width % self.heads:
            raise InputError(f"width must be a multiple of the number of heads, got {self.width} and {self.heads}")
        if self.patch > self.side:
            raise InputError(f"patch must be at most side, as it is a piece of the picture, got {self.patch} of "
                             f"{self.side}")
        return self


class SuperResolutionTraining(CodeTraining):
    """The training of super-resolution. The loss is the mean absolute error; bicubic interpolation is what it must
    beat."""

    method = SuperResolution
    Params = SuperResolutionRecipe
    params: SuperResolutionRecipe

    @property
    def steps(self) -> int:
        return self.params.steps

    @property
    def every(self) -> int:
        return self.params.every

    def rate(self, step: int) -> float:
        return self.params.rate * 0.5 ** sum(step >= share * self.steps for share in HALVED)

    def batch(self, step: int) -> Batch:
        rng = np.random.Generator(np.random.PCG64(self.stream(TRAINING, "batch", step)))
        numbers = rng.integers(self.params.codes, size=self.params.batch)
        return self._pieces([self.code(int(number)) for number in numbers], rng)

    def loss(self, network: nn.Module, batch: Batch) -> Tensor:
        coarse, fine = batch
        return (network(coarse) - fine).abs().mean()

    def errors(self, network: nn.Module, device: str) -> dict[str, Tensor]:
        errors = [(network(coarse.to(device)).cpu() - fine).abs().mean((1, 2)) for coarse, fine in
                  zip(*(part.split(self.params.batch) for part in self._held_out), strict=True)]
        return {"held_out": torch.cat(errors), "bicubic": self._bicubic_errors}

    @cached_property
    def _held_out(self) -> Batch:
        rng = np.random.Generator(np.random.PCG64(self.stream(HELD_OUT, "batch")))
        return self._pieces(self.held_out_codes(), rng)

    @cached_property
    def _bicubic_errors(self) -> Tensor:
        coarse, fine = self._held_out
        enlarged = torch.nn.functional.interpolate(coarse[:, None], scale_factor=self.params.factor, mode="bicubic")
        return (enlarged[:, 0].clamp(0, 1) - fine).abs().mean((1, 2))

    def _pieces(self, codes: list[Maps], rng: np.random.Generator) -> Batch:
        """A piece (S,S) of each code's picture about a random point of the attractor, and the same (fS,fS)."""
        side, patch, zoom = self.params.side, self.params.patch, self.params.side / self.params.patch
        views = []
        for code in codes:
            points = drawing.orbit(*table([code]), rng.integers(2**31, size=1), POINTS)[0]
            corner = np.round((points[int(rng.integers(len(points)))] + 1) * side / 2 - patch / 2)  # whole pixels
            center = (np.clip(corner, 0, side - patch) + patch / 2) * 2 / side - 1
            views.append(similar(code, zoom, -zoom * center))
        factor, parts = self.params.factor, self.params.supersample
        coarse = self._draw(views, patch, points_per_view(side), TARGET_SUPERSAMPLE, rng)
        fewer = (parts / TARGET_SUPERSAMPLE) ** 2
        fine = self._draw(views, factor * patch, round(points_per_view(factor * side) * fewer), parts, rng)
        return coarse, fine

    @staticmethod
    def _draw(views: list[Maps], side: int, points: int, parts: int, rng: np.random.Generator) -> Tensor:
        """Images (B,S,S) of so many points on the whole attractor, most of them out of sight."""
        counts, seeds = np.full(len(views), max(1, points)), rng.integers(2**62, size=len(views))
        return torch.from_numpy(drawing.draw(*table(views), seeds, counts, side, parts))
