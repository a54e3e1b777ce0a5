"""How many threads the two pools of this package, torch's and numba's, may use."""

from __future__ import annotations

import ctypes
import os
import threading

from ..errors import InputError


def available() -> int:
    """The number of cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def keep_idle_threads_quiet() -> None:
    """Let idle OpenMP threads spin for microseconds instead of milliseconds, whoever loaded OpenMP and when.

    Kernels and torch's operations take turns, each with threads of its own or, where torch came first, with the same
    ones. Threads that spin while they wait take the cores from those that work, and from other processes: a chaos game
    of 4 ms takes 30. Threads that sleep at once take longer to wake than small operations last.

    GNU's OpenMP reads the environment once, when it is loaded. If it is there already, what is left is its rule to
    spin a thousandth as long while it has more threads than there are cores: a second team of threads, which sleeps for
    good, sees to that.
    """
    os.environ["OMP_WAIT_POLICY"], os.environ["GOMP_SPINCOUNT"] = "passive", "1000"
    try:
        team = ctypes.CDLL(None).GOMP_parallel  # "start a team", of the OpenMP that is loaded for all to see
        nothing = ctypes.CDLL(None).free        # what the team does: free(NULL)
    except (AttributeError, OSError, TypeError):
        return  # none is loaded, or it is not GNU's
    started = threading.Event()

    def sleep_as_a_team() -> None:
        team(nothing, None, ctypes.c_uint(available()), ctypes.c_uint(0))
        started.set()
        threading.Event().wait()  # the team lasts as long as this thread, which leads it

    threading.Thread(target=sleep_as_a_team, name="idle OpenMP team", daemon=True).start()
    started.wait()


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
