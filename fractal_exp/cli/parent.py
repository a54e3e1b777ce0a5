"""A worker ends with the process that began the sweep: joblib's own would finish what they are at."""

from __future__ import annotations

import functools
import os
import threading
import time

from ..tracking.store import is_alive

POLL_SECONDS = 1.0
ORPHANED = 143  # the exit status of a process that SIGTERM ended


@functools.cache
def follow(pid: int | None) -> None:
    """End this process, whatever it does, within seconds after process `pid` of this machine is gone; None: live on.

    A fit may be cut off at any moment and goes on from its checkpoint, so nothing is tidied up: what hangs could not
    be. Does nothing in the process `pid` itself, where a launcher runs jobs in place.
    """
    if pid not in (None, os.getpid()):
        threading.Thread(target=_watch, args=(pid,), daemon=True).start()


def _watch(pid: int) -> None:
    while is_alive(pid):
        time.sleep(POLL_SECONDS)
    os._exit(ORPHANED)
