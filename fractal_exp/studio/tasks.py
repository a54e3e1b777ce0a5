"""What the studio's worker process does, and what it tells of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch

from ..api import invert
from ..evaluation import metrics
from ..ifs.affine import from_code
from ..ifs.code import IFS
from ..images.reading import ReadImage
from ..inversion import Inversion, Work, conclude
from ..inversion.road import INTERRUPTED
from ..methods.base import CodeReconstruction, Progress
from ..methods.collage import given
from ..rendering.still import render
from ..runtime.checkpoint import Checkpoint

TELL_EVERY = 0.2   # seconds between two words of progress,
SHOW_EVERY = 1.0   # and between two codes within a stage, each of which is rendered
BY_HAND = "made by hand"


@dataclass(frozen=True)
class Told:
    """How far a search is: seconds that it took, seconds that are left (None: nobody knows yet), the stage in words,
    its fraction in [0,1], and the error of what it looks at."""

    seconds: float
    left: float | None
    stage: str
    fraction: float
    error: float | None = None


@dataclass(frozen=True)
class Best:
    """The best code so far, with F1 and IoU of what it draws, of all lit pixels."""

    code: IFS
    f1: float
    iou: float


@dataclass(frozen=True)
class Done:
    """The end of a task: what was found, None where nothing was; interrupted: whether the search can go on; why: what a
    user can mend, empty where all is well."""

    found: Inversion | None = None
    interrupted: bool = False
    why: str = ""


Tell = Callable[[Told | Best], None]


@dataclass(frozen=True, eq=False)
class Find:
    """Search the code of a picture, or go on with a search that was stopped.

    path: of the checkpoint; options: of `invert`; begin: "anew", "again" (from the checkpoint), or a code to improve.
    """

    picture: ReadImage
    path: Path
    options: Mapping[str, Any] = field(default_factory=dict)
    seconds: float | None = None
    begin: str | IFS = "anew"

    def run(self, tell: Tell) -> Done:
        """Search, and tell of it. Raises `InputError`, before any work, on options that `invert` refuses."""
        options = dict(self.options)
        if isinstance(self.begin, IFS):
            options |= given.OPTIONS
        checkpoint = Checkpoint(self.path, identity=options, resume=self.begin != "anew")
        if isinstance(self.begin, IFS):
            checkpoint.save(given.found_already(self.begin))
        try:
            found = invert(self.picture, seconds=self.seconds, on_step=_Telling(tell, self.picture, self.seconds),
                           keep_interrupted=True, checkpoint=checkpoint, **options)
        except KeyboardInterrupt:  # before there was any code
            return Done(interrupted=True)
        return Done(found, interrupted=found.stopped == INTERRUPTED)


@dataclass(frozen=True, eq=False)
class Judge:
    """Judge a code that somebody made, as `invert` judges those that it finds."""

    picture: ReadImage
    code: IFS

    def run(self, tell: Tell) -> Done:
        """The code with its likeness and its verdict."""
        found = conclude(Work(CodeReconstruction(self.code), stopped=BY_HAND), self.picture, name="hand")
        tell(Best(self.code, found.likeness.f1, found.likeness.iou))
        return Done(found)


Task = Find | Judge


class _Telling:
    """An `on_step` that tells how far a search is, each code that a stage ends with, and before there is one, now and
    then the best candidate."""

    def __init__(self, tell: Tell, picture: ReadImage, limit: float | None):
        self.tell, self.image, self.limit = tell, picture.image, limit
        self.began, self.last = time.monotonic(), -math.inf
        self.shown: IFS | None = None
        self.shown_at = -math.inf

    def __call__(self, progress: Progress) -> None:
        now = time.monotonic()
        code = progress.code or self._better(progress.candidate, now)
        if code is not None:
            self.shown, self.shown_at = code, now
            self.tell(best(code, self.image))
        elif now - self.last < TELL_EVERY:
            return
        self.last, seconds = now, now - self.began
        error = progress.scalars.get("error")
        self.tell(Told(seconds, seconds_left(seconds, progress.fraction, self.limit), progress.stage or "search",
                       progress.fraction, error if error is not None and math.isfinite(error) else None))

    def _better(self, candidate: IFS | None, now: float) -> IFS | None:
        """The candidate, if it is another one than is shown, and it is time to show it."""
        if candidate is None or now - self.shown_at < SHOW_EVERY:
            return None
        shown = self.shown
        return None if shown is not None and torch.equal(from_code(candidate), from_code(shown)) else candidate


def seconds_left(seconds: float, fraction: float, limit: float | None) -> float | None:
    """How long a search will go on: by its limit, or by the part of its work that is done."""
    if limit is not None:
        return max(0.0, limit - seconds)
    return seconds * (1 - fraction) / fraction if fraction > 0.02 else None


def best(code: IFS, image: Any) -> Best:
    """A code with the scores of what it draws, lit where the image (R,R) is, or not."""
    drawn = render(code, resolution=len(image))
    masks = [(each > 0).float()[None] for each in (drawn, image)]
    return Best(code, float(metrics.f1(*masks)), float(metrics.iou(*masks)))
