"""Pictures in and out: reading a target, checked, white on black, centred and padded; writing a PNG."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from PIL import Image, ImageOps, UnidentifiedImageError
from torch import Tensor

from .errors import InputError

PADDING = 0.25                           # of the canvas, in all; the shape's longer side spans the rest
MIN_SIDE = 16                            # pixels, of a picture and of a target
MIN_CONTRAST = 0.02                      # between the darkest and the lightest pixel
SHAPE_LEVEL = 0.1                        # of the contrast: what lies above it belongs to the shape
LUMINANCE = (0.2126, 0.7152, 0.0722)     # of red, green and blue: ITU-R BT.709
ROUNDING = 1e-5                          # floats may leave [0,1] by this much
WHITE_LEVELS = {"bool": 1, "uint8": 255, "uint16": 65535, "float16": 1, "float32": 1, "float64": 1}
EXIF_ORIENTATION = 0x0112


@dataclass(frozen=True, eq=False)
class Target:
    """A picture brought onto the canvas, and what was done to it.

    image (R,R) float32 in [0,1], white shape on black; inverted, whether the picture was black on white; source_size
    (width, height) in pixels, upright; crop_box (x0, y0, x1, y1), the square of the picture that fills the canvas, in
    its pixels from the upper left corner, which may reach beyond it; scale, target pixels per picture pixel; notes,
    sentences for the log.
    """

    image: Tensor
    inverted: bool
    source_size: tuple[int, int]
    crop_box: tuple[float, float, float, float]
    scale: float
    notes: tuple[str, ...]


def read_target(
    source: str | Path | np.ndarray | Tensor,
    resolution: int,
    *,
    invert: bool | Literal["auto"] = "auto",
    threshold: float | None = None,
    padding: float = PADDING,
    frame: Literal["fit", "keep"] = "fit",
) -> Target:
    """Read a picture as a target (resolution, resolution), white on black.

    source: a file that Pillow reads (16-bit colour at 8 bits a channel, of several frames the first), or an array or
    tensor (H,W) grey, (H,W,3) RGB or (H,W,4) RGBA of bool, uint8, uint16 or floats in [0,1]; at least 16 px a side.
    Colour becomes luminance (BT.709). Transparent parts are laid on black or white, whichever the visible part stands
    out from; where the visible part has one colour, the alpha channel itself is the picture.
    invert: True for a black shape on white, False for white on black, "auto" to judge by the border: its median is
    the background, and the shape is what deviates from it, brighter or darker, by summed squares.
    threshold: in (0,1), makes every pixel of the picture, once white on black, 0 or 1 before it is resized.
    padding: in [0,1), the part of the canvas that the shape's longer side leaves free.
    frame: "fit" centres the shape's bounding box on the canvas. The box holds what exceeds the background by a tenth
    of the contrast and by six standard deviations of the border's noise, so that JPEG artefacts do not count; its edge
    pixels count by their level, so that smooth edges are found between pixels. "keep" takes a square picture as framed.
    Resizing is exact area averaging, or linear interpolation where the picture is enlarged.
    Raises `InputError` on whatever cannot be used, before any work on the pixels.
    """
    resolution = check_resolution(resolution)
    _check_options(invert, threshold, padding, frame)
    name = f"the picture {Path(source).absolute()}" if isinstance(source, str | Path) else "the image"
    notes: list[str] = []
    pixels = _check_pixels(_read_file(Path(source), notes) if isinstance(source, str | Path) else source, name)
    height, width = pixels.shape[:2]
    if min(height, width) < MIN_SIDE:
        raise InputError(f"{name} must be at least {MIN_SIDE} px on each side, got {width}×{height}; take a larger one")
    if frame == "keep" and height != width:
        raise InputError(f'frame="keep" needs a square picture, {name} is {width}×{height}; use frame="fit" or crop it')
    grey = _grey(pixels, invert, name, notes)
    _check_contrast(grey, name)
    grey, level, inverted = _white_on_black(grey, invert, notes)
    if threshold is not None:
        grey, level = _binary(grey, threshold, name), 0.0
        notes.append(f"binary at the threshold {threshold:g}")
    x, y, side = (0.0, 0.0, float(width)) if frame == "keep" else _window(grey, level, padding, notes)
    if side < resolution:
        notes.append(f"enlarged {resolution / side:.3g} times by linear interpolation: the picture has no finer detail")
    if level > MIN_CONTRAST:
        notes.append(f"the background is not black but {level:.2f}; a threshold would clear it")
    image = torch.from_numpy(_resample(grey, x, y, side, resolution, level))
    return Target(image, inverted, (width, height), (x, y, x + side, y + side), resolution / side, tuple(notes))


def write_image(path: str | Path, image: np.ndarray | Tensor, *, bits: Literal[8, 16] = 8) -> Path:
    """Write an image (H,W) or (H,W,3), of bool, uint8, uint16 or floats in [0,1], as a PNG; return the absolute path.

    16 bits are for grey images. The file appears whole or not at all. Raises `InputError` on another suffix, shape or
    range, on 16-bit colour, and where the file cannot be written.
    """
    path = Path(path).absolute()
    if path.suffix.lower() != ".png":
        raise InputError(f"images are written as PNG, got {path.name!r}; end the name in .png")
    pixels = _check_pixels(image, "the image")
    if bits not in (8, 16) or (bits == 16 and pixels.ndim == 3) or pixels.shape[2:] == (4,):
        raise InputError(f"a PNG is written with 8 bits, grey or RGB, or with 16 bits, grey; got bits={bits!r} and "
                         f"shape {pixels.shape}")
    white = 2**bits - 1
    levels = np.rint(_unit(pixels, np.float64) * white).astype(f"uint{bits}")
    partial = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        Image.fromarray(levels).save(partial, format="PNG")
        os.replace(partial, path)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise InputError(f"cannot write {path}: {error.strerror or error}; choose a folder that exists and may be "
                         "written") from error
    return path


def check_resolution(resolution: Any) -> int:
    """The side of a target in pixels as an int. Raises `InputError` unless it is whole and at least 16."""
    whole = int(resolution) if isinstance(resolution, Integral) and not isinstance(resolution, bool) else 0
    if whole < MIN_SIDE:
        raise InputError(f"resolution must be a whole number of at least {MIN_SIDE} pixels, got {resolution!r}")
    return whole


def _check_options(invert: Any, threshold: Any, padding: Any, frame: Any) -> None:
    if not (isinstance(invert, bool | np.bool_) or (isinstance(invert, str) and invert == "auto")):
        raise InputError(f'invert must be "auto", true or false, got {invert!r}')
    if threshold is not None and not (isinstance(threshold, Real) and 0 < threshold < 1):
        raise InputError(f"threshold must lie between 0 and 1, or be none for a grey target; got {threshold!r}")
    if not (isinstance(padding, Real) and 0 <= padding < 1):
        raise InputError(f"padding must be at least 0 and below 1 (0.25 leaves the shape 75%), got {padding!r}")
    if frame not in ("fit", "keep"):
        raise InputError(f'frame must be "fit" or "keep", got {frame!r}')


def _check_pixels(image: Any, name: str) -> np.ndarray:
    """The array behind an image, of usable shape, type and range, as it came."""
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
            raise InputError(f"{name} must be finite, but {bad} of its values are NaN or infinite; mend them")
        low, high = float(image.min()), float(image.max())
        if low < -ROUNDING or high > 1 + ROUNDING:
            raise InputError(f"{name} must lie in [0, 1] where it is of floats, got {low:.4g} to {high:.4g}; divide it "
                             "by its white level, or pass uint8")
    return image


def _unit(pixels: np.ndarray, dtype: type = np.float32) -> np.ndarray:
    """Levels as floats in [0,1]."""
    return (pixels.astype(dtype) / WHITE_LEVELS[pixels.dtype.name]).clip(0, 1)


def _read_file(path: Path, notes: list[str]) -> np.ndarray:
    path = path.absolute()
    if not path.exists():
        raise InputError(f"there is no file {path}; check the path")
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the path of one image file")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(path) as picture:
                picture.load()
                return _array(picture, path, notes)
    except InputError:
        raise
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise InputError(f"{path} is larger than Pillow's guard against decompression bombs allows "
                         f"({Image.MAX_IMAGE_PIXELS} pixels); shrink the picture first") from error
    except UnidentifiedImageError as error:
        raise InputError(f"{path} is no image that Pillow can read; convert it to PNG or JPEG") from error
    except Exception as error:  # on a damaged file Pillow's readers raise almost anything
        reason = getattr(error, "strerror", None) or f"the file is damaged or cut short ({error})"
        raise InputError(f"cannot read the picture {path}: {reason}") from error


def _array(picture: Image.Image, path: Path, notes: list[str]) -> np.ndarray:
    """A loaded picture as an upright array (H,W), (H,W,3) or (H,W,4) of uint8, uint16 or float32."""
    frames = getattr(picture, "n_frames", 1)
    if frames > 1:
        notes.append(f"the file holds {frames} pictures: the first was taken")
    if picture.getexif().get(EXIF_ORIENTATION, 1) != 1:
        picture = ImageOps.exif_transpose(picture)
        notes.append("turned upright by its EXIF orientation")
    if picture.mode == "F":
        return np.asarray(picture)
    if picture.mode.startswith("I"):  # 16 bits, which Pillow keeps as such or in 32 bits
        levels = np.asarray(picture)
        if levels.min() < 0 or levels.max() > WHITE_LEVELS["uint16"]:
            raise InputError(f"{path} holds integers from {levels.min()} to {levels.max()}; save it with 8 or 16 bits")
        return levels.astype(np.uint16)
    if picture.has_transparency_data:
        return np.asarray(picture.convert("RGBA"))
    return np.asarray(picture if picture.mode == "L" else picture.convert("L" if picture.mode == "1" else "RGB"))


def _grey(pixels: np.ndarray, invert: bool | str, name: str, notes: list[str]) -> np.ndarray:
    """Luminance (H,W), transparent parts laid on a backdrop."""
    if pixels.ndim == 2:
        return _unit(pixels)
    grey = sum(weight * _unit(pixels[..., channel]) for channel, weight in enumerate(LUMINANCE)).clip(0, 1)
    alpha = _unit(pixels[..., 3]) if pixels.shape[2] == 4 else np.ones((), np.float32)
    if alpha.min() == 1:
        return grey
    if alpha.max() == 0:
        raise InputError(f"{name} is fully transparent; there is nothing to see")
    visible = grey[alpha >= alpha.max() / 2]
    if np.ptp(visible) < 2 * MIN_CONTRAST:
        notes.append("the shape is in the alpha channel alone: opaque is white")
        return alpha
    backdrop = float(visible.mean() < 0.5) if invert == "auto" else float(invert)
    notes.append(f"transparent parts laid on {'white' if backdrop else 'black'}")
    return alpha * grey + (1 - alpha) * np.float32(backdrop)


def _check_contrast(grey: np.ndarray, name: str) -> None:
    low, high = float(grey.min()), float(grey.max())
    if high - low < MIN_CONTRAST:
        kind = "empty (all black)" if high < MIN_CONTRAST else "all white" if low > 1 - MIN_CONTRAST else "evenly grey"
        raise InputError(f"{name} is {kind}: its levels run from {low:.3f} to {high:.3f}; a target needs a shape that "
                         "stands out from its background")


def _border(grey: np.ndarray) -> np.ndarray:
    return np.concatenate([grey[0], grey[-1], grey[1:-1, 0], grey[1:-1, -1]])


def _white_on_black(grey: np.ndarray, invert: bool | str, notes: list[str]) -> tuple[np.ndarray, float, bool]:
    """The picture with its shape white, its background's level, and whether it was inverted for that."""
    border = _border(grey)
    level = float(np.median(border))
    energy = np.square(grey - level, dtype=np.float64)
    brighter = float(energy[grey > level].sum() / energy.sum())
    inverted = brighter < 0.5 if invert == "auto" else bool(invert)
    steady = float((np.abs(border - level) < np.ptp(grey) / 4).mean())
    said = "black shape on white: inverted" if inverted else "white shape on black"
    if invert != "auto":
        said += ", as asked"
    elif max(brighter, 1 - brighter) < 0.75 or steady < 0.75:
        said += f", but the border leaves doubt; invert={str(not inverted).lower()} takes it the other way"
    notes.append(said)
    if inverted:
        grey, level, brighter = 1 - grey, 1 - level, 1 - brighter
    if brighter < 0.5:  # against the judgement: the shape itself reaches round the border
        level = float(grey.min())
    return grey, level, inverted


def _binary(grey: np.ndarray, threshold: float, name: str) -> np.ndarray:
    lit = grey >= threshold
    if not lit.any():
        raise InputError(f"the threshold {threshold:g} leaves nothing of {name}: its highest level, white on black, is "
                         f"{float(grey.max()):.3f}; lower it")
    if lit.all():
        raise InputError(f"the threshold {threshold:g} lights every pixel of {name}: its lowest level, white on black, "
                         f"is {float(grey.min()):.3f}; raise it")
    return lit.astype(np.float32)


def _window(grey: np.ndarray, level: float, padding: float, notes: list[str]) -> tuple[float, float, float]:
    """The square (x, y, side) of the picture that fills the canvas: the shape's box, centred, with its padding."""
    contrast = float(grey.max()) - level
    away = np.abs(_border(grey) - level) / contrast
    noise = float(np.sqrt(np.square(away[away < 0.25]).mean())) if (away < 0.25).any() else 0.0
    lowest = min(max(SHAPE_LEVEL, 6 * noise), 0.5)

    def extent(profile: np.ndarray) -> tuple[float, float]:
        share = ((profile - level) / contrast).clip(0)
        first, last = np.flatnonzero(share > lowest)[[0, -1]]
        return float(first + 1 - share[max(first - 1, 0):first + 1].sum()), float(last + share[last:last + 2].sum())

    (x0, x1), (y0, y1) = extent(grey.max(0)), extent(grey.max(1))
    side = max(x1 - x0, y1 - y0) / (1 - padding)
    notes.append(f"the shape spans {x1 - x0:.1f}×{y1 - y0:.1f} px of {grey.shape[1]}×{grey.shape[0]}, centred at "
                 f"({(x0 + x1) / 2:.1f}, {(y0 + y1) / 2:.1f})")
    return (x0 + x1 - side) / 2, (y0 + y1 - side) / 2, side


def _resample(grey: np.ndarray, x: float, y: float, side: float, resolution: int, fill: float) -> np.ndarray:
    """The square at (x, y) of a picture (H,W) as (R,R); beyond the picture it is `fill`."""
    from scipy.sparse import csr_array

    rows = csr_array(_weights(y, side, resolution, grey.shape[0]))
    columns = csr_array(_weights(x, side, resolution, grey.shape[1]))
    inside = (columns @ (rows @ grey).T).T
    beyond = 1 - np.outer(rows.sum(1), columns.sum(1))
    return np.ascontiguousarray(inside + np.float32(fill) * beyond, np.float32).clip(0, 1)


def _weights(start: float, side: float, resolution: int, count: int) -> np.ndarray:
    """How much each of `count` source pixels gives to each target pixel, (R, count) float32.

    Shrinking, by the length that the two share, which is exact area averaging; enlarging, by linear interpolation
    between the centres of source pixels. At equal size both are the same.
    """
    step = side / resolution
    edges = start + step * np.arange(resolution + 1)[:, None]
    pixels = np.arange(count)
    if step >= 1:
        shared = np.minimum(edges[1:], pixels + 1) - np.maximum(edges[:-1], pixels)
        return (shared.clip(0) / step).astype(np.float32)
    centers = (edges[1:] + edges[:-1]) / 2
    return (1 - np.abs(centers - (pixels + 0.5))).clip(0).astype(np.float32)
