"""Which meaning the grey levels of an image have."""

from __future__ import annotations

from torch import Tensor
from torch.nn.functional import max_pool2d

from ..params import CameraParams
from .levels import Binary, Coverage, Density, Levels
from .linear import Linear

LEVELS: dict[str, type[Levels]] = {"density": Density, "linear": Linear, "coverage": Coverage, "binary": Binary}


def levels_of(image: Tensor, name: str, camera: CameraParams) -> Levels:
    """What the grey levels of an image (R,R) mean, by name; "auto": as they look."""
    return LEVELS[guess_levels(image, camera) if name == "auto" else name].of(image, camera)


def guess_levels(image: Tensor, camera: CameraParams) -> str:
    """"binary" if there are no greys; "density" if many pixels that are lit all around are not white, as in a rendering
    by the chaos game; else "coverage", as in an anti-aliased image."""
    if bool(((image == 0) | (image == 1)).all()):
        return "binary"
    inner = -max_pool2d(-image[None, None], 3, 1, 1)[0, 0] > camera.lit
    inner[0] = inner[-1] = inner[:, 0] = inner[:, -1] = False
    if not bool(inner.any()):
        return "density"
    return "density" if float((image[inner] < camera.white).float().mean()) > camera.density_share else "coverage"
