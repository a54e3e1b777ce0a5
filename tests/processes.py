"""Processes that a test starts, and waits for on a machine that may be busy."""

from __future__ import annotations

import contextlib
import subprocess
import time
from collections.abc import Callable
from typing import TypeVar

import psutil

SECONDS, LEAST = 120, 1  # a process that is not stuck gets a second of a processor in so many by the clock

Found = TypeVar("Found")


class Patience:
    """It lasts as long as a process and its children work, however slowly: `ends` says whether it is over."""

    def __init__(self, process: subprocess.Popen) -> None:
        self.process, self.used, self.next = psutil.Process(process.pid), 0.0, time.monotonic() + SECONDS

    def ends(self) -> bool:
        if time.monotonic() < self.next:
            return False
        before, self.used, self.next = self.used, 0.0, time.monotonic() + SECONDS
        for each in (self.process, *self.process.children(recursive=True)):
            with contextlib.suppress(psutil.NoSuchProcess):
                self.used += sum(each.cpu_times()[:4])  # of its own, and of its children that have ended
        return self.used < before + LEAST


def wait_for(condition: Callable[[], Found], what: str, process: subprocess.Popen) -> Found:
    """The first result of the condition that is true, while the process runs and works."""
    patience = Patience(process)
    while not (found := condition()):
        if process.poll() is not None or patience.ends():
            process.kill()
            raise AssertionError(f"{what} in vain: {process.communicate()}")
        time.sleep(0.01)
    return found


def end_of(process: subprocess.Popen) -> tuple[str, str]:
    """What a process has written to its output and as errors, once it has ended."""
    patience = Patience(process)
    while True:
        try:
            return process.communicate(timeout=1)
        except subprocess.TimeoutExpired:
            if patience.ends():
                process.kill()
                raise AssertionError(f"it is stuck: {process.communicate()}") from None
