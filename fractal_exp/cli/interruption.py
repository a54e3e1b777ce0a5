"""Ctrl-C and SIGTERM end what runs, even where code that was called from C swallows the exception."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Iterator

from ..errors import InputError

_asked = False


def listen() -> None:
    """Let SIGINT and SIGTERM raise KeyboardInterrupt, and remember that they came."""
    global _asked
    _asked = False
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
    _asked = True
    raise KeyboardInterrupt
