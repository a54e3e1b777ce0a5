"""What a fit tells while it works: a progress bar on the terminal, series and previews in the run."""

from __future__ import annotations

import sys
import time
from collections import deque
from typing import Self

from ..images.pixels import write_image
from ..methods.base import Progress
from ..runtime.bars import progress_bar
from ..runtime.deadline import in_words
from ..tracking import Tracker
from . import interruption
from .folders import FitFolder

QUIET_SECONDS = 30       # between two lines where the output is no terminal
WINDOW = 120             # seconds over which the speed is taken
SETTLED = 10             # seconds before there is an estimate


class Reporter:
    """An `on_step` that draws a bar with stage, loss or error and time left, and logs every step.

    On a terminal it is one line that changes; in a file a new line now and then.
    """

    def __init__(self, run: Tracker, folder: FitFolder):
        self.run, self.folder, self.left = run, folder, TimeLeft()

    def __enter__(self) -> Self:
        self.terminal = sys.stdout.isatty()
        self.bar = progress_bar(total=100, file=sys.stdout, leave=True, disable=not self.terminal, mininterval=0.5,
                                bar_format="  {percentage:3.0f}%|{bar:20}| {elapsed}{postfix}")
        self.began = self.printed = time.monotonic()
        return self

    def __exit__(self, *error: object) -> None:
        self.bar.close()

    def __call__(self, progress: Progress) -> None:
        interruption.check()
        now = time.monotonic()
        text = describe(progress, self.left(now - self.began, progress.fraction))
        self.bar.n = round(100 * progress.fraction, 2)
        self.bar.set_postfix_str(text, refresh=False)
        self.bar.update(0)
        if not self.terminal and (now - self.printed > QUIET_SECONDS or progress.fraction >= 1):
            if self.printed < now:
                print(f"  {100 * progress.fraction:3.0f}% after {in_words(now - self.began)}, {text}", flush=True)
            self.printed = float("inf") if progress.fraction >= 1 else now
        self.run.log({f"train/{name}": value for name, value in progress.scalars.items()}, progress.step)
        if progress.preview is not None:
            write_image(self.folder.views / "preview.png", progress.preview)
            self.run.image("preview", progress.preview, progress.step)


def describe(progress: Progress, left: float | None) -> str:
    """Time left, stage and what is being improved, in words."""
    parts = [f"about {in_words(left)} left" if left is not None else "", progress.describe()]
    return ", ".join(part for part in parts if part)


class TimeLeft:
    """Seconds to the end, by the speed of the last two minutes, in which a stage that takes longer than was expected
    counts for what it is; it is not told before there is something to go by, nor while nothing moves."""

    def __init__(self) -> None:
        self.seen: deque[tuple[float, float]] = deque()

    def __call__(self, seconds: float, fraction: float) -> float | None:
        """After this time, with this fraction of the work done."""
        if not self.seen or fraction > self.seen[-1][1]:
            self.seen.append((seconds, fraction))
        while len(self.seen) > 2 and seconds - self.seen[1][0] > WINDOW:
            self.seen.popleft()
        (start, before), (last, done) = self.seen[0], self.seen[-1]
        if last - start < SETTLED or fraction >= 1 or seconds - last > WINDOW:
            return None
        # While a step or a stage overruns, what was foreseen at its last news is counted down, not up.
        return max(0.0, (1 - done) * (last - start) / (done - before) - (seconds - last)) or None
