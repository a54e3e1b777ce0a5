"""How many threads the two pools of this package, torch's and numba's, may use."""

from __future__ import annotations

import os

from ..errors import InputError

# Idle threads of OpenMP spin for microseconds instead of milliseconds. Kernels and torch's operations take turns, each
# with threads of its own. Threads that spin while they wait take the cores from those that work, and from other
# processes. Threads that sleep at once take longer to wake than small operations last. OpenMP reads these variables
# once, when torch is imported.
QUIET = {"OMP_WAIT_POLICY": "passive", "GOMP_SPINCOUNT": "1000"}


def available() -> int:
    """The number of cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def use(count: int | None = None) -> int:
    """Give torch and numba `count` threads each (None: one per available core) and return the number.

    To be called once per process, before any work. Both pools work in turn, never at once, so they share the cores.
    Raises `InputError` unless 1 <= count <= the number of available cores.
    """
    cores = available()
    count = cores if count is None else count
    if not 1 <= count <= cores:
        raise InputError(f"threads must be between 1 and {cores}, the cores of this machine, got {count}")
    import numba
    import torch
    from numba.core import config

    most: int = config.NUMBA_NUM_THREADS  # pyright: ignore[reportAttributeAccessIssue]
    numba.set_num_threads(min(count, most))
    torch.set_num_threads(count)  # after numba, which sets all cores for both where they share an OpenMP library
    return count
