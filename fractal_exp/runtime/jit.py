"""How numba kernels are compiled here."""

from __future__ import annotations

import contextlib
import functools
import logging
import threading
import time
from collections.abc import Callable
from typing import Any

from numba import njit

from .deadline import leave_out

# All that reorders sums and fuses products, but NaN and infinity keep their meaning.
FAST = {"reassoc", "contract", "arcp", "nsz"}
# The same without reordering: which order LLVM takes differs between a process that compiles a kernel and one that
# loads it, in the last bit, and a search that branches on it ends elsewhere.
FUSED = FAST - {"reassoc"}

log = logging.getLogger(__name__)
_ONE_AT_A_TIME, _OPEN = threading.Lock(), contextlib.nullcontext()


class ForgivingCache:
    """numba's cache of a function, but what cannot be read or written is said once and done without.

    A damaged index is emptied, so that the next process finds a cache again.
    """

    def __init__(self, cache: Any) -> None:
        self._cache = cache

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)

    def load_overload(self, *arguments: Any) -> Any:
        try:
            return self._cache.load_overload(*arguments)
        except Exception as error:  # unpickling what is damaged may raise anything
            _say_that_the_cache_is_useless(str(self._cache.cache_path), error)
        try:
            self._cache.flush()
        except OSError:
            pass  # it was said that it is useless

    def save_overload(self, *arguments: Any) -> None:
        try:
            self._cache.save_overload(*arguments)
        except Exception as error:
            _say_that_the_cache_is_useless(str(self._cache.cache_path), error)


@functools.cache
def _say_once(folder: str) -> None:
    log.warning("compiled kernels cannot be kept in %s, they are compiled again for this process; empty the folder, "
                "make room on its disk, or name another one in NUMBA_CACHE_DIR", folder)


def _say_that_the_cache_is_useless(folder: str, error: Exception) -> None:
    _say_once(folder)
    log.debug("numba's cache in %s: %r", folder, error)


def kernel(**options: Any) -> Callable[[Callable], Callable]:
    """Compile at the first call, without the GIL, and keep the machine code between processes where that can be.

    numba looks for a folder that can be written beside the source and then in the user's cache. Calls of parallel
    kernels are let in one at a time: numba's plainest threading layer aborts the process when two threads enter it.
    """
    gate = _ONE_AT_A_TIME if options.get("parallel") else _OPEN

    def compile_lazily(function: Callable) -> Callable:
        try:
            compiled: Any = njit(function, cache=True, nogil=True, **options)
            compiled._cache = ForgivingCache(compiled._cache)
        except RuntimeError:  # no folder can be written: compile in every process
            compiled = njit(function, nogil=True, **options)

        return functools.wraps(function)(called(compiled, gate))
    return compile_lazily


def called(compiled: Any, gate: contextlib.AbstractContextManager = _OPEN) -> Callable:
    """A compiled function as it is called: behind a gate, without what it compiles counting as work, and Ctrl-C in
    numba's own few lines around it comes out as KeyboardInterrupt."""
    def call(*arguments: Any) -> Any:
        try:
            with gate:
                known, start = len(compiled.overloads), time.process_time()
                answer = compiled(*arguments)
                if len(compiled.overloads) > known:
                    leave_out(time.process_time() - start)
                return answer
        except SystemError as error:
            cause: BaseException | None = error
            while isinstance(cause, SystemError):
                cause = cause.__cause__
            if isinstance(cause, KeyboardInterrupt):
                raise cause from None
            raise
    return call
