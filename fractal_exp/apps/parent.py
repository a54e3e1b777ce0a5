"""A worker ends with the process that gave it work."""

from __future__ import annotations

import os
import threading
import time

POLL_SECONDS = 1.0
ORPHANED = 143  # the exit status of a process that SIGTERM ended
_followed: set[int] = set()


def follow(pid: int | None) -> None:
    """End this process, whatever it does, within seconds after its parent `pid` is gone; None: live on.

    A fit may be cut off at any moment and goes on from its checkpoint, so nothing is tidied up: what hangs could not
    be. Does nothing in the process `pid` itself, where a launcher runs jobs in place.
    """
    if pid in (None, os.getpid()) or pid in _followed:
        return
    _followed.add(pid)
    threading.Thread(target=_watch, args=(pid,), name=f"follow {pid}", daemon=True).start()


def _watch(pid: int) -> None:
    while os.getppid() == pid:  # a process whose parent dies is given another
        time.sleep(POLL_SECONDS)
    os._exit(ORPHANED)
