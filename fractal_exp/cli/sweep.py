"""`fractal-sweep NAME`: all jobs of a study, with any of Hydra's launchers, and one table."""

from __future__ import annotations

import os
import sys
from importlib.resources import files
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from ..errors import InputError, did_you_mean
from .commands import complain
from .composed import done, run

STUDIES = Path(str(files("fractal_exp.sweeps")))


def main() -> None:
    """The command line: the first word names the study, the rest is Hydra's; the exit status tells of failed jobs."""
    try:
        arguments = _arguments(sys.argv[1:])
    except InputError as error:
        complain("fractal-sweep", error)
    status = run("fractal-sweep", "sweep", _run_job, arguments, go_on="the same command goes on")
    if "fractal_exp.cli.sweeps" in sys.modules:  # else none was opened
        from . import sweeps

        status = sweeps.close(status)
    raise SystemExit(status)


def _run_job(config: DictConfig) -> Any:
    from .jobs import run_job

    return done("fractal-sweep", run_job, config)


def _arguments(given: list[str]) -> list[str]:
    """Hydra's arguments for ours."""
    if not {"--help", "-h", "--hydra-help", "--version"}.isdisjoint(given):
        return given
    known = sorted(path.stem for path in STUDIES.glob("*.yaml"))
    name, *rest = given or [""]
    if not name or name.startswith("-") or "=" in name:
        raise InputError(f"name a study first: {', '.join(known)}, or one of your own with --config-dir FOLDER; "
                         "fractal-sweep --help tells more")
    if not any(word in ("--config-dir", "-cd") or word.startswith("--config-dir=") for word in rest):
        if name not in known:
            near = did_you_mean(name, known)
            raise InputError(f"there is no study {name!r}{near or ';'} choose one of {', '.join(known)}, or "
                             "name the folder of your own with --config-dir FOLDER")
        rest = ["--config-dir", os.fspath(STUDIES), *rest]
    shows = not {"--cfg", "-c", "--info", "-i"}.isdisjoint(rest)
    return ["--config-name", name, *rest, *([] if shows else ["--multirun"])]
