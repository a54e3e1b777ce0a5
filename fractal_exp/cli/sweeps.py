"""A sweep as its parent process sees it: the jobs to be done, a parent run, what comes in, the table at the end."""

from __future__ import annotations

import hashlib
import itertools
import json
import os
import sys
import threading
import time
import traceback
from collections.abc import Sequence
from inspect import signature
from pathlib import Path
from typing import Any

from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf, open_dict, read_write
from omegaconf.errors import OmegaConfBaseException

from ..errors import InputError
from ..runtime.deadline import in_words
from ..runtime.files import explain, make_folder
from ..studies import report
from ..studies.writing import write
from ..targets import Picture
from ..tracking import Tracker, comparison_address, mark_killed_runs, prepare_store
from ..tracking.addresses import dashboard_line, shown, store_uri
from . import configuration, cost
from .commands import complain
from .jobs import FAILED, Outcome, describe_scores, job_name
from .runs import NoRuns
from .train import NOT_PART_OF_A_FIT

POLL_SECONDS = 0.5
JOBS = "jobs.json"  # of the parent run: the names of all jobs


class OpenSweep(Callback):
    """Hydra's call before the first job starts: opens the sweep and tells the jobs where they belong."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        try:  # Hydra would make a mere warning of an error
            opened.append(RunningSweep(config))
        except HydraException as error:
            print(error, *([error.__cause__] if error.__cause__ else []), sep="\n", file=sys.stderr)
            raise SystemExit(2) from error
        except (InputError, OmegaConfBaseException) as error:
            complain("fractal-sweep", error)
        except Exception:
            print(shown(traceback.format_exc()), file=sys.stderr)
            raise SystemExit(1) from None


opened: list[RunningSweep] = []  # by Hydra's callback, which can return nothing


def close(status: int) -> int:
    """End the sweep that was opened, if one was; the exit status of the command, at least `status`."""
    while opened:
        try:
            status = opened.pop().close(status)
        except (InputError, OSError) as error:  # the tables could not be written: a full disk
            reason = explain(error) if isinstance(error, OSError) else error
            print(f"fractal-sweep: error: {reason}; the same command goes on", file=sys.stderr)
            status = 2
    return status


class RunningSweep:
    """One sweep: its jobs, its folder, its parent run."""

    def __init__(self, config: DictConfig) -> None:
        """Plan the jobs of `config`, start the parent run and write into `config` what the jobs need to know.

        Raises `InputError` if the store cannot be used or nothing varies, and what Hydra raises if a job's words are
        wrong.
        """
        _take_picture(config)
        overrides, self.keys = planned(config)
        self.names = [job_name(job, self.keys) for job in overrides]
        self.settings = settings = _common(config)
        self.folder = make_folder(Path(settings["output"]) / settings["study"] / _folder_name(settings))
        for name in self.names:  # what is there from now on is news
            Outcome.path(self.folder / name).unlink(missing_ok=True)
        runs: NoRuns = configuration.build(config.tracking)
        self.run: Tracker = runs.start_sweep(settings, self.folder, config.hydra.overrides.task)
        self.run.artifact(JOBS, json.dumps(self.names, indent=1))
        self.run.artifact("sweep.json", json.dumps(settings["sweep"], indent=1))
        self.run.artifact("config.yaml", OmegaConf.to_yaml(settings))
        facts = {"folder": self.folder.name, "run": self.run.run_id or "null",
                 "parent": str(os.getpid()) if config.sweep.tied else "null",
                 "varies": f"[{','.join(json.dumps(key) for key in self.keys)}]"}
        with read_write(config), open_dict(config):
            config.hydra.overrides.task.extend([f"output={json.dumps(config.output)}",
                                                *(f"sweep.{key}={value}" for key, value in facts.items())])
        print(f"{settings['sweep']['title']}: {len(self.names)} jobs, {settings['scale']} scale, "
              f"{settings['sweep']['workers']} at a time; {self.folder}", flush=True)
        left = [job for name, job in zip(self.names, overrides, strict=True)
                if not (self.folder / name / "finished.json").exists()]
        if said := cost.estimate(_by_method(config, left), settings["sweep"]["workers"]):
            print(f"  {said}, on {settings['device']}", flush=True)
        self.watch = Watch(self.folder, self.names)
        self.watch.start()

    def close(self, status: int) -> int:
        """Stop watching, make the tables, end the parent run; the exit status, at least `status`."""
        self.watch.stop()
        outcomes = {name: Outcome.read(self.folder / name) for name in self.names}
        failed = {name: outcome for name, outcome in outcomes.items() if outcome and outcome.status == FAILED}
        absent = [name for name, outcome in outcomes.items() if outcome is None]
        if self.run.run_id is not None:
            mark_killed_runs(prepare_store(Path(self.settings["output"])))
            if len(absent) < len(self.names):
                self._write_tables(Path(self.settings["output"]), self.settings["study"])
        print(f"\n{len(self.names) - len(failed) - len(absent)} of {len(self.names)} jobs finished"
              + "".join(f"; {len(some)} {what}" for some, what in ((failed, "failed"), (absent, "without a result"))
                        if some))
        for name, outcome in failed.items():
            print(f"  failed: {name}: {outcome.reason}\n    {self.folder / name / 'log.txt'}")
        if absent:
            print("  the same command again goes on with those that have no result")
        error = f"{len(failed)} jobs failed, {len(absent)} without a result" if failed or absent else None
        self.run.finish("KILLED" if status == 130 else "FAILED" if error else "FINISHED", error)
        return status or int(bool(error))

    def _write_tables(self, output: Path, study: str) -> None:
        """Report on what is done: files into the folder, the same onto the parent run."""
        uri = store_uri(output)
        sweep = report.read_sweep(uri, study, self.run.run_id)
        for path in write(uri, sweep, self.folder):
            self.run.artifact(f"report/{path.name}", path)
        self.run.table("summary.json", report.summary(sweep))
        print(f"\n{(self.folder / 'report.md').read_text()}")
        if not os.environ.get("MLFLOW_TRACKING_URI"):
            print(f"dashboard: {dashboard_line(output)}, then")
        print(f"  {comparison_address(uri, study, sweep.run_id)}\ntables and figure: {self.folder}/report.*")


class Watch(threading.Thread):
    """Prints each outcome as soon as it lies in its job's folder, whatever launcher put it there."""

    def __init__(self, folder: Path, names: Sequence[str]) -> None:
        super().__init__(name="sweep watch", daemon=True)
        self.folder, self.waiting, self.total = folder, list(names), len(names)
        self.out = sys.stdout  # a job in this process sends sys.stdout elsewhere
        self.began, self.fitted = time.monotonic(), 0  # jobs that took time
        self._end = threading.Event()

    def run(self) -> None:
        while not self._end.wait(POLL_SECONDS):
            self.look()

    def stop(self) -> None:
        """Look a last time and end."""
        self._end.set()
        self.join()
        self.look()

    def look(self) -> None:
        """Print what is new."""
        for name in self.waiting[:]:
            outcome = Outcome.read(self.folder / name)
            if outcome is not None:
                self.waiting.remove(name)
                self._print(outcome)

    def _print(self, outcome: Outcome) -> None:
        done = self.total - len(self.waiting)
        text = f"  {done:{len(str(self.total))}}/{self.total}  {outcome.row}, {outcome.sample}: "
        if outcome.status == FAILED:
            text += f"FAILED\n{outcome.traceback}"
        elif outcome.again:
            text += f"{describe_scores(outcome)}  (finished before)"
        else:
            self.fitted += 1
            left = (time.monotonic() - self.began) / self.fitted * len(self.waiting)
            about = f", about {in_words(left)} left" if left else ""
            text += f"{describe_scores(outcome)}  ({outcome.seconds:.0f} s{about})"
        print(text, file=self.out, flush=True)


def _take_picture(config: DictConfig) -> None:
    """With picture=FILE a study no longer varies its target, nor has settings of another one."""
    given = [word.split("=", 1)[0].lstrip("+") for word in config.hydra.overrides.task]
    if "picture" not in given:
        return
    with read_write(config), open_dict(config):
        for key in [key for key in config.hydra.sweeper.params or () if str(key).startswith("target.")]:
            del config.hydra.sweeper.params[key]
        for key, value in configuration.plain(config.target).items():
            if key not in ("_target_", *signature(Picture).parameters) and f"target.{key}" not in given:
                # With its value, since Hydra's sweeper writes every override as KEY=VALUE.
                config.hydra.overrides.task.append(f"~target.{key}={json.dumps(value)}")


def planned(config: DictConfig) -> tuple[list[list[str]], list[str]]:
    """The overrides of every job as Hydra's basic sweeper makes them, and the keys that vary.

    The first job is composed, and one for each other value of each key, so that Hydra refuses a wrong one before there
    is a run or a folder. The sweeper composes all, when they are launched.
    """
    loader = GlobalHydra.instance().config_loader()
    lines = [f"{key}={value}" for key, value in (config.hydra.sweeper.params or {}).items()]
    parsed = OverridesParser.create(config_loader=loader).parse_overrides([*lines, *config.hydra.overrides.task])
    values = {override.get_key_element(): [*override.sweep_string_iterator()] if override.is_sweep_override() else
              [override.get_value_element_as_str()] for override in parsed}
    keys = [*dict.fromkeys([*(line.split("=", 1)[0] for line in lines),
                            *(override.get_key_element() for override in parsed if override.is_sweep_override())])]
    if not keys:
        raise InputError("nothing varies; give a key several values: seed=0,1,2")
    jobs = [[f"{key}={value}" for key, value in zip(values, job, strict=True)]
            for job in itertools.product(*values.values())]
    if not jobs:
        raise InputError(f"{next(key for key, given in values.items() if not given)} has no value to try")
    for i, key in enumerate(values):
        for value in values[key][min(i, 1):]:
            loader.load_sweep_config(config, [*jobs[0][:i], f"{key}={value}", *jobs[0][i + 1:]])
    return jobs, keys


def _by_method(config: DictConfig, jobs: Sequence[list[str]]) -> dict[str, tuple[int, DictConfig]]:
    """How many of the jobs are of each method, and the configuration of one of them."""
    loader, choice = GlobalHydra.instance().config_loader(), config.hydra.runtime.choices.method
    names = [next((word[7:] for word in job if word.startswith("method=")), choice) for job in jobs]
    return {name: (names.count(name), loader.load_sweep_config(config, jobs[names.index(name)]))
            for name in dict.fromkeys(names)}


def _common(config: DictConfig) -> dict[str, Any]:
    """What is common to all jobs, as plain data; what is left open in it stays '???'."""
    with read_write(config):
        config.output = str(Path(config.output).expanduser().absolute())
    common = OmegaConf.masked_copy(config, [str(key) for key in config if key not in ("hydra", "sweep")])
    # Rows and samples differ from job to job: here they are patterns.
    sweep = configuration.plain(config.sweep)
    for key in ("title", "baseline", "published", "workers", "count"):
        sweep[key] = config.sweep[key]
    return configuration.plain(common, resolve=True) | {"sweep": sweep}


def _folder_name(settings: dict[str, Any]) -> str:
    """The same for the same sweep, however many jobs it has and however they are launched."""
    identity = {key: value for key, value in settings.items() if key not in NOT_PART_OF_A_FIT or key == "evaluation"}
    return f"{settings['scale']}-{hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:6]}"
