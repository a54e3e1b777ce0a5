"""Pictures as bands of whole rows, so that computing with them takes little extra memory; opening files."""

from __future__ import annotations

import contextlib
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from PIL import Image, ImageOps, UnidentifiedImageError

from ..errors import InputError
from ..runtime.files import check_file
from . import whole
from .checks import check_within
from .refusals import known_as

# Formats that Pillow decodes itself; others (EPS, WMF …) call programs of the system.
FORMATS = ("PNG", "JPEG", "GIF", "BMP", "TIFF", "WEBP", "PPM")
LOSSY = ("JPEG", "MPO")  # a phone's .jpg with a second picture, such as a depth map, is opened as MPO
LOSSY_COMPRESSIONS = ("jpeg", "tiff_jpeg")  # Pillow's names of those of a TIFF
LARGEST_PIXELS = 20_000**2  # of a file; Pillow holds all of it at 1 to 4 bytes per pixel, and some decoders twice
# Minimum pixels of the longer and of the shorter side of a picture that is shrunk while it is read.
LARGE_SIDE, LARGE_SHORTER_SIDE = 4096, 1024
SHRUNK_MODES = ("L", "LA", "RGB", "RGBA", "CMYK")
BAND_PIXELS = 2**20
MOST_LEVELS = 65535
EXIF_ORIENTATION = 0x0112
Crop = tuple[int, int, int, int]  # left, top, right, bottom in pixels of the upright picture


@dataclass(frozen=True)
class Bands:
    """A picture of `height` × `width` pixels with 1, 3 or 4 `channels`. `rows(first, last)` returns some of its rows.

    full: (width, height) of the whole picture in pixels of the file. scale: pixels of the file per side of a pixel,
    above 1 if it was shrunk while it was read; origin: (x, y) of the upper left corner in pixels of the file, not
    (0, 0) if it was cropped. lossy: whether the file stores pixels with errors, as a JPEG does.
    """

    height: int
    width: int
    channels: int
    rows: Callable[[int, int], np.ndarray]
    full: tuple[int, int]
    scale: int = 1
    origin: tuple[int, int] = (0, 0)
    lossy: bool = False

    @classmethod
    def of_array(cls, pixels: np.ndarray, crop: Crop | None = None) -> Bands:
        """The bands of an array (H,W), (H,W,3) or (H,W,4), or of a part of it. Raises `InputError` on another crop."""
        height, width = pixels.shape[:2]
        left, top, right, bottom = crop = crop or (0, 0, width, height)
        check_within(crop, width, height)
        part, channels = pixels[top:bottom, left:right], pixels.shape[2] if pixels.ndim == 3 else 1
        return cls(bottom - top, right - left, channels, lambda first, last: part[first:last],
                   (width, height), origin=(left, top))

    def map(self, function: Callable[[np.ndarray], np.ndarray], channels: int = 1) -> Bands:
        """The same picture, with a function applied to every band when it is read; channels: of the result."""
        return replace(self, channels=channels, rows=lambda first, last: function(self.rows(first, last)))

    def without(self, dropped: np.ndarray, block: int, fill: np.ndarray | float = 0.0) -> Bands:
        """The same picture with the level or colour `fill` in the blocks of `block`² pixels where `dropped` (h,w) is
        true."""
        columns, colour = np.arange(self.width) // block, np.asarray(fill, np.float32)

        def rows(first: int, last: int) -> np.ndarray:
            gone = dropped[np.arange(first, last) // block][:, columns]
            return np.where(gone[..., None] if self.channels > 1 else gone, colour, self.rows(first, last))

        return replace(self, rows=rows)

    def over(self, light: np.ndarray) -> Bands:
        """The same picture, at most 1, divided by one that is given at nodes (h,w,C), evenly spaced from the middle of
        its first pixel to that of its last, and linear between them."""
        down, across = (_between(np.linspace(0, nodes - 1, pixels), nodes) for nodes, pixels in (
            (light.shape[0], self.height), (light.shape[1], self.width)))
        narrow = np.einsum("wn,mnc->mwc", across, light.astype(np.float32))

        def rows(first: int, last: int) -> np.ndarray:
            band = self.rows(first, last)
            return (band / np.tensordot(down[first:last], narrow, 1).reshape(band.shape)).clip(0, 1).astype(np.float32)

        return replace(self, rows=rows)

    def part(self, top: int, bottom: int, left: int, right: int) -> Bands:
        """Some rows and columns of the same picture, the last ones excluded."""
        origin = self.origin[0] + self.scale * left, self.origin[1] + self.scale * top
        return replace(self, height=bottom - top, width=right - left, origin=origin,
                       rows=lambda first, last: self.rows(top + first, top + last)[:, left:right])

    def bridged(self, level: Sequence[tuple[int, int]], upright: Sequence[tuple[int, int]]) -> Bands:
        """The same picture with some ranges of rows and of columns, each [near, far), painted over: by the row or
        column beside the range that is nearer."""
        kept, columns = _beyond(level, self.height), _beyond(upright, self.width)

        def rows(first: int, last: int) -> np.ndarray:
            wanted = kept[first:last]
            return self.rows(wanted.min(), wanted.max() + 1)[wanted - wanted.min()][:, columns]

        return replace(self, rows=rows)

    def __iter__(self) -> Iterator[np.ndarray]:
        """All rows from the top, about a million pixels at a time."""
        some = max(1, BAND_PIXELS // self.width)
        for first in range(0, self.height, some):
            yield self.rows(first, min(first + some, self.height))


def _between(places: np.ndarray, count: int) -> np.ndarray:
    """The weights (P,count) of linear interpolation between 0, 1 … count - 1."""
    return (1 - np.abs(places[:, None] - np.arange(count))).clip(0).astype(np.float32)


def _beyond(ranges: Sequence[tuple[int, int]], count: int) -> np.ndarray:
    """The number in `count` that is nearest to each and in none of the ranges, (count,)."""
    outside = np.setdiff1d(np.arange(count), np.concatenate([np.arange(*each) for each in ranges] or [[]]))
    after = np.searchsorted(outside, np.arange(count)).clip(0, len(outside) - 1)
    before = (after - 1).clip(0)
    nearer = np.arange(count) - outside[before] <= np.abs(outside[after] - np.arange(count))
    return np.where(nearer & (outside[after] != np.arange(count)), outside[before], outside[after])


@dataclass(frozen=True, eq=False)
class Profile:
    """The lowest and highest level of every row (2,H) and every column (2,W) of a grey picture, and the levels of its
    border."""

    rows: np.ndarray
    columns: np.ndarray
    border: np.ndarray

    @classmethod
    def of(cls, grey: Bands) -> Profile:
        """Read the picture once."""
        rows, lowest, highest, left, right, ends = [], [], [], [], [], []
        for band in grey:
            rows.append(np.stack([band.min(1), band.max(1)]))
            lowest, highest = [np.min([*lowest, band.min(0)], 0)], [np.max([*highest, band.max(0)], 0)]
            left.append(band[:, 0].copy())
            right.append(band[:, -1].copy())
            ends = [ends[0] if ends else band[0].copy(), band[-1].copy()]
        sides = [np.concatenate(side)[1:-1] for side in (left, right)]
        return cls(np.concatenate(rows, 1), np.stack(lowest + highest), np.concatenate(ends + sides))

    @property
    def low(self) -> np.float32:
        return self.rows[0].min()

    @property
    def sides(self) -> dict[str, np.ndarray]:
        """The levels along each side of the picture; its corners belong to two."""
        height, width = self.rows.shape[1], self.columns.shape[1]
        top, bottom, left, right = np.split(self.border, np.cumsum([width, width, height - 2]))
        return {"left": np.concatenate([top[:1], left, bottom[:1]]), "right": np.concatenate([top[-1:], right,
                                                                                             bottom[-1:]]),
                "top": top, "bottom": bottom}

    @property
    def high(self) -> np.float32:
        return self.rows[1].max()

    def inverted(self) -> Profile:
        """The profile of 1 - picture."""
        return Profile(1 - self.rows[::-1], 1 - self.columns[::-1], 1 - self.border)

    def map(self, rising: Callable[[np.ndarray], np.ndarray]) -> Profile:
        """The profile of the picture after a monotonic function of its levels."""
        return Profile(rising(self.rows), rising(self.columns), rising(self.border))


@dataclass(frozen=True, eq=False)
class Overview:
    """A grey picture in blocks of `block`² pixels, at most about a thousand per side: the mean and the highest level
    (h,w) of each block. A small picture is its own overview."""

    mean: np.ndarray
    highest: np.ndarray
    block: int

    def map(self, rising: Callable[[np.ndarray], np.ndarray]) -> Overview:
        """Approximately the overview of the picture after a monotonic function of its levels."""
        return Overview(rising(self.mean), rising(self.highest), self.block)

    @classmethod
    def of(cls, grey: Bands, side: int = 1024) -> Overview:
        """Read the picture once."""
        block = -(-max(grey.height, grey.width) // side)
        if block == 1:
            whole = np.concatenate(list(grey))
            return cls(whole, whole, 1)
        shape = -(-grey.height // block), -(-grey.width // block)
        total, highest, first = np.zeros(shape, np.float32), np.zeros(shape, np.float32), 0
        starts = np.arange(0, grey.width, block)
        for band in grey:
            rows = np.arange(first, first + len(band)) // block
            np.add.at(total, rows, np.add.reduceat(band, starts, axis=1))
            np.maximum.at(highest, rows, np.maximum.reduceat(band, starts, axis=1))
            first += len(band)
        tall, wide = (np.diff(np.append(np.arange(0, count, block), count)) for count in (grey.height, grey.width))
        return cls(total / np.outer(tall, wide).astype(np.float32), highest, block)


def open_picture(path: Path, notes: list[str], check: Callable[[np.ndarray, str], np.ndarray], *,
                 shrink: bool = False, crop: Crop | None = None, most: int = LARGEST_PIXELS) -> Bands:
    """The upright picture of a file, as bands of uint8, uint16 or float32, each passed through `check(band, name)`.

    shrink: shrink a picture of at least 8192 × 2048 px while it is read, a JPEG already while it is decoded, unless it
    is cropped. crop: the part that is read; `shrink` goes by its size. most: pixels that are decoded. Adds to `notes`
    what a user should know. Raises `InputError` if the file cannot be read, has over 20 000² pixels or more than `most`
    to decode, or does not hold the crop.
    """
    path = path.absolute()
    check_file(path, "the picture")
    with _one_line(path), _pillow_reads(LARGEST_PIXELS), Image.open(path, formats=_formats()) as picture:
        lossy, scale, before = _is_lossy(picture, path), 1, picture.size
        if shrink and lossy and crop is None:
            part = _factor(before)
            picture.draft(None, (max(1, before[0] // part), max(1, before[1] // part)))
            scale = round(before[0] / picture.size[0])
        if picture.width * picture.height > most:
            raise InputError(f"{path} has {picture.width}×{picture.height} pixels, at most {most // 10**6} million are "
                             "read here; shrink the picture first")
        whole.check_size(picture, path)
        picture.load()
        whole.check_rows(picture, path)
        frames = getattr(picture, "n_frames", 1)
        if frames > 1:
            notes.append(f"the file holds {frames} pictures: the first was taken")
        picture.load()  # counting frames may have moved to another one
        if picture.getexif().get(EXIF_ORIENTATION, 1) != 1:
            tall = picture.size
            picture = ImageOps.exif_transpose(picture)
            before = (before[1], before[0]) if picture.size != tall else before
            notes.append("turned upright by its EXIF orientation")
        size = before
        if crop is not None:
            check_within(crop, *before)
            picture = picture.crop(crop)
            size = picture.size
        if shrink and scale == 1 and _factor(size) > 1 and picture.mode in SHRUNK_MODES:
            scale = _factor(size)
            picture = picture.reduce(scale)
        if scale > 1:
            notes.append(f"shrunk {scale} times as it was read, from {size[0]}×{size[1]} px")
        mode = _mode(picture)
        picture.crop((0, 0, 1, 1)).convert(mode)  # raises where Pillow cannot

    def rows(first: int, last: int) -> np.ndarray:
        band = picture.crop((0, first, picture.width, last))
        pixels = np.asarray(band if band.mode == mode else band.convert(mode))
        return check(_sixteen_bits(pixels, path) if mode.startswith("I") else pixels, f"the picture {path}")

    return Bands(picture.height, picture.width, {"RGB": 3, "RGBA": 4}.get(mode, 1), rows, before, scale,
                 crop[:2] if crop else (0, 0), lossy)


def _is_lossy(picture: Image.Image, path: Path) -> bool:
    """Whether the file stores pixels with errors, as a JPEG does."""
    if picture.format == "WEBP":
        return _first_webp_stream(path) == b"VP8 "
    if picture.format == "TIFF":
        return picture.info.get("compression") in LOSSY_COMPRESSIONS
    return picture.format in LOSSY


def _first_webp_stream(path: Path) -> bytes:
    """The kind of a WebP file's first stream of pixels: b"VP8 " is lossy, b"VP8L" lossless (RFC 9649)."""
    with path.open("rb") as file:
        file.seek(12)
        while len(head := file.read(8)) == 8:
            kind, size = head[:4], int.from_bytes(head[4:], "little")
            if kind in (b"VP8 ", b"VP8L"):
                return kind
            file.seek(16 if kind == b"ANMF" else size + size % 2, 1)  # the frames of an animation hold streams
    return b""


def _factor(size: tuple[int, int]) -> int:
    """The factor by which a picture may be shrunk."""
    return max(1, min(max(size) // LARGE_SIDE, min(size) // LARGE_SHORTER_SIDE))


def _formats() -> list[str]:
    Image.init()
    return [name for name in FORMATS if name in Image.OPEN]  # some builds of Pillow lack formats


def _mode(picture: Image.Image) -> str:
    """The mode in which a picture is read."""
    if picture.mode == "F" or picture.mode.startswith("I"):
        return picture.mode
    return "RGBA" if picture.has_transparency_data else "L" if picture.mode in ("L", "1") else "RGB"


def _sixteen_bits(levels: np.ndarray, path: Path) -> np.ndarray:
    """Levels as 16 bits. Pillow may hold them in 32 bits."""
    if levels.min() < 0 or levels.max() > MOST_LEVELS:
        raise InputError(f"{path} holds integers from {levels.min()} to {levels.max()}; save it with 8 or 16 bits")
    return levels.astype(np.uint16)


_guard = threading.Lock()


@contextlib.contextmanager
def _pillow_reads(pixels: int) -> Iterator[None]:
    """Let Pillow read pictures of up to `pixels` pixels. Its own limit is lower, and shared by the whole process."""
    with _guard, warnings.catch_warnings():
        warnings.simplefilter("error", Image.DecompressionBombWarning)
        before, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, pixels
        try:
            yield
        finally:
            Image.MAX_IMAGE_PIXELS = before


@contextlib.contextmanager
def _one_line(path: Path) -> Iterator[None]:
    """Turn whatever Pillow raises into an `InputError`."""
    try:
        yield
    except InputError:
        raise
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise InputError(f"{path} has more than {LARGEST_PIXELS} pixels, the maximum that is read; shrink the picture "
                         "first") from error
    except UnidentifiedImageError as error:
        if told := known_as(path):
            raise InputError(f"{path} is {told}") from error
        raise InputError(f"{path} is not a picture of a supported format ({', '.join(FORMATS)}); convert it to PNG"
                         ) from error
    except Exception as error:  # on a damaged file Pillow's readers raise almost anything
        reason = getattr(error, "strerror", None) or f"the file is damaged or cut short ({error})"
        raise InputError(f"cannot read the picture {path}: {reason}") from error
