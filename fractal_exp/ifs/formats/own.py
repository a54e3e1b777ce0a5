"""JSON: this package's own format and the two public spellings."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Mapping, Sequence
from typing import Any

from ...errors import InputError
from ...runtime.files import parse_json
from ..code import FORMAT, IFS, VERSION
from ..colours import Colours
from ..numbers import floats, only_keys, only_numbers
from .base import CodeFormat, Entry, Import, check_count, only_one
from .rows import places_of


class Json(CodeFormat):
    """This package's JSON: maps, probabilities, colours and `meta`, without any loss.

    All three spellings can be read; see `from_json`.
    """

    key, suffixes, rows = "json", (".json",), True

    def entries(self, data: bytes) -> list[Entry]:
        if not data.strip():
            raise InputError("the file is empty")
        return [Entry(None, lambda: Import(_checked(parse_json(data, "the file"), self.order)))]

    def write(self, codes: Sequence[IFS]) -> bytes:
        return dumps(self.spelling(only_one(codes, self.key)), indent=1)

    def spelling(self, code: IFS) -> Any:
        """The code as plain data."""
        return code.to_json()


class Lists(Json):
    """JSON with `ifs_m` (N,2,2), `ifs_t` (N,2) and, if the code has probabilities, `ifs_p` (N,). `meta` and
    colours are lost."""

    key, suffixes = "lists", ()

    def spelling(self, code: IFS) -> dict[str, Any]:
        data = code.to_json()
        lists = {"ifs_m": data["linear"], "ifs_t": data["offset"], "ifs_p": data["probabilities"]}
        return {key: value for key, value in lists.items() if value is not None}


class Rows(Json):
    """JSON with a row a b c d e f for each map, and p if the code has probabilities. `meta` and colours are lost."""

    key, suffixes = "rows", ()

    def spelling(self, code: IFS) -> list[list[float]]:
        return rows_of(code)


def rows_of(code: IFS) -> list[list[float]]:
    """Rows a b c d e f, and p if the code has probabilities, as the shortest decimals of the same float32."""
    data = code.to_json()
    chance = [[]] * len(code) if data["probabilities"] is None else [[p] for p in data["probabilities"]]
    return [[*first, *second, *offset, *p]
            for (first, second), offset, p in zip(data["linear"], data["offset"], chance, strict=True)]


def dumps(data: Any, indent: int | None = None) -> bytes:
    """JSON as bytes. Raises `InputError` if `meta` holds anything that JSON cannot."""
    try:
        return (json.dumps(data, indent=indent) + "\n").encode()
    except (TypeError, ValueError, RecursionError) as error:
        raise InputError(f"meta must hold nothing but JSON (text, numbers, lists, mappings): {error}") from error


def _checked(data: Any, order: str | None) -> IFS:
    maps = data if isinstance(data, list) else data.get("linear", data.get("ifs_m")) if isinstance(data, dict) else None
    if isinstance(maps, list) and maps:
        check_count(len(maps))
    if order is None:
        return from_json(data)
    if not isinstance(data, list):
        raise InputError("the file has no rows of numbers; leave order (--order) out")
    return _from_rows(data, order).check_contractive()


def from_json(data: Any) -> IFS:
    """A contractive code from plain data in this package's format or one of the two public spellings.

    The public spellings are a mapping with `ifs_m` (N,2,2) or (N,4), `ifs_t` (N,2) and optionally `ifs_p` (N,),
    and a list of rows `a b c d e f [p]` meaning x' = a x + b y + e, y' = c x + d y + f. Raises `InputError` on
    anything else.
    """
    if isinstance(data, list):
        code = _from_rows(data)
    elif isinstance(data, Mapping) and "ifs_m" in data:
        code = _from_lists(data)
    elif isinstance(data, Mapping):
        code = _from_own(data)
    else:
        raise InputError(f"a code is a JSON object or a list of rows of six numbers, got {type(data).__name__}")
    return code.check_contractive()


def _from_own(data: Mapping[str, Any]) -> IFS:
    only_keys(data, {"format", "version", "linear", "offset", "probabilities", "colours", "meta"})
    version = data.get("version")
    if data.get("format") != FORMAT or isinstance(version, bool) or version != VERSION:
        found = f"{reprlib.repr(data.get('format'))} version {reprlib.repr(version)}"
        raise InputError(f"expected format {FORMAT!r} version {VERSION}, got {found}; no other version is read")
    missing = [key for key in ("linear", "offset") if key not in data]
    if missing:
        raise InputError(f"the code has no {' and no '.join(missing)}")
    given, meta, colours = data.get("probabilities"), data.get("meta"), data.get("colours")
    return IFS(only_numbers("linear", data["linear"]), only_numbers("offset", data["offset"]),
               None if given is None else only_numbers("probabilities", given), {} if meta is None else meta,
               None if colours is None else Colours.from_json(colours))


def _from_lists(data: Mapping[str, Any]) -> IFS:
    only_keys(data, {"ifs_m", "ifs_t", "ifs_p"})
    if "ifs_t" not in data:
        raise InputError("ifs_m needs ifs_t beside it: one offset (x, y) per matrix")
    linear = floats("ifs_m", only_numbers("ifs_m", data["ifs_m"]))
    if linear.ndim == 2 and linear.shape[1] == 4:
        linear = linear.reshape(-1, 2, 2)
    given = data.get("ifs_p")
    return IFS(linear, only_numbers("ifs_t", data["ifs_t"]), None if given is None else only_numbers("ifs_p", given))


def _from_rows(rows: list[Any], order: str | None = None) -> IFS:
    table = floats("rows", only_numbers("rows", rows))
    if table.ndim != 2 or table.shape[1] not in (6, 7):
        raise InputError(f"a list of rows needs six numbers each, a b c d e f, or seven with the probability; "
                         f"got shape {tuple(table.shape)}")
    if order is not None:
        table = table[:, places_of(order, table.shape[1])]
    p = table[:, 6] if table.shape[1] == 7 else None
    return IFS(table[:, :4].reshape(-1, 2, 2), table[:, 4:6], p)
