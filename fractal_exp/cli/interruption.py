"""Ctrl-C and SIGTERM end what runs, even where code that was called from C swallows the exception."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Iterator

from ..errors import InputError

_asked, _answer = False, ""


def listen(answer: str = "") -> None:
    """Let SIGINT and SIGTERM raise KeyboardInterrupt, and remember that they came. answer: printed at once, where
    there is more to do before the end."""
    global _asked, _answer
    _asked, _answer = False, answer
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)


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


def _interrupt(*_: object) -> None:
    global _asked
    if _answer and not _asked:
        os.write(2, f"\n{_answer}\n".encode())  # the interrupted code may be in the middle of a print
    _asked = True
    raise KeyboardInterrupt
