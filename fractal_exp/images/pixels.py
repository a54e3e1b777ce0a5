"""Pictures as they are, neither cleaned nor framed: opened, read in their colours, and written as PNG."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Literal

import numpy as np
from PIL import Image
from torch import Tensor

from ..errors import InputError
from ..runtime.files import write_atomically
from .bands import LARGEST_PIXELS, Bands, Crop, open_picture
from .checks import Notes, check_pixels, unit

COMPRESSION = 3  # of PNGs: a third of the time of the usual 6, files are a tenth larger


def read_colour(source: str | Path | np.ndarray | Tensor, backdrop: float = 0.0) -> np.ndarray:
    """The upright picture in its own colours and size, (H,W,3) uint8.

    source: as for `read_target`; backdrop: the grey level in [0,1] behind transparent parts. Raises `InputError` if the
    picture cannot be read.
    """
    pixels = open_pixels(source)
    return np.concatenate([_coloured(band, backdrop) for band in pixels])


def read_small(path: str | Path, side: int, backdrop: float = 0.0) -> np.ndarray:
    """The upright picture of a file in its own colours, (h,w,3) uint8, shrunk so that its longer side has at most
    `side` pixels. It is shrunk as it is read: beside what Pillow decodes, the memory is for some rows. backdrop: as for
    `read_colour`. Raises `InputError` as that does."""
    pixels = open_pixels(path, shrink=True)
    block = max(1, max(pixels.height, pixels.width) // side)  # pixels a side, of which one is made
    starts = np.arange(0, pixels.width, block)
    counts = np.diff(np.append(starts, pixels.width))[:, None]
    rows = [np.add.reduceat(_coloured(pixels.rows(first, min(first + block, pixels.height)), backdrop).mean(0), starts)
            for first in range(0, pixels.height, block)]
    image = Image.fromarray(np.rint(np.stack(rows) / counts).astype(np.uint8))
    scale = min(1.0, side / max(pixels.width, pixels.height))
    shown = [max(1, round(scale * each)) for each in (pixels.width, pixels.height)]
    box = 0, 0, pixels.width / block, pixels.height / block  # the last block of a row may be less than a whole one
    return np.asarray(image.resize(shown, Image.Resampling.BICUBIC, box=box))


def _coloured(band: np.ndarray, backdrop: float) -> np.ndarray:
    """Some rows as they look, uint8, on a grey level behind transparent parts."""
    levels = np.atleast_3d(unit(band))
    if levels.shape[2] == 4:
        levels = levels[..., :3] * levels[..., 3:] + np.float32(backdrop) * (1 - levels[..., 3:])
    return np.rint(255 * np.broadcast_to(levels, (*levels.shape[:2], 3))).astype(np.uint8)


def write_image(path: str | Path, image: np.ndarray | Tensor, *, bits: Literal[8, 16] = 8) -> Path:
    """Write an image (H,W) or (H,W,3), of bool, uint8, uint16 or floats in [0,1], as a PNG; return the absolute path.

    16 bits are for grey images. The file appears whole or not at all. Raises `InputError` on another suffix, shape or
    range, on 16-bit colour, and if the file cannot be written.
    """
    path = Path(path).absolute()
    if path.suffix.lower() != ".png":
        raise InputError(f"images are written as PNG, got {path.name!r}; end the name in .png")
    write_atomically(path, png(image, bits=bits))
    return path


def png(image: np.ndarray | Tensor, *, bits: Literal[8, 16] = 8) -> bytes:
    """The bytes of a PNG of an image, see `write_image`."""
    pixels = check_pixels(image, "the image")
    if bits not in (8, 16) or (bits == 16 and pixels.ndim == 3) or pixels.shape[2:] == (4,):
        raise InputError(f"a PNG is written with 8 bits, grey or RGB, or with 16 bits, grey; got bits={bits!r} and "
                         f"shape {pixels.shape}")
    white = 2**bits - 1
    levels = np.rint(unit(pixels, np.float64) * white).astype(f"uint{bits}")
    file = io.BytesIO()
    Image.fromarray(levels).save(file, format="PNG", compress_level=COMPRESSION)
    return file.getvalue()


def open_pixels(source: str | Path | np.ndarray | Tensor, notes: Notes | None = None, name: str = "the image", *,
                shrink: bool = False, crop: Crop | None = None, most: int = LARGEST_PIXELS) -> Bands:
    """The upright picture of a file or an array, or a crop of it, in its own size. name: for errors; notes: get
    sentences on how it was read; shrink: a picture far too large is shrunk as it is read; most: pixels that it may
    have. Raises `InputError` if it cannot be read."""
    if isinstance(source, str | Path):
        return open_picture(Path(source), Notes() if notes is None else notes, check_pixels, shrink=shrink, crop=crop,
                            most=most)
    return Bands.of_array(check_pixels(source, name), crop)
