"""The kinds of cameras by name, and the levels of an image."""

from __future__ import annotations

from importlib import import_module

from torch import Tensor

from ..errors import InputError
from ..images.levels import DRAWN
from .camera import Camera
from .levels import Levels
from .params import KNOWN, CameraParams

KINDS = {"density": "levels.Density", "linear": "linear.Linear", "dots": "pens.Dots", "tonemapped": "pens.ToneMapped",
         "coverage": "pens.Drawn", "strokes": "strokes.Strokes", "binary": "levels.Binary"}   # where each is, by name
OF_OTHERS = "coverage", "dots", "tonemapped"   # kinds that a picture may have that others drew; strokes are coverage


def kind_of(name: str) -> type[Levels]:
    """The levels of this kind. Its module is loaded at the first use: most images need only one."""
    module, _, own = KINDS[name].rpartition(".")
    return getattr(import_module(f".{module}", __package__), own)


def levels_of(image: Tensor, meaning: str, params: CameraParams) -> Levels:
    """The levels of an image (R,R) whose grey levels have a meaning (see `images.levels`). Raises `InputError` if
    no camera that it may have has a value that the user knows."""
    for name, given in KNOWN.items():
        if params.known(name) is not None and not any(name in kind_of(kind).values for kind in _possible(meaning)):
            raise InputError(f"camera.{given} must be null if levels is {meaning}, got {params.known(name)}")
    if meaning != DRAWN:
        return kind_of(meaning)(params, image)
    if params.blur_px is not None and not params.estimate:
        raise InputError("camera.blur_px must be null if camera.estimate is false and levels is not linear, got "
                         f"{params.blur_px}")
    return kind_of("coverage")(params, image, kinds=kinds_of(params))


def _possible(meaning: str) -> tuple[str, ...]:
    return OF_OTHERS if meaning == DRAWN else (meaning,)


def kinds_of(params: CameraParams) -> tuple[str, ...]:
    """The kinds of a picture that others drew that have all the values which the user knows."""
    known = {name for name in KNOWN if params.known(name) is not None}
    return tuple(kind for kind in OF_OTHERS if known <= set(kind_of(kind).values))


def with_camera(levels: Levels, camera: Camera | None) -> Levels:
    """The levels of the same image with a camera; as they are without one."""
    return levels if camera is None else kind_of(camera.kind)(levels.params, levels.image, camera, levels.kinds)
