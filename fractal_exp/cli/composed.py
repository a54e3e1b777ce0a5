"""`fractal-train`, alone or with several fits (-m) below one parent run, and how a command that Hydra composes is run.
Nothing heavy is imported before there is work."""

from __future__ import annotations

import hashlib
import json
import os
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from hydra.types import RunMode
from hydra.utils import get_method
from omegaconf import DictConfig, open_dict, read_write

from ..errors import InputError
from ..runtime import parent
from ..runtime.files import make_folder
from . import configuration, interruption, words
from .commands import complain, told

if TYPE_CHECKING:
    from ..tracking import Tracker

FOR_PICTURE = ("method=collage",)  # what picture=FILE implies for a fit
above: list[Tracker] = []  # the parent run of -m, from Hydra's callback, which can return nothing
failed: list[str] | None = None  # jobs of -m, to be told at its end; None in a launcher's worker, which has no end
scored: list[tuple[str, Mapping[str, float]]] = []  # the others: their own words and scores


def main() -> None:
    """The command line: one fit; with -m several, one after another."""
    status = run("fractal-train", "train", _fit, sys.argv[1:], FOR_PICTURE)
    while above:
        _end(above.pop(), status)
    raise SystemExit(status)


def _fit(config: DictConfig) -> Any:
    if failed is None:
        parent.follow(os.getppid())
    return done("fractal-train", get_method(config.task), config)


class OpenSeveral(Callback):
    """Hydra's call before the first fit of -m: begins the parent run, and tells the fits of it."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        try:  # Hydra would make a mere warning of an error
            above.append(_begin(config))
        except InputError as error:
            complain("fractal-train", error)


def _begin(config: DictConfig) -> Tracker:
    from hydra.core.override_parser.overrides_parser import OverridesParser

    from .jobs import job_name
    from .runs import NoRuns

    given = list(config.hydra.overrides.task)
    parsed = OverridesParser.create().parse_overrides(given)
    name = job_name(given, {each.get_key_element() for each in parsed if each.is_sweep_override()})
    same = hashlib.sha256(json.dumps(sorted(word for word in given if not word.startswith("resume="))).encode())
    with read_write(config):
        config.output = str(Path(config.output).expanduser().absolute())
    settings = {key: config[key] for key in ("output", "study", "scale", "device", "resume")}
    runs: NoRuns = configuration.build(config.tracking)
    folder = make_folder(Path(config.output) / config.study / f"{name}-{same.hexdigest()[:6]}")
    run = runs.start_several(settings, folder, name, given)
    if run.run_id:
        with read_write(config), open_dict(config):
            config.hydra.overrides.task.append(f"{configuration.PARENT}={run.run_id}")
    return run


def _end(run: Tracker, status: int) -> None:
    """End the parent run, with the table of the scores."""
    if scored:
        import pandas as pd

        run.table("summary.json", pd.DataFrame([{"fit": words, **scores} for words, scores in scored]))
    error = f"{len(failed)} fits failed" if failed else None
    run.finish("KILLED" if status == 130 else "FAILED" if error or status else "FINISHED", error)


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
