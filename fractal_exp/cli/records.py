"""What a fit left behind, read as data: nothing that a file or a tracking server says is called, opened or resolved."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from PIL import Image
from torch import Tensor

from ..errors import InputError
from ..ifs.code import IFS
from ..runtime.files import LARGEST_JSON, parse_json

FINISHED, CONFIG = "finished.json", "config.yaml"
CODE, TRUTH, PICTURE = "code.json", "truth.json", "target.png"
ENLARGED = "enlarged.png"  # in place of a code, where the method found none
LARGEST_SIDE = 8192       # pixels, of a picture that a fit left
LARGEST_PICTURE = 2**28   # bytes of its file, which 16-bit noise of that size just about needs

Read = Callable[[str], bytes | None]  # a file of the fit by its name, None if there is none


@dataclass(frozen=True)
class Aim:
    """What a fit was to find: the `truth` that drew its target, or the `picture` (R,R) and the `file` it was kept in;
    nothing, if the fit was of a picture that is not kept."""

    truth: IFS | None = None
    picture: Tensor | None = None
    file: str | None = None


def most_bytes(name: str) -> int:
    """How large a file of a fit may be; a `Read` refuses larger ones without reading them."""
    return LARGEST_PICTURE if name.endswith(".png") else LARGEST_JSON


def read_code(read: Read, name: str, where: str) -> IFS | None:
    """The code in one file of a fit, None if there is no such file. Raises `InputError` naming the file."""
    data = read(name)
    if data is None:
        return None
    try:
        return IFS.from_json(parse_json(data, "it"))
    except InputError as error:
        raise InputError(f"{where}/{name}: {error}") from None


def read_aim(read: Read, where: str) -> Aim:
    """What the fit of these files was to find: from truth.json or target.png. Raises `InputError` naming a file that
    is damaged."""
    truth = read_code(read, TRUTH, where)
    if truth is not None:
        return Aim(truth)
    if (data := read(PICTURE)) is not None:
        return Aim(None, _picture(data, f"{where}/{PICTURE}"), PICTURE)
    return Aim()


def _picture(data: bytes, where: str) -> Tensor:
    """A square grey PNG as (R,R) float32 in [0,1]."""
    try:
        with Image.open(io.BytesIO(data), formats=["PNG"]) as picture:
            if picture.width != picture.height or picture.width > LARGEST_SIDE:
                raise InputError(f"{where}: a fit's picture is square and at most {LARGEST_SIDE} px a side, got "
                                 f"{picture.width}×{picture.height}")
            pixels = np.asarray(picture)
    except InputError:
        raise
    except Exception as error:  # Pillow's own kinds, by what is wrong
        raise InputError(f"{where}: this is no PNG that can be read: {_short(error)}") from None
    if pixels.ndim != 2 or pixels.dtype not in (np.uint8, np.uint16, np.int32):
        raise InputError(f"{where}: a fit's picture is grey, of 8 or 16 bits")
    white = 255 if pixels.dtype == np.uint8 else 65535
    return torch.from_numpy((pixels.astype(np.float64) / white).clip(0, 1).astype(np.float32))


def _short(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0][:200]
