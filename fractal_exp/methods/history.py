"""The stages of a method's work, collected from what it tells while it works."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass

from ..ifs.code import IFS
from .base import OnStep, Progress

UNNAMED = "fit"  # a method without stages


@dataclass(frozen=True)
class StageRecord:
    """One stage of a method: its name and seconds, and what the method told last in it: the score that it lowers, the
    error of the rendering and the number of maps (None where the method does not tell)."""

    name: str
    seconds: float
    score: float | None = None
    error: float | None = None
    maps: int | None = None


class History:
    """An `on_step` that keeps a `StageRecord` of every stage and tells `others` what it is told.

    course: the seconds since it was made, the number of the step and the code, wherever the method handed one over. A
    stage ends where the method hands over its code, or where the next one begins.
    """

    def __init__(self, others: Sequence[OnStep] = ()):
        self.others = others
        self.course: list[tuple[float, int, IFS]] = []
        self._ended: list[StageRecord] = []
        self._last: Progress | None = None
        self._first = self._began = time.monotonic()

    def __call__(self, progress: Progress) -> None:
        if self._last is not None and progress.stage != self._last.stage:
            self._end(self._last)
        self._last = progress
        if progress.code is not None:
            self.course.append((self.seconds(), progress.step, progress.code))
            self._end(progress)
        for on_step in self.others:
            on_step(progress)

    def seconds(self) -> float:
        """Since it was made."""
        return time.monotonic() - self._first

    def stages(self) -> tuple[StageRecord, ...]:
        """All stages so far, the last one as it stands."""
        if self._last is not None:
            self._end(self._last)
        return tuple(self._ended)

    def _end(self, last: Progress) -> None:
        now = time.monotonic()
        told = {name: float(value) for name, value in last.scalars.items() if math.isfinite(value)}
        maps = len(last.code) if last.code is not None else told.get("maps")
        self._ended.append(StageRecord(last.stage or UNNAMED, now - self._began, told.get("score", told.get("loss")),
                                       told.get("error"), None if maps is None else int(maps)))
        self._last, self._began = None, now
