"""How many threads the two pools of this package, torch's and numba's, may use."""

from __future__ import annotations

import ctypes
import os
from pathlib import Path

import numpy as np

from ..errors import InputError

USUAL_SPINS = 300_000  # of GNU's OpenMP where the environment says nothing: some milliseconds
SPINS = 1000


def available() -> int:
    """The number of cores that this process may run on."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def keep_idle_threads_quiet() -> None:
    """Let idle threads of OpenMP spin for microseconds instead of milliseconds, whoever loaded OpenMP and when.

    Kernels and torch's operations take turns, each with threads of its own. Threads that spin while they wait take the
    cores from those that work, and from other processes: a chaos game of 4 ms takes 30. Threads that sleep at once take
    longer to wake than small operations last.

    GNU's OpenMP reads the environment once, when it is loaded. Where torch came first, it is loaded already and has no
    function to change its mind. Its own copy of the number is then changed in its memory.
    """
    os.environ["OMP_WAIT_POLICY"], os.environ["GOMP_SPINCOUNT"] = "passive", str(SPINS)
    for numbers in numbers_of_openmp():
        numbers[numbers == USUAL_SPINS] = SPINS


def numbers_of_openmp() -> list[np.ndarray]:
    """The variables (K,) uint64, in place, of each copy of GNU's OpenMP that is loaded. None but on Linux."""
    try:
        regions = [line.split() for line in Path("/proc/self/maps").read_text().splitlines()]
    except OSError:
        return []
    found = []
    for bounds, permissions, *_, file in regions:
        if "libgomp" in file and permissions.startswith("rw"):
            begin, end = (int(bound, 16) for bound in bounds.split("-"))
            memory = (ctypes.c_uint64 * ((end - begin) // 8)).from_address(begin)
            found.append(np.ctypeslib.as_array(memory))
    return found


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
