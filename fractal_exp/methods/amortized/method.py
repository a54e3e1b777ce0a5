"""Amortised set prediction: the maps that a network finds in the image, in one pass.

Source: Yamaguti 2026. Its code may also be what the paper's optimiser begins with (`init=amortized`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import torch
from pydantic import Field
from torch import Tensor

from ...rendering.still import render
from ...runtime.checkpoint import Checkpoint
from ...runtime.params import Share
from ...runtime.precision import full_precision
from ..base import AnyTarget, CodeReconstruction, OnStep, Progress, check_target
from ..neural_regression.method import code_of
from ..pretrained import Pretrained, PretrainedParams, resized_input
from .network import SetNetwork


class AmortizedParams(PretrainedParams):
    """The parameters of amortised set prediction; those of its training stand in `fractal_exp.training`."""

    maps: Annotated[int, Field(ge=1, le=64)] = 10
    """Number of maps at most; weights know one number."""
    side: Annotated[int, Field(ge=16, le=512, multiple_of=8)] = 64
    """Pixels a side of the image as the network sees it; weights know one size."""
    present: Share = 0.5
    """Chance of being there from which on a map belongs to the code,"""
    fewest: Annotated[int, Field(ge=1, le=64)] = 2
    """which has so many of the likeliest ones at least."""
    largest: Annotated[float, Field(gt=0, lt=1)] = 0.99
    """Largest singular value of a map: a matrix above it is shrunk as a whole, as a code must contract."""


class Amortized(Pretrained):
    """The code of the maps that a trained network finds in the image, brought to the frame (Yamaguti 2026)."""

    name = "amortized"
    asked = {"side": "images of the side", "maps": "a number of maps of"}
    Params = AmortizedParams
    params: AmortizedParams

    @classmethod
    def build(cls, recipe: Mapping[str, Any]) -> SetNetwork:
        return SetNetwork(recipe["maps"], recipe["channels"], recipe["heads"], recipe["hidden"])

    def check_size(self, target: Tensor) -> None:
        resized_input(target, self.params.side, "the network")

    @full_precision()
    @torch.no_grad()
    def reconstruct(self, target: AnyTarget, *, on_step: OnStep | None = None, checkpoint: Checkpoint | None = None
                    ) -> CodeReconstruction:
        image = resized_input(check_target(target), self.params.side, "the network")
        network, _ = self.loaded()
        maps, logits = (part[0].cpu() for part in network(image[None].to(self.device)))
        kept = chosen(logits.sigmoid(), self.params.present, self.params.fewest)
        code = code_of(maps[kept], self.params.largest)
        if on_step:
            preview = render(code, resolution=self.params.side)
            on_step(Progress(1, 1.0, {"maps": len(code)}, preview, "network", code))
        return CodeReconstruction(code, "one pass of the network done", evaluations=0)


def chosen(probabilities: Tensor, present: float, fewest: int) -> Tensor:
    """The numbers of the maps whose chance (M,) is high enough, or of the `fewest` likeliest ones, in their order."""
    order = probabilities.argsort(descending=True, stable=True)
    count = max(int((probabilities >= present).sum()), min(fewest, len(probabilities)))
    return order[:count].sort().values


def laptop(*, resolution: int = 256, seed: int = 0, seconds: float | None = None, **options: Any) -> Amortized:
    """The method. It takes images of any resolution from the network's own on; the seed makes no difference, as nothing
    is drawn."""
    return Amortized(seconds=seconds, **options)
