"""Which meaning the grey levels of an image have: as it is given, or as they look."""

from __future__ import annotations

from torch import Tensor

from ..params import CameraParams
from .levels import Binary, Density, Levels
from .pens import Dots, Drawn

LEVELS: dict[str, type[Levels]] = {"density": Density, "dots": Dots, "coverage": Drawn, "binary": Binary}
Camera = tuple[str | float, ...]   # the name of the levels and their values; empty: as the levels are given


def levels_of(image: Tensor, name: str, camera: CameraParams) -> Levels:
    """What the grey levels of an image (R,R) mean, by name; "auto": as they look."""
    return LEVELS[guess_levels(image, camera) if name == "auto" else name](camera, image)


def seen_with(levels: Levels, camera: Camera) -> Levels:
    """The levels of the same image with an estimated camera."""
    if not camera:
        return levels
    name, *values = camera
    return LEVELS[name](levels.camera, levels.image, tuple(values))


def camera_of(levels: Levels) -> Camera:
    """That with which the levels were estimated."""
    return (next(name for name, each in LEVELS.items() if each is type(levels)), *levels.values) if levels.values else ()


def guess_levels(image: Tensor, camera: CameraParams) -> str:
    """"binary" if there are no greys; "density" if all are shares of as many subpixels as our renderer has; "coverage"
    for what others drew."""
    if bool(((image == 0) | (image == 1)).all()):
        return "binary"
    shares = image * camera.supersample**2
    return "density" if bool(((shares - shares.round()).abs() < camera.rounding).all()) else "coverage"
