"""How numba kernels are compiled here."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any

from numba import njit

# All that reorders sums and fuses products, but NaN and infinity keep their meaning.
FAST = {"reassoc", "contract", "arcp", "nsz"}
# The same without reordering: which order LLVM takes differs between a process that compiles a kernel and one that
# loads it, in the last bit, and a search that branches on it ends elsewhere.
FUSED = FAST - {"reassoc"}

_ONE_AT_A_TIME = threading.Lock()


def kernel(**options: Any) -> Callable[[Callable], Callable]:
    """Compile at the first call, without the GIL, and keep the machine code between processes where that can be.

    numba looks for a folder that can be written beside the source and then in the user's cache. Calls are let in one
    at a time: numba's plainest threading layer aborts the process when two threads enter it.
    """
    def compile_lazily(function: Callable) -> Callable:
        try:
            compiled = njit(function, cache=True, nogil=True, **options)
        except RuntimeError:  # no folder can be written: compile in every process
            compiled = njit(function, nogil=True, **options)

        @functools.wraps(function)
        def call(*arguments: Any) -> Any:
            try:
                with _ONE_AT_A_TIME:
                    return compiled(*arguments)
            except SystemError as error:
                cause: BaseException | None = error
                while isinstance(cause, SystemError):
                    cause = cause.__cause__
                if isinstance(cause, KeyboardInterrupt):  # Ctrl-C in numba's own few lines around a kernel
                    raise cause from None
                raise
        return call
    return compile_lazily
