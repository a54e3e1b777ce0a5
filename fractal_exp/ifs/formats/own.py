"""JSON: this package's own format and the two public spellings."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

from ...errors import InputError
from ...runtime.files import parse_json
from ..code import IFS
from .base import CodeFormat, Entry, check_count, only_one


class Json(CodeFormat):
    """This package's JSON: maps, probabilities, colours and `meta`, without any loss.

    All three spellings can be read; see `IFS.from_json`.
    """

    key, suffixes = "json", (".json",)

    def entries(self, data: bytes) -> list[Entry]:
        if not data.strip():
            raise InputError("the file is empty")
        return [Entry(None, lambda: _checked(parse_json(data, "the file")))]

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


def _checked(data: Any) -> IFS:
    maps = data if isinstance(data, list) else data.get("linear", data.get("ifs_m")) if isinstance(data, dict) else None
    if isinstance(maps, list) and maps:
        check_count(len(maps))
    return IFS.from_json(data)
