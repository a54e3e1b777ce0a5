"""Records of benchmarks: files of JSON lines, one line a run, that are only ever added to.

A line is {"benchmark", "date", "commit", "machine", "environment", "ratios", "figures"}. ratios: by name, the numbers
that can be compared between machines and days, such as the time of a twin over that of a kernel, or a score; figures:
all that was measured, in the benchmark's own form. `python -m benchmarks.history` draws the ratios against the date.
"""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from .environment import environment

RESULTS = Path(__file__).parent / "results"
KEYS = ("benchmark", "date", "commit", "machine", "environment", "ratios", "figures")


def append(path: Path, benchmark: str, figures: Mapping[str, Any], ratios: Mapping[str, float],
           device: str = "cpu") -> None:
    """Add the record of a run that ends now, on this machine and commit."""
    here = environment(device)
    record = {"benchmark": benchmark, "date": datetime.now(UTC).isoformat(timespec="seconds"),
              "commit": here.pop("commit"), "machine": machine(), "environment": here, "ratios": dict(ratios),
              "figures": dict(figures)}
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a") as file:
        file.write(json.dumps(record, ensure_ascii=False) + "\n")


def read(path: Path) -> list[dict[str, Any]]:
    """The records of a file, oldest first; raises ValueError, with file and line, on what is no record."""
    records = []
    for number, line in enumerate(path.read_text().splitlines(), 1):
        record = json.loads(line)
        if not isinstance(record, dict) or tuple(record) != KEYS:
            raise ValueError(f"{path}, line {number}: a record has the keys {', '.join(KEYS)}")
        records.append(record)
    return sorted(records, key=lambda record: record["date"])


def machine() -> str:
    """The processor's name and the number of cores."""
    return f"{_processor()}, {os.cpu_count()} cores"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:  # no Linux
        lines = []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())
