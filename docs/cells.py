"""Records of results, and how their numbers are written in a table."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pandas as pd

Rows = list[list[str]]


def lines_of(path: Path) -> list[dict[str, Any]]:
    """The records of a file of JSON lines; of a folder, those of its fits."""
    if path.is_dir():
        path = next(path / name for name in ("codes.jsonl", "fits.jsonl") if (path / name).exists())
    return [json.loads(line) for line in path.read_text().splitlines()]


def frame(path: Path) -> pd.DataFrame:
    """The records as a table."""
    return pd.DataFrame(lines_of(path))


def short(value: float, digits: int = 3, sign: str = "") -> str:
    """A number as .976, with a true minus sign; empty if it is absent."""
    text = "" if pd.isna(value) else f"{value:{sign}.{digits}f}".replace("-", "−")
    return text.replace("0.", ".", 1) if text.lstrip("+−").startswith("0.") else text


def share(flags: Iterable[Any]) -> str:
    """How many of them hold, as 44 of 46."""
    flags = [bool(flag) for flag in flags]
    return f"{sum(flags)} of {len(flags)}"


def percent(flags: pd.Series) -> str:
    return f"{flags.astype(bool).mean():.0%}"


def interval(low: float, high: float, digits: int = 3, sign: str = "") -> str:
    return "" if pd.isna(low) else f" [{short(low, digits, sign)}, {short(high, digits, sign)}]"
