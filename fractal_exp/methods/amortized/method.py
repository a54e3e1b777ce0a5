"""Amortised set prediction: the maps that a network finds in the image, in one pass.

Source: Yamaguti 2026. Its code may also be what the paper's optimiser begins with (`init=amortized`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field
from torch import Tensor, nn

from ...ifs.code import IFS
from ...runtime.params import Share
from ..neural_regression.method import code_of
from ..pretrained import CodeReader, CodeReaderParams
from .network import SetNetwork


class AmortizedParams(CodeReaderParams):
    """The parameters of amortised set prediction; those of its training stand in `fractal_exp.training`."""

    maps: Annotated[int, Field(ge=1, le=64)] = 10
    """Number of maps at most; weights know one number."""
    present: Share = 0.5
    """Chance of being there from which on a map belongs to the code,"""
    fewest: Annotated[int, Field(ge=1, le=64)] = 2
    """which has so many of the likeliest ones at least."""


class Amortized(CodeReader):
    """The code of the maps that a trained network finds in the image, brought to the frame (Yamaguti 2026)."""

    name = "amortized"
    asked = {"side": "images of the side", "maps": "a number of maps of"}
    Params = AmortizedParams
    params: AmortizedParams

    @classmethod
    def build(cls, recipe: Mapping[str, Any]) -> SetNetwork:
        return SetNetwork(recipe["maps"], recipe["channels"], recipe["heads"], recipe["hidden"])

    def read_off(self, network: nn.Module, image: Tensor) -> IFS:
        maps, logits = (part[0].cpu() for part in network(image))
        return code_of(maps[chosen(logits.sigmoid(), self.params.present, self.params.fewest)], self.params.largest)


def chosen(probabilities: Tensor, present: float, fewest: int) -> Tensor:
    """The numbers of the maps whose chance (M,) is high enough, or of the `fewest` likeliest ones, in their order."""
    order = probabilities.argsort(descending=True, stable=True)
    count = max(int((probabilities >= present).sum()), min(fewest, len(probabilities)))
    return order[:count].sort().values
