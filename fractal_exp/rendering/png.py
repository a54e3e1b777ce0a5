"""Write a PNG band by band, so that a picture may be larger than memory, or many small ones fast.

Our libraries can write neither a PNG in pieces, nor colour or grey with alpha at 16 bits, nor rows as they are. The
format itself is small (ISO 15948).
"""

from __future__ import annotations

import struct
import zlib
from contextlib import ExitStack
from pathlib import Path
from typing import Self

import numpy as np

from ..errors import InputError
from ..runtime.files import replacing

GREY, RGB, ALPHA = 0, 2, 4  # colour types; the last is added to one of the others
FILTER_UP = 2             # a row is stored as its difference from the row above
LEVEL = 6                 # of compression
ROWS = 32                 # packed at once
SIGNATURE, HEADER = b"\x89PNG\r\n\x1a\n", ">IIBBBBB"


def of_dots(image: np.ndarray) -> bytes:
    """A PNG of a grey image (H,W) uint8 of dots. Runs of equal pixels pack it in half of the time, and smaller, than
    filters do, which Pillow tries on every row."""
    rows = np.zeros((len(image), 1 + image.shape[1]), np.uint8)  # each begins with its filter: 0 for none
    rows[:, 1:] = image
    deflate = zlib.compressobj(1, memLevel=9, strategy=zlib.Z_RLE)
    return b"".join((SIGNATURE, _chunk(b"IHDR", struct.pack(HEADER, image.shape[1], len(image), 8, GREY, 0, 0, 0)),
                     _chunk(b"IDAT", deflate.compress(rows.tobytes()) + deflate.flush()), _chunk(b"IEND", b"")))


class PngWriter:
    """Write a grey image of `width` × `height` pixels, or one in colour, in bands of whole rows, from the top.

    bits: 8 or 16. transparent: a grey image becomes the opacity of pure white, so that it can be laid over anything,
    and one in colour has its opacity as a fourth channel. Use it as a context manager: the file
    appears when all rows are written and the block ends without an error. Raises `InputError` on a suffix other than
    .png or other bits, and if the file cannot be written.
    """

    def __init__(self, path: str | Path, width: int, height: int, *, bits: int = 8, transparent: bool = False,
                 colour: bool = False):
        self.path = Path(path).absolute()
        if self.path.suffix.lower() != ".png":
            raise InputError(f"images are written as PNG, got {self.path.name!r}; end the name in .png")
        if bits not in (8, 16):
            raise InputError(f"a PNG has 8 or 16 bits a sample, got {bits}")
        self.width, self.height, self.bits, self.transparent = width, height, bits, transparent
        self.colour, self.samples = colour, (3 if colour else 1) + transparent

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._file = stack.enter_context(open(stack.enter_context(replacing(self.path)), "wb"))
            self._stack = stack.pop_all()
        self._rows, self._deflate = 0, zlib.compressobj(LEVEL)
        self._above = np.zeros(self.width * self.samples * self.bits // 8, np.uint8)
        self._file.write(SIGNATURE)
        self._chunk(b"IHDR", struct.pack(HEADER, self.width, self.height, self.bits,
                                         (RGB if self.colour else GREY) + ALPHA * self.transparent, 0, 0, 0))
        return self

    def write(self, band: np.ndarray) -> None:
        """Append rows of floats in [0,1]: (H,width), or (H,width,3 or 4) in colour."""
        channels = (self.samples,) if self.colour else ()
        fits = band.ndim >= 2 and band.shape[1:] == (self.width, *channels)
        if not fits or self._rows + len(band) > self.height:
            raise ValueError(f"rows of {(self.width, *channels)} up to {self.height} in all, got {band.shape} after "
                             f"{self._rows}")
        for start in range(0, len(band), ROWS):
            self._write_few(band[start:start + ROWS])
        self._rows += len(band)

    def _write_few(self, band: np.ndarray) -> None:
        white = 2**self.bits - 1
        levels = np.rint(band * white)
        if self.transparent and not self.colour:
            levels = np.stack([np.full_like(levels, white), levels], -1)
        stored = levels.astype(f">u{self.bits // 8}", order="C")
        rows = np.vstack([self._above, stored.view(np.uint8).reshape(len(band), -1)])
        filtered = np.empty((len(band), 1 + rows.shape[1]), np.uint8)
        filtered[:, 0] = FILTER_UP
        filtered[:, 1:] = rows[1:] - rows[:-1]
        self._above = rows[-1].copy()
        self._chunk(b"IDAT", self._deflate.compress(filtered.tobytes()))

    def __exit__(self, kind: type | None, error: BaseException | None, trace: object) -> None:
        with self._stack:  # closes the file, then moves it into place or removes it
            if error is not None:
                raise error
            self._finish()

    def _finish(self) -> None:
        if self._rows < self.height:
            raise ValueError(f"{self.path} has {self._rows} of {self.height} rows")
        self._chunk(b"IDAT", self._deflate.flush())
        self._chunk(b"IEND", b"")

    def _chunk(self, kind: bytes, data: bytes) -> None:
        if data or kind == b"IEND":
            self._file.write(_chunk(kind, data))


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
