"""Choose what the grey levels of an image mean, by name or by their look."""

from __future__ import annotations

from collections.abc import Mapping

from torch import Tensor

from ....images.target_levels import has_target_levels
from ..params.camera import CameraParams
from .levels import Binary, Density, Levels
from .linear import Linear
from .pens import Dots, Drawn, ToneMapped
from .strokes import Strokes

LEVELS: dict[str, type[Levels]] = {"density": Density, "linear": Linear, "dots": Dots, "tonemapped": ToneMapped,
                                   "coverage": Drawn, "strokes": Strokes, "binary": Binary}
Camera = tuple[str | float, ...]   # the name of the levels and their values; empty: nothing was estimated


def levels_of(image: Tensor, name: str, camera: CameraParams) -> Levels:
    """The levels of an image (R,R), by name; "auto": guessed from the image."""
    return LEVELS[guess_levels(image, camera) if name == "auto" else name].of(image, camera)


def seen_with(levels: Levels, camera: Camera) -> Levels:
    """The levels of the same image with an estimated camera."""
    if not camera:
        return levels
    name, *values = camera
    return LEVELS[str(name)](levels.camera, levels.image, tuple(float(value) for value in values))


def camera_of(levels: Levels, values: tuple[float, ...] | None = None) -> Camera:
    """The camera of these levels, with their own or other values; empty if there are no values."""
    values = levels.values if values is None else values
    return (_name(levels), *values) if values else ()


def described(levels: Levels) -> dict[str, str | float]:
    """The camera as a dictionary, with lengths in pixels of the image. `taken_with` reads it back."""
    name = _name(levels)
    pixel = 1.0 if levels.image is None else 2 / len(levels.image)
    units = [1.0] * len(levels.numbers) + [pixel] * len(levels.lengths)
    return {"levels": name, **{key: value / unit for key, value, unit in
                               zip((*levels.numbers, *levels.lengths), levels.values, units, strict=False)}}


def _name(levels: Levels) -> str:
    return next(name for name, each in LEVELS.items() if each is type(levels))


def taken_with(image: Tensor, described: Mapping[str, str | float], camera: CameraParams) -> Levels:
    """The levels of an image (R,R) with the camera that `described` returned."""
    kind, pixel = LEVELS[str(described["levels"])], 2 / len(image)
    values = (*(float(described[key]) for key in kind.numbers if key in described),
              *(float(described[key]) * pixel for key in kind.lengths if key in described))
    return kind(camera, image, values)


def guess_levels(image: Tensor, camera: CameraParams) -> str:
    """"binary" if there are no greys; "density" if all greys are whole numbers of our renderer's subpixels, and some
    are odd, unlike in a shrunk picture; else "coverage", for pictures that others drew."""
    if bool(((image == 0) | (image == 1)).all()):
        return "binary"
    return "density" if has_target_levels(image, camera.supersample, camera.rounding) else "coverage"
