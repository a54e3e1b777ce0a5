"""Super-resolution: the image, drawn eight times as large by a network that was trained on random fractals.

Source: Liang et al. 2021 (SwinIR), as "Learning Image Fractals" (Eurographics 2025, section 5.1) compared with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import product
from typing import Annotated, Any

import torch
from pydantic import Field
from torch import Tensor

from ...errors import InputError
from ...runtime.checkpoint import Checkpoint
from ...runtime.precision import full_precision
from ..base import AnyTarget, OnStep, Progress, check_target
from ..pretrained import Pretrained, PretrainedParams
from .enlarged import Enlarged
from .network import SwinIR

SMALLEST_INPUT = 16
GREY_LEVELS = 255  # an 8-bit file's


class SuperResolutionParams(PretrainedParams):
    """The parameters of super-resolution; those of its training stand in `fractal_exp.training`."""

    factor: Annotated[int, Field(ge=2, le=16)] = 8
    """How many times the image is enlarged, and the largest zoom of a view; weights know one factor (8 in the paper's
    comparison)."""
    width: Annotated[int, Field(ge=1)] = 32
    """Channels of the network's features; weights know one width (180 by Liang et al.)."""
    tile: Annotated[int, Field(ge=16, le=4096, multiple_of=8)] = 64
    """Pixels a side of the pieces that the network enlarges one after another,"""
    margin: Annotated[int, Field(ge=0, le=256, multiple_of=8)] = 16
    """and of what it sees around each of them."""


class SuperResolution(Pretrained):
    """The image enlarged by a network, an `Enlarged`, which refuses views from closer by than that."""

    name = "super_resolution"
    asked = {"factor": "a factor of", "width": "a width of"}
    Params = SuperResolutionParams
    params: SuperResolutionParams

    @classmethod
    def build(cls, recipe: Mapping[str, Any]) -> SwinIR:
        return SwinIR(recipe["width"], recipe["groups"], recipe["layers"], recipe["heads"], recipe["window"],
                      recipe["features"], recipe["factor"])

    def check_size(self, target: Tensor) -> None:
        if len(target) < SMALLEST_INPUT:
            raise InputError(f"the network sees {SMALLEST_INPUT}² pixels at least, and the target has {len(target)}²; "
                             f"raise resolution to {SMALLEST_INPUT} or more")

    @full_precision()
    @torch.no_grad()
    def reconstruct(self, target: AnyTarget, *, on_step: OnStep | None = None, checkpoint: Checkpoint | None = None
                    ) -> Enlarged:
        image = check_target(target)
        self.check_size(image)
        network, _ = self.loaded()
        factor, tile = self.params.factor, self.params.tile
        enlarged = torch.empty(factor * len(image), factor * len(image))
        pieces = list(product(range(0, len(image), tile), repeat=2))  # their upper left corners
        for done, (row, column) in enumerate(pieces, 1):
            part = self._enlarge(network, image, row, column)
            enlarged[factor * row:factor * (row + tile), factor * column:factor * (column + tile)] = part
            if on_step:
                on_step(Progress(done, done / len(pieces), {}, image if done == len(pieces) else None,
                                 f"piece {done} of {len(pieces)}"))
        return Enlarged(rounded(enlarged), float(factor))

    def _enlarge(self, network: Callable[[Tensor], Tensor], image: Tensor, row: int, column: int) -> Tensor:
        """The piece of the image that begins here, enlarged."""
        (low, high), (left, right) = (self._seen(begin, len(image)) for begin in (row, column))
        seen = network(image[None, low:high, left:right].to(self.device))[0].cpu()
        factor, tile = self.params.factor, self.params.tile
        return seen[factor * (row - low):factor * (row + tile - low), factor * (column - left):factor * (
            column + tile - left)]

    def _seen(self, begin: int, side: int) -> tuple[int, int]:
        return max(0, begin - self.params.margin), min(side, begin + self.params.tile + self.params.margin)


def rounded(image: Tensor) -> Tensor:
    """An image as a file of 8 bits holds it. What is nearly black becomes black: a pixel counts as lit above 0."""
    return (image.clamp(0, 1) * GREY_LEVELS).round() / GREY_LEVELS
