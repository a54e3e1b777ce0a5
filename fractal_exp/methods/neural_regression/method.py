"""Neural regression: one pass of a network that was trained on random codes and their images.

Source: Graham and Demers 2021, as "Learning Image Fractals" (Eurographics 2025, section 5.1) compared with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import torch
from pydantic import Field
from torch import Tensor

from ...ifs import attractor
from ...ifs.code import IFS
from ...rendering.still import render
from ...runtime.checkpoint import Checkpoint
from ...runtime.precision import full_precision
from ..base import AnyTarget, CodeReconstruction, OnStep, Progress, check_target
from ..population.search import largest_singular_value
from ..pretrained import Pretrained, PretrainedParams, resized_input
from .network import RegressionNetwork

BLOCK = 8  # the side is halved by each of three blocks


class NeuralRegressionParams(PretrainedParams):
    """The parameters of neural regression; those of its training stand in `fractal_exp.training`."""

    maps: Annotated[int, Field(ge=1, le=64)] = 10
    """Number of maps of the code; weights know one number (10 in the paper's comparison)."""
    side: Annotated[int, Field(ge=16, le=512, multiple_of=BLOCK)] = 64
    """Pixels a side of the image as the network sees it; weights know one size."""
    largest: Annotated[float, Field(gt=0, lt=1)] = 0.99
    """Largest singular value of a map: a matrix above it is shrunk as a whole, as a code must contract."""
    as_released: bool = False
    """Whether the network is trained as in the program released with the paper, see docs/comparisons.md."""


class NeuralRegression(Pretrained):
    """The code that a trained network reads off the image, brought to the frame (Graham and Demers 2021)."""

    name = "neural_regression"
    asked = {"side": "images of the side", "maps": "a number of maps of", "as_released": "the setting as_released ="}
    Params = NeuralRegressionParams
    params: NeuralRegressionParams

    @classmethod
    def build(cls, recipe: Mapping[str, Any]) -> RegressionNetwork:
        return RegressionNetwork(recipe["side"], recipe["maps"], recipe["channels"], recipe["hidden"],
                                 recipe["residual"], linear=recipe["as_released"])

    def check_size(self, target: Tensor) -> None:
        resized_input(target, self.params.side, "the network")

    @full_precision()
    @torch.no_grad()
    def reconstruct(self, target: AnyTarget, *, on_step: OnStep | None = None, checkpoint: Checkpoint | None = None
                    ) -> CodeReconstruction:
        image = resized_input(check_target(target), self.params.side, "the network")
        network, _ = self.loaded()
        code = code_of(network(image[None].to(self.device))[0].cpu(), self.params.largest)
        if on_step:
            preview = render(code, resolution=self.params.side) if on_step else None
            on_step(Progress(1, 1.0, {"maps": len(code)}, preview, "network", code))
        return CodeReconstruction(code, "one pass of the network done", evaluations=0)


def code_of(numbers: Tensor, largest: float) -> IFS:
    """The code of rows (N,6), its matrices shrunk to this singular value where they are above it, in the frame."""
    linear = numbers[:, :4].unflatten(-1, (2, 2))
    shrink = (largest / largest_singular_value(linear).clamp_min(1e-12)).clamp_max(1)
    return attractor.normalize(IFS(linear * shrink[:, None, None], numbers[:, 4:]).check_contractive())


def laptop(*, resolution: int = 256, seed: int = 0, seconds: float | None = None, **options: Any) -> NeuralRegression:
    """The method with the weights in the package. It takes images of any resolution from the network's own on; the
    seed makes no difference, as nothing is drawn."""
    return NeuralRegression(seconds=seconds, **options)
