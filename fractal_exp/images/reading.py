"""Pictures in and out: reading a target, checked, white on black, centred and padded; writing a PNG."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial, reduce
from numbers import Integral, Real
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from ..errors import InputError
from ..runtime.files import replacing
from .bands import Bands, Profile, open_picture
from .placement import Placement

if TYPE_CHECKING:
    from scipy.sparse import csr_array

PADDING = 0.25                           # of the canvas, in all; the shape's longer side spans the rest
MIN_SIDE = 16                            # pixels, of a picture and of a target
MIN_CONTRAST = 0.02                      # between the darkest and the lightest pixel
SHAPE_LEVEL = 0.1                        # of the contrast: what lies above it belongs to the shape
LUMINANCE = (0.2126, 0.7152, 0.0722)     # of red, green and blue: ITU-R BT.709
ROUNDING = 1e-5                          # floats may leave [0,1] by this much
WHITE_LEVELS = {"bool": 1, "uint8": 255, "uint16": 65535, "float16": 1, "float32": 1, "float64": 1}


@dataclass(frozen=True, eq=False)
class ReadImage:
    """A picture brought onto the canvas, and what was done to it.

    image (R,R) float32 in [0,1], white shape on black; inverted, whether the picture was black on white; source_size
    (width, height) in pixels, upright; crop_box (x0, y0, x1, y1), the square of the picture that fills the canvas, in
    its pixels from the upper left corner, which may reach beyond it; scale, target pixels per picture pixel; notes,
    sentences for the log; warnings, those of the notes that say what may spoil a result.
    """

    image: Tensor
    inverted: bool
    source_size: tuple[int, int]
    crop_box: tuple[float, float, float, float]
    scale: float
    notes: tuple[str, ...]
    warnings: tuple[str, ...] = ()

    @property
    def placement(self) -> Placement:
        """What takes pixels of the picture to the canvas and back."""
        return Placement(self.source_size, self.crop_box)


class _Notes(list[str]):
    """Sentences for the log, some of them warnings."""

    def __init__(self) -> None:
        super().__init__()
        self.warnings: list[str] = []

    def warn(self, sentence: str) -> None:
        self.append(sentence)
        self.warnings.append(sentence)


def read_target(
    source: str | Path | np.ndarray | Tensor,
    resolution: int,
    *,
    invert: bool | Literal["auto"] = "auto",
    threshold: float | None = None,
    padding: float = PADDING,
    frame: Literal["fit", "keep"] = "fit",
) -> ReadImage:
    """Read a picture as a target (resolution, resolution), white on black.

    source: a PNG, JPEG, GIF, BMP, TIFF, WebP or PPM file of up to 20 000² pixels (16-bit colour at 8 bits a channel,
    of several frames the first), or an array or tensor (H,W) grey, (H,W,3) RGB or (H,W,4) RGBA of bool, uint8, uint16
    or floats in [0,1]; at least 16 px a side.
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
    Beside the file's pixels as Pillow holds them, 1 to 4 bytes each, the memory is that of some rows and the result.
    Raises `InputError` on whatever cannot be used, before any work on the pixels.
    """
    resolution = check_resolution(resolution)
    _check_options(invert, threshold, padding, frame)
    name = f"the picture {Path(source).absolute()}" if isinstance(source, str | Path) else "the image"
    notes = _Notes()
    pixels = _open(source, notes, name)
    height, width = pixels.height, pixels.width
    if min(height, width) < MIN_SIDE:
        raise InputError(f"{name} must be at least {MIN_SIDE} px on each side, got {width}×{height}; take a larger one")
    if frame == "keep" and height != width:
        raise InputError(f'frame="keep" needs a square picture, {name} is {width}×{height}; use frame="fit" or crop it')
    grey = _grey(pixels, invert, name, notes)
    profile = Profile.of(grey)
    _check_contrast(profile, name)
    level, inverted, shape_reaches_border = _background(grey, profile, invert, notes)
    if inverted:
        grey, profile, level = grey.map(lambda band: 1 - band), profile.inverted(), 1 - level
    if shape_reaches_border:  # against the judgement
        level = float(profile.low)
    if threshold is not None:
        _check_threshold(profile, threshold, name)
        binary = partial(_binary, threshold=threshold)
        grey, profile, level = grey.map(binary), profile.map(binary), 0.0
        notes.append(f"binary at the threshold {threshold:g}")
    x, y, side = (0.0, 0.0, float(width)) if frame == "keep" else _window(profile, level, padding, notes)
    if side < resolution:
        notes.warn(f"enlarged {resolution / side:.3g} times by linear interpolation: the picture has no finer detail")
    if level > MIN_CONTRAST:
        notes.warn(f"the background is not black but {level:.2f}; a threshold would clear it")
    image = torch.from_numpy(_resample(grey, x, y, side, resolution, level))
    return ReadImage(image, inverted, (width, height), (x, y, x + side, y + side), resolution / side, tuple(notes),
                  tuple(notes.warnings))


def read_colour(source: str | Path | np.ndarray | Tensor, backdrop: float = 0.0) -> np.ndarray:
    """The upright picture in its colours at its own size, (H,W,3) uint8.

    source: as for `read_target`; backdrop: the grey level in [0,1] that transparent parts are laid on. Raises
    `InputError` where the picture cannot be read.
    """
    pixels = _open(source, _Notes(), "the image")

    def coloured(band: np.ndarray) -> np.ndarray:
        levels = np.atleast_3d(_unit(band))
        if pixels.channels == 4:
            levels = levels[..., :3] * levels[..., 3:] + np.float32(backdrop) * (1 - levels[..., 3:])
        return np.rint(255 * np.broadcast_to(levels, (*levels.shape[:2], 3))).astype(np.uint8)

    return np.concatenate([coloured(band) for band in pixels])


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
    with replacing(path) as unfinished:
        Image.fromarray(levels).save(unfinished, format="PNG")
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
    if threshold is not None and not (isinstance(threshold, Real) and 0 < float(threshold) < 1):
        raise InputError(f"threshold must lie between 0 and 1, or be none for a grey target; got {threshold!r}")
    if not (isinstance(padding, Real) and 0 <= float(padding) < 1):
        raise InputError(f"padding must be at least 0 and below 1 (0.25 leaves the shape 75%), got {padding!r}")
    if frame not in ("fit", "keep"):
        raise InputError(f'frame must be "fit" or "keep", got {frame!r}')


def _open(source: str | Path | np.ndarray | Tensor, notes: _Notes, name: str) -> Bands:
    if isinstance(source, str | Path):
        return open_picture(Path(source), notes, _check_pixels)
    return Bands.of_array(_check_pixels(source, name))


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


def _grey(pixels: Bands, invert: bool | str, name: str, notes: list[str]) -> Bands:
    """Luminance (H,W), transparent parts laid on a backdrop."""
    if pixels.channels == 1:
        return pixels.map(_unit)
    lowest, highest = (1.0, 1.0) if pixels.channels == 3 else _extremes(pixels.map(_alpha))
    if lowest == 1:
        return pixels.map(_luminance)
    if highest == 0:
        raise InputError(f"{name} is fully transparent; there is nothing to see")
    darkest, lightest, mean = _visible(pixels, highest / 2)
    if lightest - darkest < 2 * MIN_CONTRAST:
        notes.append("the shape is in the alpha channel alone: opaque is white")
        return pixels.map(_alpha)
    backdrop = float(mean < 0.5) if invert == "auto" else float(invert)
    notes.append(f"transparent parts laid on {'white' if backdrop else 'black'}")

    def laid(band: np.ndarray) -> np.ndarray:
        alpha = _alpha(band)
        return alpha * _luminance(band) + (1 - alpha) * np.float32(backdrop)

    return pixels.map(laid)


def _luminance(band: np.ndarray) -> np.ndarray:
    parts = (weight * _unit(band[..., channel]) for channel, weight in enumerate(LUMINANCE))
    return reduce(add, parts).clip(0, 1)


def _alpha(band: np.ndarray) -> np.ndarray:
    return _unit(band[..., 3])


def _extremes(grey: Bands) -> tuple[float, float]:
    lows, highs = zip(*((float(band.min()), float(band.max())) for band in grey), strict=True)
    return min(lows), max(highs)


def _visible(pixels: Bands, least: float) -> tuple[float, float, float]:
    """The lowest, highest and mean luminance where the opacity is at least `least`, which it is somewhere."""
    low, high, total, count = 1.0, 0.0, 0.0, 0
    for band in pixels:
        seen = _luminance(band)[_alpha(band) >= least]
        if seen.size:
            low, high = min(low, float(seen.min())), max(high, float(seen.max()))
            total, count = total + float(seen.sum(dtype=np.float64)), count + seen.size
    return low, high, total / count


def _check_contrast(profile: Profile, name: str) -> None:
    low, high = float(profile.low), float(profile.high)
    if high - low < MIN_CONTRAST:
        kind = "empty (all black)" if high < MIN_CONTRAST else "all white" if low > 1 - MIN_CONTRAST else "evenly grey"
        raise InputError(f"{name} is {kind}: its levels run from {low:.3f} to {high:.3f}; a target needs a shape that "
                         "stands out from its background")


def _background(grey: Bands, profile: Profile, invert: bool | str, notes: _Notes) -> tuple[float, bool, bool]:
    """The background's level, whether the picture is to be inverted, so that its shape is white, and whether even then
    most of what deviates from the background is darker."""
    level = float(np.median(profile.border))
    above = total = 0.0
    for band in grey:
        energy = np.square(band - level, dtype=np.float64)
        total += float(energy.sum())
        above += float(energy[band > level].sum())
    brighter = above / total
    inverted = brighter < 0.5 if invert == "auto" else bool(invert)
    steady = float((np.abs(profile.border - level) < (profile.high - profile.low) / 4).mean())
    said = "black shape on white: inverted" if inverted else "white shape on black"
    if invert == "auto" and (max(brighter, 1 - brighter) < 0.75 or steady < 0.75):
        notes.warn(f"{said}, but the border leaves doubt; invert={str(not inverted).lower()} takes it the other way")
    else:
        notes.append(said if invert == "auto" else f"{said}, as asked")
    return level, inverted, (1 - brighter if inverted else brighter) < 0.5


def _check_threshold(profile: Profile, threshold: float, name: str) -> None:
    if not profile.high >= threshold:
        raise InputError(f"the threshold {threshold:g} leaves nothing of {name}: its highest level, white on black, is "
                         f"{float(profile.high):.3f}; lower it")
    if profile.low >= threshold:
        raise InputError(f"the threshold {threshold:g} lights every pixel of {name}: its lowest level, white on black, "
                         f"is {float(profile.low):.3f}; raise it")


def _binary(levels: np.ndarray, threshold: float) -> np.ndarray:
    return (levels >= threshold).astype(np.float32)


def _window(profile: Profile, level: float, padding: float, notes: list[str]) -> tuple[float, float, float]:
    """The square (x, y, side) of the picture that fills the canvas: the shape's box, centred, with its padding."""
    contrast = float(profile.high) - level
    away = np.abs(profile.border - level) / contrast
    noise = float(np.sqrt(np.square(away[away < 0.25]).mean())) if (away < 0.25).any() else 0.0
    lowest = min(max(SHAPE_LEVEL, 6 * noise), 0.5)

    def extent(highest: np.ndarray) -> tuple[float, float]:
        share = ((highest - level) / contrast).clip(0)
        first, last = np.flatnonzero(share > lowest)[[0, -1]]
        return float(first + 1 - share[max(first - 1, 0):first + 1].sum()), float(last + share[last:last + 2].sum())

    (x0, x1), (y0, y1) = extent(profile.columns[1]), extent(profile.rows[1])
    side = max(x1 - x0, y1 - y0) / (1 - padding)
    notes.append(f"the shape spans {x1 - x0:.1f}×{y1 - y0:.1f} px of {len(profile.columns[1])}×{len(profile.rows[1])}, "
                 f"centred at ({(x0 + x1) / 2:.1f}, {(y0 + y1) / 2:.1f})")
    return (x0 + x1 - side) / 2, (y0 + y1 - side) / 2, side


def _resample(grey: Bands, x: float, y: float, side: float, resolution: int, fill: float) -> np.ndarray:
    """The square at (x, y) of a picture (H,W) as (R,R); beyond the picture it is `fill`."""
    rows = _weights(y, side, resolution, grey.height).tocsc()
    columns = _weights(x, side, resolution, grey.width)
    inside, first = np.zeros((resolution, resolution), np.float32), 0
    for band in grey:
        narrow = (columns @ band.T).T
        inside += rows[:, first:first + len(band)] @ narrow
        first += len(band)
    beyond = 1 - np.outer(rows.sum(1), columns.sum(1))
    return np.ascontiguousarray(inside + np.float32(fill) * beyond, np.float32).clip(0, 1)


def _weights(start: float, side: float, resolution: int, count: int) -> csr_array:
    """How much each of `count` source pixels gives to each target pixel, (R, count) float32, sparse.

    Shrinking, by the length that the two share, which is exact area averaging; enlarging, by linear interpolation
    between the centres of source pixels. At equal size both are the same.
    """
    from scipy.sparse import csr_array

    step = side / resolution
    edges = start + step * np.arange(resolution + 1)
    if step >= 1:  # a source pixel reaches into two target pixels at most
        pixels = np.tile(np.arange(count), 2)
        targets = np.floor((pixels - start) / step).astype(np.int64) + np.repeat([0, 1], count)
        known = (targets >= 0) & (targets < resolution)
        pixels, targets = pixels[known], targets[known]
        shared = np.minimum(edges[targets + 1], pixels + 1) - np.maximum(edges[targets], pixels)
        weights = shared.clip(0) / step
    else:  # a target pixel lies between two source pixels
        targets = np.tile(np.arange(resolution), 2)
        centers = ((edges[1:] + edges[:-1]) / 2)[targets]
        pixels = np.floor(centers - 0.5).astype(np.int64) + np.repeat([0, 1], resolution)
        weights = (1 - np.abs(centers - (pixels + 0.5))).clip(0)
        known = (pixels >= 0) & (pixels < count)
        weights, targets, pixels = weights[known], targets[known], pixels[known]
    return csr_array((weights.astype(np.float32), (targets, pixels)), shape=(resolution, count))
