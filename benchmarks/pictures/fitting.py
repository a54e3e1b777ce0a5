"""Fits of pictures, a JSON line each: what is there is not fitted again."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Mapping
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from fractal_exp import invert
from fractal_exp.ifs.code import IFS
from fractal_exp.methods.base import Progress
from fractal_exp.methods.collage.method import Collage
from fractal_exp.runtime import threads

from .. import archive
from ..ablation import CoreTime
from ..record import machine
from .sets import SETS

FILE = "fits.jsonl"
CLOCKS = {"core": CoreTime.deadline, "wall": Collage.deadline}  # what the limit counts, in collage search


@dataclass(frozen=True)
class Setting:
    """limit: seconds for each fit, none without; clock: what they are counted by, "core" (other work on the machine
    then makes no difference) or "wall"; options: of `invert`."""

    limit: float | None = None
    clock: str = "core"
    options: Mapping[str, Any] = field(default_factory=dict)


def fit(kind: str, name: str, setting: Setting) -> dict[str, Any]:
    """Fit one picture on one core by `invert`, and judge the code: a line of the file.

    An error is a line as well, without scores.
    """
    chosen = SETS[kind]
    line = {"set": kind, "picture": name, "role": chosen.roles()[name], **asdict(setting),
            **archive.here(), "machine": machine(), "date": time.strftime("%Y-%m-%d")}
    picture, first = chosen.picture(name), []
    core, wall = time.process_time(), time.perf_counter()

    def watch(progress: Progress) -> None:
        if progress.code is not None and not first:
            first.append(time.process_time() - core)

    try:
        found = invert(picture, seconds=setting.limit, on_step=watch, **{**chosen.options, **setting.options})
        took = {"core_seconds": round(time.process_time() - core, 2),
                "wall_seconds": round(time.perf_counter() - wall, 2),
                "first_code_seconds": round(first[0], 2) if first else None}
        scores = {key: _rounded(value) for key, value in chosen.score(name, found.code, found.target).items()}
    except Exception as error:  # a set goes on without one of its pictures
        return line | {"error": f"{type(error).__name__}: {error}"}
    return line | {"maps": len(found.code), **scores, **took, "stopped": found.stopped,
                   "verdict": found.facts()["verdict"], "code": archive.plain(found.code)}


def run(kind: str, names: Iterable[str], setting: Setting, folder: Path, workers: int) -> int:
    """Fit those of the pictures that the folder does not hold in this setting; how many."""
    folder.mkdir(parents=True, exist_ok=True)
    done = {_key(line) for line in archive.read_lines(folder / FILE) if "error" not in line}
    wanted = [name for name in names if _key({"picture": name, **asdict(setting)}) not in done]
    if not wanted:
        return 0
    with ProcessPoolExecutor(min(workers, len(wanted)), get_context("spawn"), _begin, (setting.clock,)) as pool:
        jobs = [pool.submit(fit, kind, name, setting) for name in wanted]
        for job in tqdm(as_completed(jobs), "fitting", len(jobs), unit="picture"):
            archive.append_line(folder / FILE, job.result())
    return len(wanted)


def _begin(clock: str) -> None:
    """In a process of its own: one thread, and collage search looks at this clock."""
    threads.use(1)
    Collage.deadline = CLOCKS[clock]


def read(folder: Path) -> list[dict[str, Any]]:
    """The lines of a folder, the last of each picture in a setting; failed fits have an `error`."""
    return list({_key(line): line for line in archive.read_lines(folder / FILE)}.values())


def code_of(line: Mapping[str, Any]) -> IFS:
    """The code of a line."""
    return IFS(**line["code"])


def _key(line: Mapping[str, Any]) -> str:
    return json.dumps([line[name] for name in ("picture", "limit", "clock", "options")], sort_keys=True)


def _rounded(value: Any) -> Any:
    return float(f"{value:.5g}") if isinstance(value, float | np.floating) else value
