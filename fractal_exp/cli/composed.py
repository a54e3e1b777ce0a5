"""`fractal-train`, and how a command that Hydra composes is run. Nothing heavy is imported before there is work."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from hydra.utils import get_method
from omegaconf import DictConfig

from ..errors import InputError
from ..runtime import parent
from . import configuration, interruption, several, words
from .commands import complain, told

FOR_PICTURE = ("method=collage",)  # what picture=FILE implies for a fit
failed: list[str] | None = None  # jobs of -m, to be told at its end; None in a launcher's worker, which has no end
scored: list[tuple[str, Mapping[str, float]]] = []  # the others: their own words and scores


def main() -> None:
    """The command line: one fit; with -m several, one after another."""
    status = run("fractal-train", "train", _fit, sys.argv[1:], FOR_PICTURE)
    several.close(scored, failed or (), status)
    raise SystemExit(status)


def _fit(config: DictConfig) -> Any:
    if failed is None:
        parent.follow(os.getppid())
    return done("fractal-train", get_method(config.task), config)


def run(program: str, config: str, work: Callable[[DictConfig], Any], given: Sequence[str],
        for_picture: Sequence[str] = (), go_on: str = "the same command with resume=true goes on") -> int:
    """Let Hydra compose `config` from these words and call the work; the exit status.

    What is wrong with the words, Hydra prints; what may have been meant comes after it (status 2). With -m, all jobs
    that failed are named at the end (status 2).
    """
    global failed
    failed = []
    scored.clear()
    interruption.listen(f"{program}: stopping; what is done is being kept")
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
        print(f"\n{program}: interrupted; {go_on}", file=sys.stderr)
        return 130
    if scored:
        print(f"\n{_table(scored)}")
    if failed:
        print(f"{program}: {len(failed)} failed", *failed, sep="\n  ", file=sys.stderr)
    return 2 if failed else status


def _table(scores: Sequence[tuple[str, Mapping[str, float]]]) -> str:
    """The scores of the jobs of -m, a line each."""
    import pandas as pd

    table = pd.DataFrame([each for _, each in scores], index=[words for words, _ in scores])
    return table.rename(columns=lambda name: name.split("/")[-1]).to_string(float_format="{:.3f}".format)


def done(program: str, work: Callable[[DictConfig], Any], config: DictConfig) -> Any:
    """The work of one job. What a user can mend is one line; with -m, a job that fails does not stop the others."""
    try:
        with interruption.not_lost():
            result = work(config)
        if isinstance(result, Mapping) and (own := configuration.own_words()):
            scored.append((own, result))
        return result
    except Exception as error:
        line, job = told(error), HydraConfig.get()
        if job.mode == RunMode.MULTIRUN:
            if failed is None:
                raise
            if line is None:
                traceback.print_exc()
            failed.append(f"{configuration.own_words()}: {line or f'{type(error).__name__}: {error}'}")
            print(f"{program}: error: {failed[-1]}", file=sys.stderr)
            return None
        if line is None:
            raise
        complain(program, line)
