"""The commands that Hydra composes: `fractal-train`, `fractal-sweep` and `fractal-perceptual`.

Nothing heavy is imported until there is work to do.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig

from ..errors import InputError, did_you_mean
from . import configuration, interruption, words
from .commands import complain, told

failed: list[str] | None = None  # jobs of -m, to be told at its end; None in a launcher's worker, which has no end


def train() -> None:
    """One fit; with -m several, one after another."""
    raise SystemExit(_run("fractal-train", "train", _fit, sys.argv[1:], ["method=collage"]))


def perceptual() -> None:
    """The training of the perceptual distance."""
    raise SystemExit(_run("fractal-perceptual", "perceptual", _train_distance, sys.argv[1:]))


def sweep() -> None:
    """All jobs of a study: the first word names it, the rest is Hydra's; the exit status tells of failed jobs."""
    try:
        arguments = _of_study(sys.argv[1:])
    except InputError as error:
        complain("fractal-sweep", error)
    status = _run("fractal-sweep", "sweep", _run_job, arguments)
    if "fractal_exp.cli.sweeps" in sys.modules:  # else none was opened
        from . import sweeps

        status = sweeps.close(status)
    raise SystemExit(status)


def study_names() -> list[str]:
    """The studies that come with the package."""
    return sorted(path.stem for path in Path(str(files("fractal_exp.sweeps"))).glob("*.yaml"))


def _of_study(given: list[str]) -> list[str]:
    """Hydra's arguments for those of `fractal-sweep`."""
    if not {"--help", "-h", "--hydra-help", "--version"}.isdisjoint(given):
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
        rest = ["--config-dir", os.fspath(Path(str(files("fractal_exp.sweeps")))), *rest]
    shows = not {"--cfg", "-c", "--info", "-i"}.isdisjoint(rest)
    return ["--config-name", name, *rest, *([] if shows else ["--multirun"])]


def _run(program: str, config: str, work: Callable[[DictConfig], Any], given: Sequence[str],
         for_picture: Sequence[str] = ()) -> int:
    """Let Hydra compose `config` from these words and call the work; the exit status.

    What is wrong with the words, Hydra prints; a hint of what was meant comes after it (status 2). With -m, all jobs
    that failed are named at the end (status 2).
    """
    global failed
    failed = []
    interruption.listen()
    configuration.register()
    try:
        sys.argv[1:] = words.completed(given, for_picture)
    except InputError as error:
        complain(program, error)
    status = 0
    try:
        hydra.main(version_base="1.3", config_path="pkg://fractal_exp.conf", config_name=config)(work)()
    except SystemExit as end:
        error = end.__context__
        if isinstance(error, HydraException) or (end.code == 2 and error is None):
            if hint := words.hint(error, config, given):
                print(f"{program}: {hint}", file=sys.stderr)
            return 2
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        go_on = "" if program == "fractal-sweep" else " with resume=true"
        print(f"\n{program}: interrupted; the same command{go_on} goes on", file=sys.stderr)
        return 130
    if failed:
        print(f"{program}: {len(failed)} failed", *failed, sep="\n  ", file=sys.stderr)
    return 2 if failed else status


def _done(program: str, work: Callable[[DictConfig], Any], config: DictConfig) -> Any:
    """The work of one job. What a user can mend is one line; with -m, a job that fails does not stop the others."""
    try:
        with interruption.not_lost():
            return work(config)
    except Exception as error:
        line, run = told(error), HydraConfig.get()
        if run.mode == RunMode.MULTIRUN:
            if failed is None:
                raise
            line or traceback.print_exc()
            job = " ".join(word for word in run.overrides.task if word not in sys.argv)
            failed.append(f"{job}: {line or f'{type(error).__name__}: {error}'}")
            print(f"{program}: error: {failed[-1]}", file=sys.stderr)
            return None
        if line is None:
            raise
        complain(program, line)


def _fit(config: DictConfig) -> Any:
    return _done("fractal-train", lambda config: configuration.build(config.task).run(config), config)


def _train_distance(config: DictConfig) -> Any:
    from .perceptual import train_distance

    return _done("fractal-perceptual", train_distance, config)


def _run_job(config: DictConfig) -> Any:
    from .jobs import run_job

    return _done("fractal-sweep", run_job, config)
