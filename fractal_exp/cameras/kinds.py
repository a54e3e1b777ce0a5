"""The kinds of cameras by name, and the levels of an image."""

from __future__ import annotations

from importlib import import_module

from torch import Tensor

from ..errors import InputError
from ..images.known import Known
from ..images.levels import DRAWN
from .camera import KNOWN, Camera
from .levels import Levels
from .params import CameraParams

# The module and the class of each kind, by name, in the order in which they are tried: those that explain less first.
KINDS = {"density": ".levels.Density", "linear": ".linear.Linear", "binary": ".levels.Binary",
         "coverage": ".pens.Inked", "strokes": ".strokes.Strokes", "dots": ".pens.Dots",
         "tonemapped": ".pens.ToneMapped"}


def kind_of(name: str) -> type[Levels]:
    """The levels of this kind. Its module is loaded at the first use: most images need only one."""
    module, _, own = KINDS[name].rpartition(".")
    return getattr(import_module(module, __package__), own)


def of_others() -> list[str]:
    """The kinds that a picture may have that others drew: all whose camera is estimated, except those that are tried
    beside another."""
    return [name for name in KINDS if not kind_of(name).is_exact and kind_of(name).beside is None]


def beside(name: str) -> list[str]:
    """The kinds that are tried beside another."""
    return [other for other in KINDS if kind_of(other).beside == name]


def levels_of(image: Tensor, meaning: str, params: CameraParams, known: Known | None = None) -> Levels:
    """The levels of an image (R,R) whose grey levels have a meaning (see `images.levels`), and that shows a part of the
    canvas, None: all of it. Raises `InputError` if no camera that it may have has a value that the user knows."""
    told, possible = params.all_known, of_others() if meaning == DRAWN else [meaning]
    for name, value in told.items():
        if not any(name in kind_of(kind).values for kind in possible):
            raise InputError(f"camera.{KNOWN[name]} must be null if levels is {meaning}, got {value}")
    if meaning != DRAWN:
        return kind_of(meaning)(params, image).within(known)
    if params.blur_px is not None and not params.estimate:
        raise InputError("camera.blur_px must be null if camera.estimate is false and levels is not linear, got "
                         f"{params.blur_px}")
    kinds = tuple(kind for kind in possible if set(told) <= set(kind_of(kind).values))
    if not kinds:
        names = " and ".join(f"camera.{KNOWN[name]}" for name in told)
        raise InputError(f"{names} must not be given together, because no kind of camera has all of them; got "
                         + ", ".join(map(str, told.values())))
    return kind_of("coverage")(params, image, kinds=kinds).within(known)


def with_camera(levels: Levels, camera: Camera | None) -> Levels:
    """The levels of the same image with a camera; as they are without one."""
    if camera is None:
        return levels
    return kind_of(camera.kind)(levels.params, levels.image, camera, levels.kinds).within(levels.known)
