"""What a fit left behind, read as data: nothing that a file or a tracking server says is called, opened or resolved."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import torch
import yaml
from PIL import Image
from pydantic import BaseModel, ConfigDict, Field, ValidationError
from torch import Tensor

from ..errors import InputError
from ..ifs.code import IFS
from ..runtime.files import LARGEST_JSON, parse_json
from ..targets import KnownCode, SuiteFractal

FINISHED, CONFIG = "finished.json", "config.yaml"
CODE, TRUTH, PICTURE, EIGHT_BITS = "code.json", "truth.json", "target.png", "views/target.png"
ENLARGED = "enlarged.png"  # in place of a code, where the method found none
LARGEST_SIDE = 8192       # pixels, of a picture that a fit left
LARGEST_PICTURE = 2**28   # bytes of its file, which 16-bit noise of that size just about needs
LARGEST_INDEX = 99_999    # of a fractal of a suite that a record names

Read = Callable[[str], bytes | None]  # a file of the fit by its name, None if there is none


@dataclass(frozen=True)
class Aim:
    """What a fit was to find: the `truth` that drew its target, or the `picture` (R,R) and the `file` it was kept in;
    nothing, if the fit was of a picture that is not kept."""

    truth: IFS | None = None
    picture: Tensor | None = None
    file: str | None = None


class _Record(BaseModel):
    """The arguments of a target as records before truth.json have them. Only scalars, of the right type."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    kind: Literal["grey", "binary"] = "grey"


class _Known(_Record):
    name: str = Field("fern", max_length=100)
    probabilities: Literal["area", "published"] = "area"

    def truth(self) -> IFS:
        return KnownCode(self.name, self.kind, self.probabilities).code


class _Suite(_Record):
    index: int = Field(0, ge=0, le=LARGEST_INDEX)
    seed: int = Field(ge=0, lt=2**64)

    def truth(self) -> IFS:
        return SuiteFractal(self.index, self.seed).code


CODES: dict[str, type[_Known] | type[_Suite]] = {"fractal_exp.targets.KnownCode": _Known,
                                                 "fractal_exp.targets.SuiteFractal": _Suite}
PICTURES = tuple(f"fractal_exp.targets.{name}" for name in ("Picture", "RetinaVessels", "Snowflake"))


def most_bytes(name: str) -> int:
    """How large a file of a fit may be; a `Read` refuses larger ones without reading them."""
    return LARGEST_PICTURE if name.endswith(".png") else LARGEST_JSON


def read_code(read: Read, name: str, where: str) -> IFS | None:
    """The code in one file of a fit, None if there is no such file. Raises `InputError` naming the file."""
    data = read(name)
    if data is None:
        return None
    try:
        return IFS.from_json(_json(data))
    except InputError as error:
        raise InputError(f"{where}/{name}: {error}") from None


def read_aim(read: Read, where: str) -> Aim:
    """What the fit of these files was to find: from truth.json or target.png, else from an older fit's record.

    Raises `InputError` naming the file that is damaged, or the target that is none of this package's.
    """
    truth = read_code(read, TRUTH, where)
    if truth is not None:
        return Aim(truth)
    if (data := read(PICTURE)) is not None:
        return Aim(None, _picture(data, f"{where}/{PICTURE}"), PICTURE)
    truth = _older_truth(read, where)
    if truth is not None:
        return Aim(truth)
    if (data := read(EIGHT_BITS)) is not None:
        return Aim(None, _picture(data, f"{where}/{EIGHT_BITS}"), EIGHT_BITS)
    return Aim()


def _json(data: bytes) -> Any:
    return parse_json(data, "it")


def _yaml(data: bytes) -> Any:
    if len(data) > LARGEST_JSON:
        raise InputError(f"it has {len(data)} bytes, at most {LARGEST_JSON} are read")
    try:
        return yaml.safe_load(data)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise InputError(f"this is no YAML that can be read: {_short(error)}") from None


def _older_truth(read: Read, where: str) -> IFS | None:
    """The truth by the record of a fit that kept none: finished.json in a folder, config.yaml in a run; None for a
    picture, whose file is not opened: a record may name any."""
    for name, parse, path in ((FINISHED, _json, ("identity", "target")), (CONFIG, _yaml, ("target",))):
        data = read(name)
        if data is None:
            continue
        try:
            record = parse(data)
            for key in path:
                if not isinstance(record, Mapping) or key not in record:
                    raise InputError(f"it has no {'.'.join(path)}")
                record = record[key]
            return _truth(record)
        except InputError as error:
            raise InputError(f"{where}/{name}: {error}") from None
    raise InputError(f"{where} does not say what was fitted: no {TRUTH}, {PICTURE}, {FINISHED} or {CONFIG}; name a "
                     "truth with --truth")


def _truth(target: Any) -> IFS | None:
    name = target.get("_target_") if isinstance(target, Mapping) else None
    if not isinstance(name, str):
        raise InputError("its target names no class")
    if name in PICTURES:
        return None
    if name not in CODES:
        raise InputError(f"{name[:100]!r} is no target of this package whose code is known")
    try:
        record = CODES[name](**{str(key): value for key, value in target.items() if key != "_target_"})
    except ValidationError as error:
        first = error.errors(include_input=False, include_url=False)[0]
        raise InputError(f"target.{'.'.join(map(str, first['loc']))[:100]}: {first['msg']}") from None
    return record.truth()


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
