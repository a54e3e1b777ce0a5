"""A worker ends with the process that it works for, however that ended: nothing tells it of a SIGKILL.

    python -P parent.py PID COMMAND …     runs a command of others, and ends it with process PID
"""

from __future__ import annotations

import functools
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence

POLL_SECONDS = 1.0
ORPHANED = 143      # the exit status of a process that SIGTERM ended
CLOCK_SET = 5.0     # seconds by which a process may seem to have started at another time


def is_alive(pid: int, start: str | None = None) -> bool:
    """Whether process `pid` of this machine lives, and is the one that started at `start` (psutil's time, as text), as
    a number is given away again. A zombie counts as gone."""
    import psutil

    try:
        process = psutil.Process(pid)
        return process.status() not in (psutil.STATUS_ZOMBIE, psutil.STATUS_DEAD) and (
            start is None or abs(process.create_time() - float(start)) < CLOCK_SET)
    except (psutil.Error, ValueError):  # gone, or a tag of another version
        return False


@functools.cache
def follow(pid: int | None) -> None:
    """End this process, whatever it does, within seconds after process `pid` of this machine is gone; None: live on.

    A fit may be cut off at any moment and goes on from its checkpoint, so nothing is tidied up: what hangs could not
    be. Does nothing in the process `pid` itself, where a launcher runs jobs in place.
    """
    def wait(pid: int) -> None:
        while is_alive(pid):
            time.sleep(POLL_SECONDS)

    if pid is not None and pid != os.getpid():
        _end_after(functools.partial(wait, pid))


def follow_starter() -> None:
    """The same in a process of `multiprocessing`, with the one that started it. Does nothing in any other process."""
    starter = multiprocessing.parent_process()
    if starter is not None:
        _end_after(starter.join)


def following(command: Sequence[str]) -> list[str]:
    """A command of others that ends with this process, with all that it starts. It is to be started in a session of its
    own, and needs psutil."""
    return [sys.executable, "-P", __file__, str(os.getpid()), *command]


def _end_after(wait: Callable[[], object]) -> None:
    def watch() -> None:
        wait()
        os._exit(ORPHANED)

    threading.Thread(target=watch, daemon=True).start()


def _run(pid: int, command: Sequence[str]) -> int:
    with subprocess.Popen(command) as running:
        while is_alive(pid):
            try:
                return running.wait(POLL_SECONDS)
            except subprocess.TimeoutExpired:
                continue
        os.killpg(0, signal.SIGKILL)
        return ORPHANED


if __name__ == "__main__":
    sys.exit(_run(int(sys.argv[1]), sys.argv[2:]))
