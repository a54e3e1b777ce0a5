"""A worker ends with the process that began the sweep."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable

import psutil

from ..tracking.store import is_alive

POLL_SECONDS = 1.0
ORPHANED = 143  # the exit status of a process that SIGTERM ended
_followed: set[int] = set()


def follow(pid: int | None) -> None:
    """End this process, whatever it does, within seconds after process `pid` of this machine is gone; None: live on.

    That is its parent, or with a launcher that has a server start its workers, an ancestor or none.

    A fit may be cut off at any moment and goes on from its checkpoint, so nothing is tidied up: what hangs could not
    be. Does nothing in the process `pid` itself, where a launcher runs jobs in place.
    """
    if pid in (None, os.getpid()) or pid in _followed:
        return
    _followed.add(pid)
    threading.Thread(target=_watch, args=(_alive(pid),), name=f"follow {pid}", daemon=True).start()


def _alive(pid: int) -> Callable[[], bool]:
    """A function that tells whether the process lives on."""
    if os.getppid() == pid:
        return lambda: os.getppid() == pid  # a process whose parent dies is given another
    try:
        process = psutil.Process(pid)
    except psutil.NoSuchProcess:
        return lambda: False
    return lambda: process.is_running() and is_alive(pid)  # a zombie is running, for psutil


def _watch(alive: Callable[[], bool]) -> None:
    while alive():
        time.sleep(POLL_SECONDS)
    os._exit(ORPHANED)
