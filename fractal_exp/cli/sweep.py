"""`fractal-sweep NAME`: all jobs of a study, with any of Hydra's launchers, and one table."""

from __future__ import annotations

import importlib.resources
import os
import sys
from pathlib import Path

import hydra
from omegaconf import DictConfig

from ..errors import InputError, did_you_mean
from ..runtime.files import explain
from . import configuration, interruption, sweeps, words, workers
from .jobs import run_job


def study_names() -> list[str]:
    """The studies that come with the package."""
    return sorted(path.stem for path in Path(str(importlib.resources.files("fractal_exp.sweeps"))).glob("*.yaml"))


@hydra.main(version_base="1.3", config_path="pkg://fractal_exp.conf", config_name="sweep")
def _hydra_main(config: DictConfig) -> str:
    return run_job(config)


def main() -> None:
    """The command line: the first word names the study, the rest is Hydra's; the exit status tells of failed jobs."""
    interruption.listen()
    configuration.register()
    workers.use()
    try:
        arguments = _arguments(sys.argv[1:])
    except InputError as error:
        words.complain("fractal-sweep", str(error))
    status = 0
    try:
        words.run("fractal-sweep", _hydra_main, arguments, "sweep")
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        print("\nfractal-sweep: interrupted; the same command goes on", file=sys.stderr)
        status = 130
    while sweeps.opened:
        try:
            status = sweeps.opened.pop().close(status)
        except (InputError, OSError) as error:  # the tables could not be written: a full disk
            reason = explain(error) if isinstance(error, OSError) else error
            print(f"fractal-sweep: error: {reason}; the same command goes on", file=sys.stderr)
            status = 2
    raise SystemExit(status)


def _arguments(given: list[str]) -> list[str]:
    """Hydra's arguments for ours."""
    if any(word in ("--help", "-h", "--hydra-help", "--version") for word in given):
        return given
    known = study_names()
    name, *rest = given or [""]
    if not name or name.startswith("-") or "=" in name:
        raise InputError(f"name a study first: {', '.join(known)}, or one of your own with --config-dir FOLDER; "
                         "fractal-sweep --help tells more")
    if not any(word in ("--config-dir", "-cd") or word.startswith("--config-dir=") for word in rest):
        if name not in known:
            near = did_you_mean(name, known)
            raise InputError(f"there is no study {name!r}{near or ';'} choose one of {', '.join(known)}, or "
                             "name the folder of your own with --config-dir FOLDER")
        rest = ["--config-dir", os.fspath(Path(str(importlib.resources.files("fractal_exp.sweeps")))), *rest]
    shows = any(word in ("--cfg", "-c", "--info", "-i") for word in rest)
    return ["--config-name", name, *rest, *([] if shows else ["--multirun"])]


if __name__ == "__main__":
    main()
