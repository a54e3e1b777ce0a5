"""Check a picture and the options for reading it, and turn its levels into floats."""

from __future__ import annotations

from collections.abc import Iterable
from numbers import Integral, Real
from typing import Any, Literal, get_args

import numpy as np
import torch
from torch import Tensor

from ..errors import InputError
from ..runtime.checks import check_choice, into_unit

MIN_SIDE = 16                            # pixels, for a picture and for a target
ROUNDING = 1e-5                          # floats may leave [0,1] by this much
Frame = Literal["fit", "part", "keep"]   # how a picture is brought to the canvas, see `reading.read_target`
WHITE_LEVELS = {"bool": 1, "uint8": 255, "uint16": 65535, "float16": 1, "float32": 1, "float64": 1}


class Notes(list[str]):
    """Sentences for the log, some of them warnings.

    doubtful: whether what is taken for the background may be the shape. unclear: why the picture shows no clear shape,
    in words; empty if it shows one.
    """

    def __init__(self) -> None:
        super().__init__()
        self.warnings: list[str] = []
        self.doubtful = False
        self.unclear = ""

    def take(self, others: Notes) -> None:
        """Add the notes of another list."""
        self.extend(others)
        self.warnings += others.warnings
        self.doubtful, self.unclear = self.doubtful or others.doubtful, self.unclear or others.unclear

    def warn(self, sentence: str) -> None:
        self.append(sentence)
        self.warnings.append(sentence)

    def no_clear_shape(self, reason: str) -> None:
        self.unclear = reason
        self.warn(f"not a clear shape: {reason}; cut one shape out, on a background of one colour")


def check_resolution(resolution: Any) -> int:
    """The side of a target in pixels as an int. Raises `InputError` unless it is whole and at least 16."""
    whole = int(resolution) if isinstance(resolution, Integral) and not isinstance(resolution, bool) else 0
    if whole < MIN_SIDE:
        raise InputError(f"resolution must be a whole number of at least {MIN_SIDE} pixels, got {resolution!r}")
    return whole


def check_options(invert: Any, threshold: Any, padding: Any, frame: Any, clean: Any) -> None:
    """Raise `InputError` if an option of `read_target` is out of range."""
    if not (isinstance(invert, bool | np.bool_) or (isinstance(invert, str) and invert == "auto")):
        raise InputError(f'invert must be "auto", true or false, got {invert!r}')
    if threshold is not None and not (isinstance(threshold, Real) and 0 < float(threshold) < 1):
        raise InputError(f"threshold must be between 0 and 1, or none for a grey target; got {threshold!r}")
    if not (isinstance(padding, Real) and 0 <= float(padding) < 1):
        raise InputError(f"padding must be at least 0 and below 1 (0.25 leaves the shape 75%), got {padding!r}")
    check_choice("frame", frame, get_args(Frame))
    if not isinstance(clean, bool | np.bool_):
        raise InputError(f"clean must be true or false, got {clean!r}")


def check_crop(crop: Any) -> tuple[int, int, int, int]:
    """A crop as ints. Raises `InputError` unless it is four whole numbers that enclose something."""
    given = () if isinstance(crop, str) or not isinstance(crop, Iterable) else tuple(crop)
    if len(given) != 4 or not all(isinstance(side, Integral) and not isinstance(side, bool) for side in given):
        raise InputError("crop must be four whole numbers (left, top, right, bottom), in pixels of the picture, got "
                         f"{crop!r}")
    left, top, right, bottom = map(int, given)
    if not (left < right and top < bottom):
        raise InputError("crop is (left, top, right, bottom) with left below right and top below bottom, got "
                         f"{(left, top, right, bottom)}, which is empty")
    return left, top, right, bottom


def check_within(crop: tuple[int, int, int, int], width: int, height: int) -> None:
    """Raise `InputError` if a crop leaves a picture of this size."""
    left, top, right, bottom = crop
    if left < 0 or top < 0 or right > width or bottom > height:
        raise InputError(f"crop must lie within (0, 0, {width}, {height}), the whole picture, got {crop}")


def check_pixels(image: Any, name: str) -> np.ndarray:
    """The array behind an image, unchanged. Raises `InputError` if its shape, type or range is unusable."""
    if isinstance(image, Tensor):
        image = image.detach().cpu()
        image = (image.float() if image.dtype == torch.bfloat16 else image).numpy()
    if not isinstance(image, np.ndarray):
        raise InputError(f"an image is a path, a NumPy array or a torch tensor, got {type(image).__name__}")
    if not (image.ndim == 2 or (image.ndim == 3 and image.shape[2] in (3, 4))):
        remedy = "; move the channels last" if image.ndim == 3 and image.shape[0] in (3, 4) else ""
        raise InputError(f"{name} must have shape (H, W), (H, W, 3) or (H, W, 4), got {image.shape}{remedy}")
    if image.size == 0:
        raise InputError(f"{name} has no pixels: shape {image.shape}")
    if image.dtype.name not in WHITE_LEVELS:
        raise InputError(f"{name} must be bool, uint8, uint16 or floats in [0, 1], got {image.dtype}; convert it")
    if image.dtype.kind == "f":
        bad = int(np.size(image) - np.count_nonzero(np.isfinite(image)))
        if bad:
            raise InputError(f"{name} must be finite, but {bad} of its values are NaN or infinite; replace them")
        low, high = float(image.min()), float(image.max())
        if low < -ROUNDING or high > 1 + ROUNDING:
            raise InputError(f"{name} must lie in [0, 1] if it holds floats, got {low:.4g} to {high:.4g}; "
                             f"{into_unit(low, high)}{'' if low < 0 else ', or pass uint8'}")
    return image


def unit(pixels: np.ndarray, dtype: type = np.float32) -> np.ndarray:
    """Levels as floats in [0,1]."""
    return (pixels.astype(dtype) / WHITE_LEVELS[pixels.dtype.name]).clip(0, 1)
