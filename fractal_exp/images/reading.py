"""Read a picture as a target: checked, white on black, centred and padded."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from torch import Tensor

from ..errors import InputError
from . import tone
from .bands import LARGEST_PIXELS, Bands, Crop, Overview, Profile
from .checks import MIN_SIDE, Frame, Notes, check_crop, check_options, check_resolution
from .colours import MIN_CONTRAST, Pen, background_colour, luminance, luminance_of
from .known import Known
from .levels import Levels, TargetImage, decided
from .paper import evened, sheet
from .parts import beside_the_shape
from .pixels import open_pixels
from .placement import Placement
from .plots import without_axes
from .sampling import CUT, CUT_IF_SAID, CUT_IN_CROP, is_target, resample, window

__all__ = ["PADDING", "ReadImage", "check_resolution", "read_grey", "read_lit", "read_target"]

PADDING = 0.25                           # total share of the canvas; the shape's longer side spans the rest
SEEN = 1 / 512                           # level up to which nothing counts as lit if there is no noise
SEEN_IN_NOISE, SEEN_IF_LOSSY = 0.1, 0.25  # the same level with noise, and in a file that stores pixels with errors


@dataclass(frozen=True, eq=False)
class ReadImage(TargetImage):
    """A picture placed on the canvas, and what was done to it.

    image, levels: see `TargetImage`; inverted: whether the picture was black on white; source_size:
    (width, height) in pixels, upright; crop_box: (x0, y0, x1, y1), the square of the picture that fills the canvas, in
    pixels from its upper left corner (it may reach beyond the picture); scale: target pixels per picture pixel; notes:
    sentences for the log; warnings: the notes about what may spoil a result; doubtful: whether what was taken for the
    background may be the shape; unclear: why the picture shows no clear shape, in words, empty if it shows one; source:
    the given picture; crop: (left, top, right, bottom), the part of it that was read, in pixels, or None for all of it;
    asked: the arguments of `read_target` that said how to read it, for the record.
    """

    inverted: bool
    source_size: tuple[int, int]
    crop_box: tuple[float, float, float, float]
    scale: float
    notes: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    doubtful: bool = False
    unclear: str = ""
    source: Path | np.ndarray | Tensor | None = None
    crop: Crop | None = None
    asked: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of_drawing(cls, image: Tensor, levels: str, notes: tuple[str, ...] = ()) -> ReadImage:
        """An image (R,R) that was drawn as a target, in its own frame."""
        side = image.shape[-1]
        return cls(image, False, (side, side), (0.0, 0.0, float(side), float(side)), 1.0, notes, levels=levels)

    @property
    def placement(self) -> Placement:
        """The mapping between pixels of the picture and the canvas."""
        return Placement(self.source_size, self.crop_box)


def read_target(
    source: str | Path | np.ndarray | Tensor,
    resolution: int,
    *,
    invert: bool | Literal["auto"] = "auto",
    threshold: float | None = None,
    padding: float = PADDING,
    frame: Frame = "fit",
    clean: bool = True,
    crop: Sequence[int] | None = None,
    levels: Levels = "auto",
    most_pixels: int = LARGEST_PIXELS,
) -> ReadImage:
    """Read a picture as a target (resolution, resolution), white on black.

    source: a PNG, JPEG, GIF, BMP, TIFF, WebP or PPM file of up to 20 000² pixels (16-bit colour is read at 8 bits per
    channel, and only the first of several frames), or an array or tensor (H,W) grey, (H,W,3) RGB or (H,W,4) RGBA of
    bool, uint8, uint16 or floats in [0,1]; at least 16 px per side.
    Colour becomes luminance (BT.709), unless `clean` finds a pen. Transparent parts are laid on black or white,
    whichever contrasts with the visible part. If the visible part has one colour, the alpha channel is the picture.
    invert: True for a black shape on white, False for white on black, "auto" to judge by the border: its median is
    the background, and the shape is what deviates from it more, brighter or darker, by summed squares.
    threshold: in (0,1), makes every pixel of the white-on-black picture 0 or 1 before it is resized.
    padding: in [0,1), the share of the canvas that the shape's longer side leaves free.
    frame: "fit" centres the shape's bounding box on the canvas. The box holds all pixels that exceed the background by
    a tenth of the contrast (a quarter in a coloured drawing as JPEG, which rings beside edges) and by six standard
    deviations of the border's noise. Its edge pixels count by their level, so smooth edges are found between pixels. A
    grey `suite.target` of this resolution stays as it is, unless it was rounded to 8 bits. "part" centres the box too,
    and takes the shape to go on beyond every side of the picture, or of the crop, that it reaches. "keep" keeps the
    frame of any square picture.
    clean: except with "keep", look for the one shape and its own levels, and report it in the notes. In a coloured
    picture, levels are distances from the background's colour, with 1 for the pen's colour. In a JPEG file they are
    differences in luma, if one pen drew all and its luma differs enough from the background's, because the file stores
    colours at half the resolution. The background and its noise become 0; a shape of one flat colour becomes 1. Axes,
    frames, text, specks and all but the largest of several solid shapes are left out. A drawing of a code on black
    stays as it is. A lossy WebP and a TIFF with JPEG compression count as JPEG here.
    crop: (left, top, right, bottom), the part of the upright picture that is read, in pixels from the upper left
    corner. The last column and row of the part are right - 1 and bottom - 1. None reads all of it.
    With "fit", a picture or a crop that cuts its shape off is read as a part: `known` is the box that it shows, and a
    note says so. A picture does if a side of it is lit along more than 17% and at most 95% of the shape's span, unless
    the shape reaches all four sides, as in a picture that is trimmed to it; a crop does if any side is lit along more
    than 17%. A strip that is narrower than an eighth of the canvas is read as whole.
    levels: what the grey levels mean, see `TargetImage`; "auto" decides by their look.
    most_pixels: of a file, as many as are decoded: fewer than it has for a large JPEG without `crop`.
    Resizing is exact area averaging, or linear interpolation if the picture is enlarged.
    Pillow holds the file's pixels at 1 to 4 bytes each (for a large JPEG without `crop`, those of a smaller one).
    Beside that, the memory is for some rows, an overview of a million pixels, and the result.
    Raises `InputError`, before any work on the pixels, if anything cannot be used; also on pictures of noise.
    """
    resolution = check_resolution(resolution)
    check_options(invert, threshold, padding, frame, clean)
    part = None if crop is None else check_crop(crop)
    name, notes = _name(source), Notes()
    pixels = open_pixels(source, notes, name, shrink=frame != "keep", crop=part, most=most_pixels)
    width, height, (left, top) = pixels.width, pixels.height, pixels.origin
    if part is not None:
        name = f"the part {part} of {name}"
        notes.append(f"only the part of {part[2] - left}×{part[3] - top} px at ({left}, {top}) is read, as asked")
    _check_sides(width, height, frame, name)
    shape = _levels(pixels, invert, name, notes, clean=clean and frame != "keep")
    if threshold is not None:
        shape = shape.binary(threshold, name)
        notes.append(f"binary at the threshold {threshold:g}")
    scale, (left, top) = pixels.scale, shape.grey.origin
    x, y, side, cut = _square(shape, frame, resolution, padding, notes, name, part is not None)
    _warn(notes, resolution / side / scale, shape.level)
    image = torch.from_numpy(resample(shape.grey, x, y, side, resolution, shape.level))
    known = _known(shape.grey, x, y, side, resolution, cut)
    if known is not None:
        image = image * known.mask(resolution)
    crop_box = (left + scale * x, top + scale * y, left + scale * (x + side), top + scale * (y + side))
    return ReadImage(image, shape.inverted, pixels.full, crop_box, resolution / side / scale,
                     tuple(notes), tuple(notes.warnings), notes.doubtful, notes.unclear,
                     Path(source).absolute() if isinstance(source, str | Path) else source, part,
                     {"invert": invert, "threshold": threshold, "padding": padding, "frame": frame, "clean": clean,
                      "crop": part, "levels": levels},
                     levels=decided(levels, image), known=known)


def read_lit(source: str | Path | np.ndarray | Tensor, *, invert: bool | Literal["auto"] = "auto",
             threshold: float | None = None, most_pixels: int = LARGEST_PIXELS) -> np.ndarray:
    """Where the shape of a picture is, (H,W) bool, in the picture's own pixels: all that is seen on the background, but
    what stands beside the shape; or with a threshold in (0,1) all levels from there on, white on black, wherever they
    are. source, invert, most_pixels, errors: as for `read_target`."""
    shape, _ = _read_whole(source, invert, threshold, most_pixels, clean=threshold is None)
    return np.concatenate([band > shape.seen if threshold is None else band >= threshold for band in shape.grey])


def read_grey(source: str | Path | np.ndarray | Tensor, *, invert: bool | Literal["auto"] = "auto",
              most_pixels: int = LARGEST_PIXELS) -> tuple[Tensor, Tensor, tuple[str, ...]]:
    """The luminance of a picture in its own pixels, (H,W) in [0,1], white on black; which pixels are lit, (H,W) bool;
    and sentences on how it was read. Nothing is cleaned.

    Lit is what is brighter than the background: by a 512th, or by a quarter in a file that stores pixels with errors.
    source, invert, most_pixels, errors: as for `read_target`.
    """
    shape, notes = _read_whole(source, invert, None, most_pixels, clean=False)
    levels, least = torch.from_numpy(np.concatenate(list(shape.grey))), shape.level + shape.seen
    if least > MIN_CONTRAST:
        notes.append(f"lit is what is brighter than {least:.2f}")
    return levels, levels > least, tuple(notes)


def _read_whole(source: str | Path | np.ndarray | Tensor, invert: bool | str, threshold: float | None,
                most_pixels: int, *, clean: bool) -> tuple[_Shape, Notes]:
    """The shape of a picture in the picture's own pixels, and how it was read."""
    check_options(invert, threshold, PADDING, "fit", True)
    name, notes = _name(source), Notes()
    pixels = open_pixels(source, notes, name, most=most_pixels)
    _check_sides(pixels.width, pixels.height, "fit", name)
    return _levels(pixels, invert, name, notes, clean=clean), notes


def _name(source: str | Path | np.ndarray | Tensor) -> str:
    return f"the picture {Path(source).absolute()}" if isinstance(source, str | Path) else "the image"


def _check_sides(width: int, height: int, frame: str, name: str) -> None:
    if min(height, width) < MIN_SIDE:
        raise InputError(f"{name} must be at least {MIN_SIDE} px on each side, got {width}×{height}; take a larger one")
    if frame == "keep" and height != width:
        raise InputError(f'frame="keep" needs a square picture, {name} is {width}×{height}; use frame="fit" or crop it')


def _square(shape: _Shape, frame: str, resolution: int, padding: float, notes: Notes, name: str, is_crop: bool
            ) -> tuple[float, float, float, Collection[str]]:
    """The square (x, y, side) of the picture that fills the canvas, all of it or the shape's; and the sides on which
    the picture cuts the shape off."""
    whole = 0.0, 0.0, float(shape.grey.width), ()
    if frame == "keep":
        return whole
    as_large = shape.grey.width == shape.grey.height == resolution
    if frame == "fit" and as_large and padding == PADDING and is_target(shape.grey, shape.profile, padding):
        notes.append("a target of this package in its frame: it stays as it is")
        return whole
    cut = CUT_IF_SAID if frame == "part" else CUT_IN_CROP if is_crop else CUT
    found = window(shape.grey, shape.profile, shape.level, padding, notes, rings=shape.rings, cut=cut)
    if frame == "part" and not found[-1]:
        raise InputError(f'frame="part" needs a shape that reaches a side and is wider than an eighth of the canvas; '
                         f'{name} shows none: leave frame="part" out')
    return found


def _known(grey: Bands, x: float, y: float, side: float, resolution: int, cut: Collection[str]) -> Known | None:
    """The part of the canvas that a picture shows which cuts its shape off on some sides; None if it does on none. An
    enlarged picture fades out over half a pixel of its own."""
    if not cut:
        return None
    fading = 0.5 if side < resolution else 0.0
    edges = {"left": fading - x, "right": grey.width - fading - x, "bottom": side - (grey.height - fading - y),
             "top": side - (fading - y)}
    return Known(**{name: float(np.clip(2 * edges[name] / side - 1, -1, 1)) if name in cut else end
                    for name, end in (("left", -1.0), ("bottom", -1.0), ("right", 1.0), ("top", 1.0))})


def _warn(notes: Notes, enlarged: float, level: float) -> None:
    """Add what is wrong with an image that was enlarged so many times and whose background has this level."""
    if enlarged > 1:
        notes.warn(f"enlarged {enlarged:.3g} times by linear interpolation: the picture has no finer detail")
    if level > MIN_CONTRAST:
        notes.warn(f"the background is not black but {level:.2f}; a threshold would clear it")


@dataclass(frozen=True, eq=False)
class _Shape:
    """A picture white on black, its profile, the background's level, whether it was black on white, and whether its
    background has a single level without noise."""

    grey: Bands
    profile: Profile
    level: float
    inverted: bool
    exact: bool = True
    rings: bool = False  # a coloured drawing in a lossy file; greys may be faint parts of the shape

    @property
    def seen(self) -> float:
        """The level up to which nothing counts as lit."""
        return SEEN_IF_LOSSY if self.grey.lossy else SEEN if self.exact else SEEN_IN_NOISE

    def map(self, rising: Callable[[np.ndarray], np.ndarray]) -> _Shape:
        """The shape after a monotonic function of its levels."""
        return replace(self, grey=self.grey.map(rising), profile=self.profile.map(rising))

    def binary(self, threshold: float, name: str) -> _Shape:
        """The shape in black and white. Raises `InputError` if the threshold leaves nothing of either."""
        if not self.profile.high >= threshold:
            raise InputError(f"the threshold {threshold:g} leaves nothing of {name}: its highest level, white on black,"
                             f" is {float(self.profile.high):.3f}; lower it")
        if self.profile.low >= threshold:
            raise InputError(f"the threshold {threshold:g} lights every pixel of {name}: its lowest level, white on "
                             f"black, is {float(self.profile.low):.3f}; raise it")
        return replace(self.map(lambda levels: (levels >= threshold).astype(np.float32)), level=0.0)


def _levels(pixels: Bands, invert: bool | str, name: str, notes: Notes, clean: bool) -> _Shape:
    """The levels of the picture, white on black."""
    grey, colours = luminance(pixels, invert, name, notes)
    if not clean:
        return _as_it_is(grey, invert, name, notes)
    given = grey if colours is None else colours
    whole = evened(given if invert is False else sheet(given, notes), notes)
    picture = without_axes(whole, name, notes)
    if picture is not given:
        grey, colours = (picture, None) if colours is None else (picture.map(luminance_of), picture)
    tones, beside = Notes(), Notes()
    shape, overview = _toned(grey, colours, invert, name, tones, beside)
    graded = tone.Flat.of(overview) is None
    seen = shape.seen
    dropped = beside_the_shape(overview, seen, beside, graded=graded)
    if dropped is not None and colours is not None:  # what is left out influenced the shape's colour
        empty = background_colour(colours, overview.highest <= seen, overview.block)
        colours, tones = colours.without(dropped, overview.block, empty), Notes()
        shape, _ = _toned(colours.map(luminance_of), colours, invert, name, tones, None)
    elif dropped is not None:
        grey = shape.grey.without(dropped, overview.block)
        shape = replace(shape, grey=grey, profile=Profile.of(grey))
    notes.take(tones)
    notes.take(beside)
    return shape


def _as_it_is(grey: Bands, invert: bool | str, name: str, notes: Notes, overview: Overview | None = None) -> _Shape:
    """The luminance, white on black."""
    profile = Profile.of(grey)
    tone.check_contrast(profile, name)
    level, inverted, shape_reaches_border = tone.background(grey, profile, invert, notes, overview)
    if inverted:
        grey, profile, level = grey.map(lambda band: 1 - band), profile.inverted(), 1 - level
    if shape_reaches_border:  # evidence against the judgement
        level = float(profile.low)
    return _Shape(grey, profile, level, inverted)


def _toned(grey: Bands, colours: Bands | None, invert: bool | str, name: str, notes: Notes,
           doubts: Notes | None) -> tuple[_Shape, Overview]:
    """The shape's own levels on black, with a flat colour as white; and its overview. Raises `InputError` on noise. If
    `doubts` is given, it gets a note on a picture without a clear shape."""
    pen = Pen.of(colours, invert) if colours is not None else None
    if pen is not None and colours is not None:
        grey = colours.map(pen.levels)
        profile = Profile.of(grey)
        notes.append(pen.describe())
        steady = float((profile.border < (profile.high - profile.low) / 4).mean())
        tone.say_polarity(pen.darker, invert, steady < 0.75, notes)
        shape = _Shape(grey, profile, float(np.median(profile.border)), pen.darker,
                       rings=colours.lossy and colours.scale == 1)
    else:
        shape = _as_it_is(grey, invert, name, notes, Overview.of(grey))
    overview = Overview.of(shape.grey)
    if doubts is not None:
        tone.check_noise(overview, name)
        tone.check_clear(overview, shape.profile, shape.level, doubts)
    change, noise = tone.above_background(shape.profile, shape.level, notes)
    if change is not None:
        shape = replace(shape.map(change), level=0.0, exact=False)
        overview = Overview.of(shape.grey)
        specks = tone.grain(overview, shape.profile, noise)
        if specks is not None:
            grey = shape.grey.without(specks, overview.block)
            shape, overview = replace(shape, grey=grey, profile=Profile.of(grey)), Overview.of(grey)
    factor = np.float32(tone.levelled(overview, notes, coloured=pen is not None))
    if factor != 1:
        def raised(levels: np.ndarray) -> np.ndarray:
            return (levels * factor).clip(0, 1)
        shape, overview = shape.map(raised), overview.map(raised)
    ringing = np.float32(tone.ringing(overview) if shape.grey.lossy else 0)
    if ringing > 0:
        def quiet(levels: np.ndarray) -> np.ndarray:
            return np.where(levels <= ringing, np.float32(0), levels)
        shape, overview = replace(shape.map(quiet), exact=False), overview.map(quiet)
        notes.append(f"levels up to {ringing:.2g} are errors of the file's compression beside the shape: black")
    return shape, overview
