"""Where a session of the studio stands: what is known of its picture and of its code. Nothing here takes long."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

from ..errors import InputError
from ..ifs.code import IFS
from ..images.levels import decided
from ..images.pixels import png
from ..images.reading import ReadImage
from ..inversion import Inversion
from ..methods.base import CurvePoint
from .keeping import Folder, State, plain
from .reading import Picture, Reading
from .tasks import Settings

SEARCHES = "find", "polish"
MOST_PAST = 50   # codes that are kept to go back to


class Standing:
    """offers: sessions that ended with something unsaved, the newest first."""

    def __init__(self, offers: list[Folder]):
        self.offers = offers
        self.ready = self.stopping = self.can_go_on = self.polishing = False
        self.task = ""                        # "find", "polish", "judge", "read", "save", or nothing
        self.picture: Picture | None = None
        self.version = {"picture": 0, "code": 0}
        self.code: IFS | None = None          # without colours; they belong to what is known of it
        self.mark = ""                        # of the page whose hands made the code
        self.likeness: float | None = None    # F1 within a pixel of `code`, the one figure that is shown
        self.found: Inversion | None = None   # what is known of `code`, once it was judged
        self.judged = 0                       # the version of the code that was judged last
        self.curve: tuple[CurvePoint, ...] = ()
        self.past: list[IFS] = []
        self.ahead: list[IFS] = []
        self.seconds = 0.0                    # of the searches of this picture that led to the code
        self.settings = Settings()
        self.saved: dict[str, Any] = {}
        self.why = ""

    def facts(self) -> dict[str, Any]:
        """Where the session stands, as plain data."""
        found, verdict, likeness = self.found, self.found and self.found.verdict, self.likeness
        return {
            "told": "state", "ready": self.ready, "task": self.task, "stopping": self.stopping, "why": self.why,
            "picture": self.picture and self.picture.facts(), "version": dict(self.version),
            "code": None if self.code is None else plain(self.code), "mark": self.mark, "likeness": likeness,
            "coloured": found is not None and found.code.colours is not None,
            "apart": found and found.likeness.colour, "judged": found is not None,
            "dimension": found.dimension if found else "", "verdict": verdict and {
                "kind": verdict.kind, "words": verdict.words, "change": self._change(),
                "remedy": "" if verdict.change else verdict.remedy},  # what is an argument is no action of the page
            "can_go_on": self.can_go_on, "saved": self.saved, "settings": self.settings.model_dump(),
            "curve": [{"maps": each.maps, "likeness": each.likeness} for each in self.curve],
            "back": bool(self.past), "forth": bool(self.ahead),
            "offer": self.offers[0].about if self.offers and self.picture is None else None,
        }

    def image(self, which: str) -> Callable[[], bytes] | None:
        """What makes the PNG "target" or "given" of the picture, or "redrawn", the code in its colours; None where
        there is none. It takes a while."""
        picture, found = self.picture, self.found
        if which == "redrawn" and found is not None and found.code.colours is not None:
            return lambda: png(found.redrawn(colour=True))
        if which in ("target", "given") and picture is not None:
            return partial(getattr, picture, f"{which}_png")
        return None

    def _know(self, found: Inversion) -> None:
        self.found, self.likeness, self.judged = found, found.likeness.f1_1px, self.version["code"]

    def _show(self, code: IFS | None) -> None:
        self.code = code
        self.version["code"] += 1
        self._forget()

    def _forget(self) -> None:
        """What was known of the code before."""
        self.likeness = self.found = None
        self.saved, self.why, self.mark = {}, "", ""

    def _step(self) -> None:
        """From here on another code will come: keep the way back."""
        if self.code is not None:
            self.past = [*self.past, self.code][-MOST_PAST:]
        self.ahead = []

    def _change(self) -> dict[str, Any]:
        """What the verdict proposes to change, if the studio can."""
        change = {} if self.found is None else dict(self.found.verdict.change)
        try:
            kind = Reading if change.keys() <= Reading.model_fields.keys() else Settings
            kind(**change)
        except InputError:
            return {}
        return change

    def _target(self) -> ReadImage:
        """What is searched and what codes are compared to, the same for both."""
        read, levels = self._picture().read, self.settings.levels
        return read if levels == "auto" else replace(read, levels=decided(levels, read.image))

    def _picture(self) -> Picture:
        if self.picture is None:
            raise InputError("there is no picture yet; drop one first")
        return self.picture

    def _state(self) -> State:
        picture = self._picture()
        return State.of(picture=picture.path.name, name=picture.name, reading=picture.reading.model_dump(),
                        settings=self.settings.model_dump(), seconds=self.seconds, polishing=self.polishing,
                        goes_on=self.can_go_on or self.task in SEARCHES, past=list(map(plain, self.past)),
                        ahead=list(map(plain, self.ahead)))
