"""The worker processes of `launch=joblib`: one that is killed takes only its own job with it."""

from __future__ import annotations

import copy
import json
import threading
from collections.abc import Callable
from typing import Any

from joblib.externals.loky import ProcessPoolExecutor
from joblib.externals.loky.process_executor import BrokenProcessPool
from joblib.parallel import ThreadingBackend, register_parallel_backend

KILLED = ("its process ended without a word: killed, perhaps since memory ran out (fewer at a time: sweep.workers=1); "
          "the same command goes on with it")


def use() -> None:
    """Let joblib run in these workers what it would run in loky's own, which all end when one of them is killed."""
    register_parallel_backend("loky", LoneWorkers)


class LoneWorkers(ThreadingBackend):
    """As many threads as workers, each with one process of its own, which is replaced when it dies.

    The new process is told which job the old one was at, in `sweep.lost`, and notes that the job failed.
    """

    uses_threads = False
    supports_sharedmem = False

    def configure(self, n_jobs: int = 1, parallel: Any = None, **options: Any) -> int:
        count = super().configure(n_jobs, parallel, **options)
        self._own, self._all, self._ending = threading.local(), [], False
        return count

    def submit(self, func: Any, callback: Callable[[Any], None] | None = None) -> Any:
        return super().submit(lambda: self._run(func), callback)

    def terminate(self) -> None:
        """End the processes, whatever they are at; the threads that wait for them end by that."""
        self._ending = True
        for process in self._all:
            process.shutdown(wait=False, kill_workers=True)
        super().terminate()

    def _run(self, func: Any) -> Any:
        try:
            return self._in_own_process(func)
        except BrokenProcessPool:
            if self._ending:
                raise
            return self._in_own_process(_lost(func))

    def _in_own_process(self, func: Any) -> Any:
        if getattr(self._own, "process", None) is None:
            self._own.process = ProcessPoolExecutor(1, timeout=None, env=self._prepare_worker_env(self._n_jobs))
            self._all.append(self._own.process)
        try:
            return self._own.process.submit(func).result()
        except BrokenProcessPool:
            self._own.process = None
            raise


def _lost(func: Any) -> Any:
    """The same call of Hydra's `execute_job(index, overrides, …)`, with an override that says that the job is lost."""
    again = copy.copy(func)
    (execute, (index, overrides, *rest), named), = func.items
    again.items = [(execute, (index, [*overrides, f"sweep.lost={json.dumps(KILLED)}"], *rest), named)]
    return again
