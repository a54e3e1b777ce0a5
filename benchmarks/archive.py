"""The codes of a published run, one JSON line a fractal, so that they can be judged again without fitting again.

A run is a folder: codes.jsonl as the fits left it; per_view.csv and report.txt as `benchmarks.judge` writes them.
"""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor

from fractal_exp import codes, suite
from fractal_exp.ifs.code import IFS

from .environment import environment

CODES = "codes.jsonl"
LOADED = environment("cpu")  # as this process began: the code that it runs, whatever is committed meanwhile


@dataclass(frozen=True)
class Stage:
    """The code at the end of a stage of a method, and the seconds of one core that it had taken until then."""

    name: str
    seconds: float
    code: IFS


@dataclass(frozen=True)
class Fit:
    """One fit of a run.

    fractal: a number of the suite, or the name of a classic code; suite: the suite's seed, None for classics; kind:
    grey or binary target; resolution: of the target; options: of the method; seconds: of one core; commit, machine:
    where it ran.
    """

    fractal: int | str
    suite: int | None
    kind: str
    resolution: int
    method: str
    options: dict
    seconds: float
    code: IFS
    stages: tuple[Stage, ...] = ()
    commit: str | None = None
    machine: str | None = None
    versions: dict[str, str | None] = field(default_factory=dict)

    @property
    def truth(self) -> IFS:
        """The code that drew the target, in its own coordinates; its probabilities are |det| + 0.01."""
        return true_code(self.fractal, self.suite)


def true_code(fractal: int | str, seed: int | None) -> IFS:
    """A classic code by name, or a fractal of the suite of this seed by number, with probabilities |det| + 0.01."""
    code = codes.known(fractal) if isinstance(fractal, str) else suite.random_suite(fractal + 1, seed)[fractal]
    return replace(code, probabilities=None)


def here() -> dict:
    """The fields of a `Fit` that say where it ran: the commit is that of the code as it was imported."""
    facts = dict(LOADED)
    return {"commit": facts.pop("commit"), "machine": facts.pop("machine"), "versions": facts}


def append(folder: Path, fit: Fit) -> None:
    """Add a fit to the run in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    record = {name: value for name, value in vars(fit).items() if name not in ("code", "stages")}
    record |= {"code": plain(fit.code), "stages": [vars(stage) | {"code": plain(stage.code)} for stage in fit.stages]}
    append_line(folder / CODES, record)


def append_line(path: Path, record: Mapping[str, Any]) -> None:
    """Add a record to a file of JSON lines, on a line of its own even if the last one is incomplete."""
    with open(path, "ab+") as file:
        if file.tell():
            file.seek(-1, os.SEEK_END)
        start = b"" if file.read(1) in (b"", b"\n") else b"\n"
        file.write(start + json.dumps(record).encode() + b"\n")


def read(folder: Path) -> list[Fit]:
    """The fits of a run, in the order of the fractals.

    A line that ends before its record does is left out with a warning: its process was killed while it wrote.
    """
    fits = [_fit(record) for record in read_lines(folder / CODES)]
    return sorted(fits, key=lambda fit: (isinstance(fit.fractal, str), fit.fractal))


def read_lines(path: Path) -> list[dict[str, Any]]:
    """The records of a file of JSON lines, none where there is no file; an incomplete line is left out with a
    warning."""
    records = []
    for number, line in enumerate(path.read_text().splitlines() if path.exists() else [], 1):
        try:
            records.append(json.loads(line))
        except json.JSONDecodeError:
            warnings.warn(f"{path}: line {number} is incomplete and left out; what it held has to be fitted again",
                          stacklevel=3)
    return records


def missing(folder: Path, fractals: Iterable[int | str]) -> list[int | str]:
    """Those of the fractals that the run does not hold yet."""
    done = {fit.fractal for fit in read(folder)}
    return [fractal for fractal in dict.fromkeys(fractals) if fractal not in done]


def _fit(record: dict) -> Fit:
    stages = tuple(Stage(**stage | {"code": IFS(**stage["code"])}) for stage in record.pop("stages"))
    return Fit(**record | {"code": IFS(**record["code"]), "stages": stages})


def plain(code: IFS) -> dict[str, Any]:
    """A code as JSON data that come back exactly."""
    return {name: None if (value := getattr(code, name)) is None else _short(value)
            for name in ("linear", "offset", "probabilities")}


def _short(values: Tensor) -> list:
    """Nested lists of numbers with as many digits as float32 needs to come back exactly."""
    return np.vectorize(lambda x: float(f"{x:.9g}"))(values.cpu().numpy()).tolist()
