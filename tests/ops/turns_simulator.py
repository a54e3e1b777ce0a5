"""numba's simulator of CUDA, with coroutines in the place of its threads.

The simulator starts a thread of Python for each thread of a GPU and polls them all, so that they mostly wait for the
interpreter's lock. Here the threads of a block take turns as far as the next barrier, in another order each time.
The orders are drawn from a seed, so that a barrier that is missing shows, and shows every time.
"""

from __future__ import annotations

import random
from types import SimpleNamespace
from typing import Any

import numpy as np
from greenlet import getcurrent, greenlet
from numba.cuda.simulator import kernel, kernelapi


class Turn(greenlet):
    """A thread of a GPU, which the simulator's `cuda` asks for its place."""

    def __init__(self, function: Any, block: tuple[int, ...], thread: tuple[int, ...], size: tuple[int, ...]):
        super().__init__(function)
        self.blockIdx, self.threadIdx = kernelapi.Dim3(*block), kernelapi.Dim3(*thread)
        x, y, z = thread
        self.thread_id = x + size[0] * (y + size[1] * z)

    def syncthreads(self) -> None:
        self.parent.switch()


class Turns:
    """A block of threads, in the place of the simulator's `BlockManager`."""

    def __init__(self, function: Any, grid: tuple[int, ...], size: tuple[int, ...], debug: bool):
        self.function, self.size = function, size

    def run(self, block: tuple[int, ...], *arguments: Any) -> None:
        """Run all threads to their end. What one raises is raised here."""
        live = [Turn(self.function, block, thread, self.size) for thread in np.ndindex(*self.size)]
        order = random.Random(0)
        order.shuffle(live)
        for thread in live:
            thread.switch(*arguments)
        while live := [thread for thread in live if not thread.dead]:
            order.shuffle(live)
            for thread in live:
                thread.switch()


def take_turns() -> None:
    """Let the simulator run kernels like this from now on."""
    kernel.BlockManager = Turns
    kernelapi.threading = SimpleNamespace(current_thread=getcurrent)
