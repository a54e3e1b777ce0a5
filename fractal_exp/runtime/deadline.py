"""A limit of time, the shares of it that parts of the work may take, and times in words."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterable, Iterator
from contextvars import ContextVar
from itertools import takewhile
from typing import TypeVar

# Seconds of a core for a picture from elsewhere, where nobody gives a limit: with twice as many, one more of 64
# textbook pictures is recovered (benchmarks/results/pictures_textbook and pictures_textbook_120s).
USUAL = 60.0

UNITS = (("days", 86400), ("h", 3600), ("min", 60), ("s", 1))

Item = TypeVar("Item")

_compiling = 0.0   # processor seconds


def in_words(seconds: float) -> str:
    """A time in the largest unit of which there are two."""
    unit, size = next(((unit, size) for unit, size in UNITS if seconds >= 2 * size), UNITS[-1])
    return f"{seconds / size:.0f} {unit}"


def leave_out(seconds: float) -> None:
    """Let `core_seconds` not count these: a first run compiles its kernels for longer than many a search takes."""
    global _compiling
    _compiling += seconds


def core_seconds() -> float:
    """The time that the cores have worked for this process, in seconds, but for what is left out."""
    return time.process_time() - _compiling


class TimeIsUp(Exception):
    """Raised in the midst of work whose time is up."""


class Deadline:
    """So many seconds from now on; None: no limit. clock: what tells the time, in seconds; of: what they are of, in
    words."""

    def __init__(self, seconds: float | None = None, clock: Callable[[], float] = time.monotonic, of: str = ""):
        self.seconds, self._clock, self._start, self._of = seconds, clock, clock(), of

    @classmethod
    def usual(cls, worked: Callable[[], float] = core_seconds, clock: Callable[[], float] = time.monotonic) -> Deadline:
        """The limit where nobody gave one: `USUAL` seconds of a core, whatever else the machine does, but no less than
        half as many by the clock, however many cores work. worked: tells the seconds of all cores."""
        cores, start = worked(), clock()
        return cls(USUAL, lambda: min(worked() - cores, 2 * (clock() - start)), " of a core")

    @property
    def words(self) -> str:
        """The limit, as it is told to people."""
        return "no limit" if self.seconds is None else f"{self.seconds:g} s{self._of}"

    @property
    def used(self) -> float:
        """The share of the time that has passed; 0 without a limit, 1 if there is no time at all."""
        if self.seconds is None:
            return 0.0
        return (self._clock() - self._start) / self.seconds if self.seconds else 1.0

    @property
    def passed(self) -> bool:
        """Whether time is up."""
        return self.used >= 1

    def during(self, items: Iterable[Item]) -> Iterator[Item]:
        """One item after another, until time is up."""
        return takewhile(lambda _: not self.passed, items)

    def until(self, share: float) -> Deadline:
        """The deadline of what must end when this share of the time has passed."""
        part = Deadline(None if self.seconds is None else self.seconds * share, self._clock, self._of)
        part._start = self._start
        return part


NO_DEADLINE = Deadline()
_ending = ContextVar("_ending", default=NO_DEADLINE)


@contextlib.contextmanager
def ending(deadline: Deadline) -> Iterator[None]:
    """Let `check_time` raise `TimeIsUp` in what this block calls, however deep, once the deadline has passed."""
    token = _ending.set(deadline)
    try:
        yield
    finally:
        _ending.reset(token)


def check_time() -> None:
    """Raise `TimeIsUp` if this is called in a block of `ending` whose deadline has passed. Called where a code is
    drawn, which takes most of a search's time."""
    if _ending.get().passed:
        raise TimeIsUp
