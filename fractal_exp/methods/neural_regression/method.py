"""Neural regression: one pass of a network that was trained on random codes and their images.

Source: Graham and Demers 2021, as "Learning Image Fractals" (Eurographics 2025, section 5.1) compared with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

from pydantic import Field
from torch import Tensor, nn

from ...ifs import affine, attractor
from ...ifs.code import IFS
from ..pretrained import CodeReader, CodeReaderParams
from .network import RegressionNetwork


class NeuralRegressionParams(CodeReaderParams):
    """The parameters of neural regression; those of its training stand in `fractal_exp.training`."""

    maps: Annotated[int, Field(ge=1, le=64)] = 10
    """Number of maps of the code; weights know one number (10 in the paper's comparison)."""
    as_released: bool = False
    """Whether the network is trained as in the program released with the paper, see docs/comparisons.md."""


class NeuralRegression(CodeReader):
    """The code that a trained network reads off the image, brought to the frame (Graham and Demers 2021)."""

    name = "neural_regression"
    asked = {"side": "images of the side", "maps": "a number of maps of", "as_released": "the setting as_released ="}
    Params = NeuralRegressionParams
    params: NeuralRegressionParams

    @classmethod
    def build(cls, recipe: Mapping[str, Any]) -> RegressionNetwork:
        return RegressionNetwork(recipe["side"], recipe["maps"], recipe["channels"], recipe["hidden"],
                                 recipe["residual"], linear=recipe["as_released"])

    def read_off(self, network: nn.Module, image: Tensor) -> IFS:
        return code_of(network(image)[0].cpu(), self.params.largest)


def code_of(numbers: Tensor, largest: float) -> IFS:
    """The code of rows (N,6), its matrices shrunk to this singular value where they are above it, in the frame."""
    return attractor.normalize(affine.to_code(affine.shrunk(numbers, largest)).check_contractive())
