"""Trials of stores in the making, in processes forked from this one so that MLflow is imported once.

    python store_trials.py kills|disks FOLDER COUNT SEED     prints a JSON line {"tried": …, "failures": […]}
"""

import contextlib
import io
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

from fractal_exp import InputError, tracking
from fractal_exp.tracking import store

SIGNALS = (signal.SIGKILL, signal.SIGINT, signal.SIGTERM)
REFUSED, CRASHED = 2, 1
store.PATIENCE = 2.0


def make(folder: Path) -> None:
    tracking.prepare_store(folder)


def use(folder: Path) -> None:
    """What every command does first: it must work after whatever came before."""
    uri = tracking.prepare_store(folder)
    with tracking.start_run(uri, "study", "run", folder=folder) as run:
        run.log({"eval/f1": 0.5})
        run.artifact("code.json", "{}")
    frame = tracking.runs_frame(uri, "study")
    assert list(frame["status"]) == ["FINISHED"] and frame["metrics.eval/f1"][0] == 0.5, frame
    assert tracking.read_artifact(uri, run.run_id, "code.json") == b"{}"
    assert {path.name for path in folder.iterdir()} <= {
        "mlflow.db", "mlflow.db-wal", "mlflow.db-shm", "mlflow.db.lock", "mlartifacts"}, list(folder.iterdir())


def fork(work, folder: Path, limit: int | None = None) -> int:
    """A child that does `work`, with at most `limit` bytes a file; it tells what went wrong in FOLDER.log."""
    if pid := os.fork():
        return pid
    status, said = 0, io.StringIO()
    with contextlib.redirect_stderr(said):
        try:
            if limit is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
            work(folder)
        except InputError as error:
            status = REFUSED
            print(f"error: {error}", file=said)
        except BaseException as error:
            status = CRASHED
            print(f"{type(error).__name__}: {error}", file=said)
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    folder.with_suffix(".log").write_text(said.getvalue())
    os._exit(status)


def wait(pid: int) -> int:
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])


def kill_while_made(folder: Path, rng: random.Random, seconds: float) -> tuple[int, str]:
    """One to three processes make one store and are interrupted one after another; how often, and what then fails."""
    makers = [fork(make, folder) for _ in range(rng.randint(1, 3))]
    for pid in makers:
        time.sleep(rng.uniform(0, 1.1 * seconds / len(makers)))
        os.kill(pid, rng.choice(SIGNALS))
    for pid in makers:
        wait(pid)
    status = wait(fork(use, folder))
    return len(makers), status and folder.with_suffix(".log").read_text()


def fill_while_made(folder: Path, rng: random.Random) -> tuple[int, str]:
    """A store is made where a file may not grow beyond some size; it says so in one line, and works with room."""
    status = wait(fork(use, folder, rng.randrange(0, 1_200_000)))
    return 1, judge_full(status, folder, lambda: None)


def fill_tmpfs(folder: Path, rng: random.Random) -> tuple[int, str]:
    """The same on a small file system of its own."""
    folder.mkdir(parents=True)
    subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={rng.randrange(4, 1300)}k", "tmpfs", folder], check=True)
    try:
        status = wait(fork(use, folder))
        return 1, judge_full(status, folder, lambda: subprocess.run(
            ["mount", "-o", "remount,size=50m", folder], check=True))
    finally:
        subprocess.run(["umount", folder], check=True)


def judge_full(status: int, folder: Path, make_room) -> str:
    said = folder.with_suffix(".log").read_text()
    errors = [line for line in said.splitlines() if not line.startswith("tracking: ")]
    clear = len(errors) == 1 and errors[0].startswith("error: ") and "make room" in errors[0]
    if status and not (status == REFUSED and clear):
        return f"full: {said}"
    make_room()
    if status == REFUSED and (status := wait(fork(use, folder))):
        return f"with room: {folder.with_suffix('.log').read_text()}"
    return ""


def can_mount(folder: Path) -> bool:
    folder.mkdir(parents=True)
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=100k", "tmpfs", folder], capture_output=True)
    return done.returncode == 0 and subprocess.run(["umount", folder], check=True) is not None


def main() -> None:
    kind, folder, count, seed = sys.argv[1], Path(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
    rng, tried, failures = random.Random(seed), 0, []
    make(folder / "warm")  # imports all that it takes, before the forks
    begin = time.monotonic()
    wait(fork(make, folder / "whole"))
    seconds = time.monotonic() - begin
    trials = {"kills": [lambda *args: kill_while_made(*args, seconds)],
              "disks": [fill_while_made, *([fill_tmpfs] if can_mount(folder / "tmpfs") else [])]}[kind]
    number = 0
    while tried < count:
        number += 1
        done, failure = trials[number % len(trials)](folder / f"{kind}{number}", rng)
        tried += done
        if failure:
            failures.append(f"{kind}{number}: {failure}")
    print(json.dumps({"tried": tried, "failures": failures, "kinds": len(trials), "seconds": seconds}))


if __name__ == "__main__":
    main()
