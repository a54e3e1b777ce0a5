"""Fits of pictures, a JSON line each: what is there is not fitted again."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, field
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from fractal_exp import invert
from fractal_exp.cameras.params import CameraParams
from fractal_exp.ifs.code import IFS
from fractal_exp.images.reading import ReadImage, read_target
from fractal_exp.likeness import Likeness
from fractal_exp.methods.base import Progress
from fractal_exp.methods.collage import given
from fractal_exp.methods.collage.method import Collage
from fractal_exp.rendering.tone import Tone, own_tone, with_tone
from fractal_exp.runtime import parent, threads
from fractal_exp.runtime.files import write_atomically
from fractal_exp.verdict import Verdict

from .. import archive
from ..record import machine
from ..searches import CoreTime, Given
from .sets import SETS

FILE = "fits.jsonl"
RESOLUTION = 256                                                # of `invert`, unless told otherwise
READING = "resolution", "frame", "invert", "threshold", "clean", "crop"  # its options that say how a picture is read
CLOCKS = {"core": CoreTime.deadline, "wall": Collage.deadline}  # what the limit counts, in collage search


@dataclass(frozen=True)
class Setting:
    """limit: seconds for each fit, none without; clock: what they are counted by, "core" (other work on the machine
    then makes no difference) or "wall"; options: of `invert`; from_truth: whether the true code takes the place of the
    search, so that only camera and maps are refined."""

    limit: float | None = None
    clock: str = "core"
    options: Mapping[str, Any] = field(default_factory=dict)
    from_truth: bool = False


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

    options = {**chosen.options, **setting.options}
    try:
        if setting.from_truth:
            options = _merged({key: value for key, value in options.items() if key not in READING}, given.OPTIONS)
            picture = target_of(kind, line)
            options["checkpoint"] = Given(given.found_already(_truth(kind, name, picture)))
        found = invert(picture, seconds=setting.limit, on_step=watch, **options)
        took = {"core_seconds": round(time.process_time() - core, 2),
                "wall_seconds": round(time.perf_counter() - wall, 2),
                "first_code_seconds": round(first[0], 2) if first else None}
        scores = _scores(kind, name, found.code, found.target)
    except Exception as error:  # a set goes on without one of its pictures
        return line | {"error": f"{type(error).__name__}: {error}"}
    tone = own_tone(found.code)
    return line | {"maps": len(found.code), **scores, **took, "stopped": found.stopped,
                   "verdict": found.facts()["verdict"], "likeness": found.likeness.f1_1px,
                   "code": archive.plain(found.code), "tone": tone and tone.facts()}


def _merged(options: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Options with more of them, which win; components are merged field by field."""
    return {**options, **{key: {**options.get(key, {}), **value} if isinstance(value, dict) else value
                          for key, value in more.items()}}


def _truth(kind: str, name: str, read: ReadImage) -> IFS:
    """The true code of a picture. Raises ValueError where it has none."""
    truth = SETS[kind].truth(name, read)
    if truth is None:
        raise ValueError(f"{name} has no true code")
    return truth


def run(kind: str, names: Iterable[str], setting: Setting, folder: Path, workers: int,
        pool_of: Callable[..., Executor] = ProcessPoolExecutor) -> int:
    """Fit those of the pictures that the folder does not hold in this setting; how many. From the truth, pictures
    without a true code are left out. pool_of: makes the pool in which they are fitted."""
    folder.mkdir(parents=True, exist_ok=True)
    if setting.from_truth:
        names = [name for name in names
                 if SETS[kind].truth(name, target_of(kind, {"picture": name, **asdict(setting)})) is not None]
    done = {_key(line) for line in archive.read_lines(folder / FILE) if "error" not in line}
    wanted = [name for name in names if _key({"picture": name, **asdict(setting)}) not in done]
    if not wanted:
        return 0
    with pool_of(min(workers, len(wanted)), get_context("spawn"), _begin, (setting.clock,)) as pool:
        jobs = [pool.submit(fit, kind, name, setting) for name in wanted]
        for job in tqdm(as_completed(jobs), "fitting", len(jobs), unit="picture"):
            archive.append_line(folder / FILE, job.result())
    return len(wanted)


def judge(kind: str, folder: Path) -> None:
    """Score the codes of a folder again, each with a verdict, and write its lines anew. The camera is estimated for the
    code, as the files do not hold that of the search."""
    lines = read(folder)
    for line in tqdm([line for line in lines if "error" not in line], "judging", unit="code"):
        code, target = code_of(line), target_of(kind, line)
        options = {**SETS[kind].options, **line["options"]}
        likeness = Likeness.of(code, target, params=CameraParams(**options.get("camera", {})))
        verdict = Verdict.of(likeness, len(code), target, stopped=line.get("stopped") or "", options=options)
        line |= {**_scores(kind, line["picture"], code, target), "verdict": asdict(verdict),
                 "likeness": likeness.f1_1px}
    write_atomically(folder / FILE, "".join(f"{json.dumps(line)}\n" for line in lines))


def _scores(kind: str, name: str, code: IFS, read: ReadImage) -> dict[str, Any]:
    return {key: _rounded(value) for key, value in SETS[kind].score(name, code, read).items()}


def target_of(kind: str, line: Mapping[str, Any]) -> ReadImage:
    """The picture of a line as `invert` read it."""
    options = {"resolution": RESOLUTION, **SETS[kind].options, **line["options"]}
    return read_target(SETS[kind].picture(line["picture"]), **{key: options[key] for key in READING if key in options})


def _begin(clock: str) -> None:
    """In a process of its own, which ends with the one that started it: one thread, and collage search looks at this
    clock."""
    parent.follow_starter()
    threads.use(1)
    Collage.deadline = CLOCKS[clock]


def read(folder: Path) -> list[dict[str, Any]]:
    """The lines of a folder, the last of each picture in a setting; failed fits have an `error`."""
    return list({_key(line): line for line in archive.read_lines(folder / FILE)}.values())


def code_of(line: Mapping[str, Any]) -> IFS:
    """The code of a line, with its tone."""
    tone = line.get("tone")
    return with_tone(IFS(**line["code"]), tone and Tone(**tone))


def _key(line: Mapping[str, Any]) -> str:
    """What tells two fits apart. Lines from before there was `from_truth` began with nothing."""
    begun = [True] if line.get("from_truth") else []
    return json.dumps([*(line[name] for name in ("picture", "limit", "clock", "options")), *begun], sort_keys=True)


def _rounded(value: Any) -> Any:
    return float(f"{value:.5g}") if isinstance(value, float | np.floating) else value
