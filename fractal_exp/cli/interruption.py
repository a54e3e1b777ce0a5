"""Ctrl-C, SIGTERM and the end of the terminal end what runs, even where code that was called from C swallows the
exception."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Iterator

from ..errors import InputError

HANGUP = getattr(signal, "SIGHUP", None)  # Windows has none

_asked, _answer = False, ""
_terminals: list[int] = []  # those of the two outputs that are one


def listen(answer: str = "") -> None:
    """Let SIGINT, SIGTERM and SIGHUP raise KeyboardInterrupt, and remember that they came. answer: printed at once,
    where there is more to do before the end."""
    global _asked, _answer
    _asked, _answer = False, answer
    _terminals[:] = filter(os.isatty, (1, 2))
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    if HANGUP and signal.getsignal(HANGUP) is not signal.SIG_IGN:  # as nohup has it
        signal.signal(HANGUP, _interrupt)


def check() -> None:
    """Raise KeyboardInterrupt if a signal came and its exception got lost."""
    if _asked:
        raise KeyboardInterrupt


@contextlib.contextmanager
def not_lost() -> Iterator[None]:
    """Raise KeyboardInterrupt instead of another error that comes after a signal.

    A library that is interrupted may fail in its own cleanup, and that error takes the interruption's place. An
    `InputError` stays: it says why a checkpoint could not be saved.
    """
    try:
        yield
    except InputError:
        raise
    except Exception:
        check()
        raise


def _interrupt(number: int, _: object) -> None:
    global _asked
    if number == HANGUP:  # nothing can be printed there any more
        nowhere = os.open(os.devnull, os.O_WRONLY)
        for terminal in _terminals:
            os.dup2(nowhere, terminal)
        if _asked:  # the shell says it as well, while what was found is being written
            return
    if _answer and not _asked:
        os.write(2, f"\n{_answer}\n".encode())  # the interrupted code may be in the middle of a print
    _asked = True
    raise KeyboardInterrupt
