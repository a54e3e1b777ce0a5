"""What the studio's worker process does, and what it tells of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import torch
from pydantic import Field

from ..api import invert
from ..cameras.comparison import WITHIN_NOISE
from ..ifs.affine import from_code
from ..ifs.code import IFS
from ..images.levels import Levels
from ..images.painted import Painted
from ..images.reading import ReadImage
from ..inversion import Inversion, Work, coloured, conclude
from ..inversion.road import INTERRUPTED
from ..likeness import Likeness
from ..methods.base import CodeReconstruction, Progress
from ..methods.collage import given
from ..runtime.checkpoint import Checkpoint
from ..runtime.params import Params
from ..viewer.page import MOST_MAPS

TELL_EVERY = 0.2   # seconds between two words of progress,
SHOW_EVERY = 1.0   # and between two codes within a stage, each of which is measured,
MEASURE_SHARE = 10  # or so many times as many as the measuring took
BY_HAND = "made by hand"
MOST_SECONDS = 24 * 3600  # that a search may take


class Settings(Params):
    """What a search takes from a page."""

    seconds: Annotated[float, Field(ge=1, le=MOST_SECONDS)] | None = None
    maps: Annotated[int, Field(ge=2, le=MOST_MAPS)] | None = None
    levels: Levels = "auto"
    colour: bool = False


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
    """The best code so far, and how like the picture it is: measured as at the end, so that no figure falls there."""

    code: IFS
    likeness: Likeness

    @property
    def rank(self) -> tuple[bool, float]:
        """A code that explains the picture to its noise is better than one that does not; else F1 within a pixel says,
        which is the figure that is shown."""
        return self.likeness.noise_ratio < WITHIN_NOISE, self.likeness.f1_1px


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

    path: of the checkpoint; options: of `invert`; begin: "anew", "again" (from the checkpoint), or a code to improve;
    polishing: whether the search began with a code; beat: a code, and nothing worse is to come of the search; colour:
    whether the code gets the picture's colours.
    """

    picture: ReadImage
    path: Path
    options: Mapping[str, Any] = field(default_factory=dict)
    seconds: float | None = None
    begin: str | IFS = "anew"
    polishing: bool = False
    beat: IFS | None = None
    colour: bool = False

    def run(self, tell: Tell) -> Done:
        """Search, and tell of it. Raises `InputError`, before any work, on options that `invert` refuses."""
        options = {**self.options, **(given.OPTIONS if self.polishing else {})}
        if self.begin != "again":
            self.path.unlink(missing_ok=True)
        checkpoint = Checkpoint(self.path, identity=options, resume=self.begin != "anew")
        if isinstance(self.begin, IFS):
            checkpoint.save(given.found_already(self.begin))
        telling = _Telling(tell, self.picture, self.seconds, self.beat)
        try:
            found = invert(self.picture, seconds=self.seconds, on_step=telling, keep_interrupted=True,
                           checkpoint=checkpoint, colour=self.colour, **options)
        except KeyboardInterrupt:  # before there was any code
            return Done(interrupted=True)
        return Done(self._at_best(found, telling.best), interrupted=found.stopped == INTERRUPTED)

    def _at_best(self, found: Inversion, best: Best | None) -> Inversion:
        """What was found, with the best code that was seen on the way in its place where that is better."""
        if best is None or best.rank <= Best(found.code, found.likeness).rank:
            return found
        work = Work(CodeReconstruction(best.code, curve=found.curve), found.history, stopped=found.stopped,
                    seconds=found.seconds)
        return _concluded(work, self.picture, self.colour, name=found.method, options=found.options)


@dataclass(frozen=True, eq=False)
class Judge:
    """Judge a code that somebody made, as `invert` judges those that it finds. colour: as for `Find`."""

    picture: ReadImage
    code: IFS
    colour: bool = False

    def run(self, tell: Tell) -> Done:
        """The code with its likeness and its verdict."""
        return Done(_concluded(Work(CodeReconstruction(self.code), stopped=BY_HAND), self.picture, self.colour,
                               name="hand"))


def _concluded(work: Work, picture: ReadImage, colour: bool, **about: Any) -> Inversion:
    found = conclude(work, picture, **about)
    return coloured(found, Painted.of(picture)) if colour else found


Task = Find | Judge


class _Telling:
    """An `on_step` that tells how far a search is, and each code that is better than all before: of those that a stage
    ends with, and before there is one, now and then of the best candidates. To measure those takes a tenth of the time
    at most."""

    def __init__(self, tell: Tell, picture: ReadImage, limit: float | None, beat: IFS | None):
        self.tell, self.picture, self.limit = tell, picture, limit
        self.began, self.last = time.monotonic(), -math.inf
        self.measured: IFS | None = None
        self.next = -math.inf  # when a candidate is measured
        self.best = None if beat is None else self._measured(beat)

    def __call__(self, progress: Progress) -> None:
        now = time.monotonic()
        code = progress.code or self._candidate(progress.candidate, now)
        if code is not None:
            found = self._measured(code)
            if self.best is None or found.rank > self.best.rank:
                self.best = found
                self.tell(found)
        elif now - self.last < TELL_EVERY:
            return
        self.last, seconds = now, now - self.began
        error = progress.scalars.get("error")
        self.tell(Told(seconds, seconds_left(seconds, progress.fraction, self.limit), progress.stage or "search",
                       progress.fraction, error if error is not None and math.isfinite(error) else None))

    def _candidate(self, candidate: IFS | None, now: float) -> IFS | None:
        """The candidate, if it is another one than was measured last, and it is time to measure it."""
        if candidate is None or now < self.next:
            return None
        before = self.measured
        return None if before is not None and torch.equal(from_code(candidate), from_code(before)) else candidate

    def _measured(self, code: IFS) -> Best:
        began = time.monotonic()
        found = Best(code, Likeness.of(code, self.picture))
        self.measured, now = code, time.monotonic()
        self.next = now + max(SHOW_EVERY, MEASURE_SHARE * (now - began))
        return found


def seconds_left(seconds: float, fraction: float, limit: float | None) -> float | None:
    """How long a search will go on: by its limit, or by the part of its work that is done."""
    if limit is not None:
        return max(0.0, limit - seconds)
    return seconds * (1 - fraction) / fraction if fraction > 0.02 else None
