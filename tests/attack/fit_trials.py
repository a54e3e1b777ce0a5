"""Trials of fits that are killed again and again, in processes forked from this one so that all is imported once.

    python fit_trials.py FOLDER COUNT SEED     prints a JSON line {"tried": …, "failures": […]}
"""

import contextlib
import json
import os
import random
import signal
import sys
import time
import traceback
from pathlib import Path

import mlflow.store.tracking.sqlalchemy_store  # noqa: F401  before the forks
from hydra import compose, initialize_config_module

from fractal_exp import IFS, tracking
from fractal_exp.cli import configuration, interruption
from fractal_exp.cli.train import fit

TINY = ["scale=smoke", "resolution=32", "evaluation.resolution=32", "evaluation.points_in_view=20000", "threads=1",
        "resume=true", "name=fit"]
METHODS = {"chaotic": ["method=chaotic", "iterations=120", "checkpoint_every=7", "anneal_every=3"],
           "collage": ["method=collage", "method.search.moves=12"]}
SIGNALS = (signal.SIGKILL, signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
MOST = 8  # kills of one fit


def start(config, folder: Path) -> int:
    if pid := os.fork():
        return pid
    status, config.output = 0, str(folder)
    interruption.listen()
    with open(folder.with_suffix(".log"), "a") as log, contextlib.redirect_stdout(log), contextlib.redirect_stderr(log):
        try:
            fit(config)
        except KeyboardInterrupt:
            status = 130
        except BaseException:
            traceback.print_exc()
            status = 1
    os._exit(status)


def ended(pid: int, seconds: float) -> int | None:
    """The exit status, or None if the process lives on for so long."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        done, status = os.waitpid(pid, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.005)
    return None


def series(folder: Path) -> dict[str, list[tuple[int, float]]]:
    """All series of the finished run, with every step as often as the store has it."""
    uri = f"sqlite:///{folder}/mlflow.db"
    runs = tracking.runs_frame(uri, "fits", "attributes.status = 'FINISHED'")
    assert len(runs) == 1, f"{len(runs)} finished runs"
    names = [name.removeprefix("metrics.") for name in runs if name.startswith("metrics.train/")]
    return {name: list(tracking.read_series(uri, runs["run_id"][0], name)[["step", "value"]].itertuples(index=False,
                                                                                                       name=None))
            for name in names}


def compared(pid: int) -> str:
    """What a child that compares has to say: the parent must not open a store before it forks."""
    status = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
    return "" if status == 0 else "differs"


def compare(folder: Path, whole: Path) -> str:
    if pid := os.fork():
        return compared(pid)
    try:
        code, expected = (IFS.load(each / "fits" / "fit" / "code.json") for each in (folder, whole))
        assert code.linear.equal(expected.linear) and code.offset.equal(expected.offset), "another code"
        found, expected = series(folder), series(whole)
        assert found.keys() == expected.keys(), (found.keys(), expected.keys())
        for name in expected:
            # A search tells the end of a stage at the step of its last move: two values, in either order.
            assert sorted(found[name]) == sorted(expected[name]), (
                name, set(found[name]) ^ set(expected[name]), len(found[name]), len(expected[name]))
        left = list((folder / "fits" / "fit").glob(".*.partial"))
        assert not left, left
    except BaseException:
        with open(folder.with_suffix(".log"), "a") as log:
            traceback.print_exc(file=log)
        os._exit(1)
    os._exit(0)


def main() -> None:
    folder, count, rng = Path(sys.argv[1]), int(sys.argv[2]), random.Random(int(sys.argv[3]))
    configuration.register()
    with initialize_config_module("fractal_exp.conf", version_base="1.3"):
        configs = {name: compose("train", [*TINY, *words]) for name, words in METHODS.items()}
    folder.mkdir(parents=True, exist_ok=True)
    seconds, tried, failures, number = {}, 0, [], 0
    for name, config in configs.items():
        for again in range(2):  # the second time is the one to measure: the first compiles
            begin = time.monotonic()
            status = ended(start(config, folder / (f"{name}" + again * "-whole")), 600)
            seconds[name] = time.monotonic() - begin
            assert status == 0, (folder / (f"{name}" + again * "-whole")).with_suffix(".log").read_text()
    while tried < count:
        name = list(METHODS)[number % len(METHODS)]
        here, kills, status, number = folder / f"{name}{number}", 0, None, number + 1  # until it has finished
        while status is None or status in (130, -signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT):
            pid = start(configs[name], here)
            wait = rng.uniform(0.1, 0.8) * seconds[name] if kills < min(MOST, count - tried) else 600
            status = ended(pid, wait)
            if status is None:
                os.kill(pid, rng.choice(SIGNALS))
                kills, status = kills + 1, ended(pid, 120)
        tried += kills
        if status or compare(here, folder / f"{name}-whole"):
            failures.append(f"{here.name} after {kills} kills: {here.with_suffix('.log').read_text()[-3000:]}")
    print(json.dumps({"tried": tried, "failures": failures, "seconds": seconds}))


if __name__ == "__main__":
    main()
