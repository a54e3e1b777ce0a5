"""Whether a PNG holds all the pixels that it declares: Pillow takes rows that are missing for black, or transparent."""

from __future__ import annotations

import zlib
from pathlib import Path

from PIL import Image

MOST_UNPACKED = 1032  # bytes that deflate makes of one at most
CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}  # by the colour type in the header
SOME = 2**20          # bytes that are unpacked at a time


def check_size(picture: Image.Image, path: Path) -> None:
    """Raise ValueError if a file is too short for the pixels that it declares, before memory is taken for them."""
    if picture.format == "PNG" and path.stat().st_size * MOST_UNPACKED < _declared(path):
        raise ValueError("pixels are missing")


def check_rows(picture: Image.Image, path: Path) -> None:
    """Raise ValueError if rows are missing at the end of a picture that was loaded from a file."""
    last = picture.crop((0, picture.height - 1, picture.width, picture.height))
    blank = last.getbbox(alpha_only=False) is None  # as missing rows are
    if blank and picture.format == "PNG" and not picture.info.get("interlace") and _unpacked(path) < _declared(path):
        raise ValueError("rows are missing")


def _declared(path: Path) -> int:
    """How many bytes the rows of a PNG take, each with the byte that names its filter."""
    with path.open("rb") as file:
        header = file.read(26)
    width, height = (int.from_bytes(header[at:at + 4]) for at in (16, 20))
    return height * (1 + -(-width * header[24] * CHANNELS[header[25]] // 8))


def _unpacked(path: Path) -> int:
    """How many bytes the rows of a PNG unpack to."""
    unpacking, total = zlib.decompressobj(), 0
    with path.open("rb") as file:
        file.seek(8)
        while len(head := file.read(8)) == 8:
            size = int.from_bytes(head[:4])
            if head[4:] != b"IDAT":
                file.seek(size + 4, 1)
                continue
            data = file.read(size)
            while data:
                total += len(unpacking.decompress(data, SOME))
                data = unpacking.unconsumed_tail
            file.seek(4, 1)
    return total
