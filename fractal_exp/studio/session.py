"""Where a session of the studio stands: its picture, the search, the code; all tabs follow the same one.

Everything here happens in the server's event loop. What takes long is done in a thread or in the worker, and what
comes of it is told to whoever listens, as plain data.
"""

from __future__ import annotations

import asyncio
import math
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..ifs.code import IFS
from ..images.levels import MEANINGS
from ..inversion import Inversion, write
from ..methods.base import CurvePoint
from . import saving
from .reading import Picture, Reading, file_name, plain_name
from .tasks import Best, Done, Find, Judge, Told
from .worker import Ready, Word, Worker

MOST_SECONDS = 24 * 3600

WORK, CHECKPOINT = "session", "search.safetensors"   # in the output folder, while the studio runs

Hear = Callable[[dict[str, Any]], None]


class Session:
    """One session. output: the only folder that is written into; loop: the one in which all methods are called."""

    def __init__(self, output: Path, loop: asyncio.AbstractEventLoop):
        self.output, self.loop = output, loop
        self.work = saving.new_folder(output, WORK)
        self.ready = self.stopping = self.can_go_on = self.closing = False
        self.task = ""                        # "find", "polish", "judge", "read", "save", or nothing
        self.picture: Picture | None = None
        self.version = {"picture": 0, "code": 0}
        self.code: IFS | None = None
        self.scores: Best | None = None
        self.found: Inversion | None = None   # what is known of `code`, once it was judged
        self.curve: tuple[CurvePoint, ...] = ()
        self.seconds = 0.0                    # of the searches of this picture that led to the code
        self.settings: dict[str, Any] = {}
        self.limit: float | None = None
        self.saved: dict[str, str] = {}
        self.why = ""
        self.listeners: set[Hear] = set()
        self.worker = Worker(lambda word: loop.call_soon_threadsafe(self._hear, word))

    # What is told.

    def facts(self) -> dict[str, Any]:
        """Where the session stands, as plain data."""
        found, scores, code = self.found, self.scores, self.code
        return {
            "told": "state", "ready": self.ready, "task": self.task, "stopping": self.stopping, "why": self.why,
            "picture": self.picture and self.picture.facts(), "version": dict(self.version),
            "code": None if code is None else {
                "linear": code.linear.tolist(), "offset": code.offset.tolist(),
                "probabilities": None if code.probabilities is None else code.probabilities.tolist()},
            "scores": scores and {"f1": scores.f1, "iou": scores.iou},
            "likeness": None if found is None else found.likeness.f1_1px,
            "verdict": None if found is None else {
                "kind": found.verdict.kind, "words": found.verdict.words, "remedy": found.verdict.remedy},
            "can_go_on": self.can_go_on, "saved": self.saved,
            "curve": [{"maps": each.maps, "likeness": each.likeness} for each in self.curve],
        }

    def tell(self, **facts: Any) -> None:
        """Tell all tabs `facts`, or where the session stands."""
        words = facts or self.facts()
        for hear in list(self.listeners):
            hear(words)

    # What a page asks for. Each raises `InputError` on what cannot be.

    async def take(self, data: bytes, name: str) -> None:
        """A new picture, in place of the one before."""
        self._check_free("take another picture")
        name = plain_name(name)
        path = self.work / f"{self.version['picture'] + 1}-{file_name(name)}"
        await self._in_a_thread("read", partial(self._taken, data, path, name), self._begin_with)

    async def read(self, reading: Mapping[str, Any]) -> None:
        """The same picture, read otherwise."""
        self._check_free("read the picture anew")
        picture = self._picture()
        await self._in_a_thread("read", partial(picture.again, Reading.of(reading)), self._begin_with)

    def find(self, settings: Mapping[str, Any]) -> None:
        """Search from the beginning. settings: seconds, maps and levels, each may be None or absent."""
        self._check_free("search")
        self.settings, self.limit = _checked(settings)
        self.seconds = 0.0
        self._search("find", "anew", self.limit)

    def go_on(self) -> None:
        """Go on with a search that was stopped, for as long as its limit leaves."""
        self._check_free("search")
        if not self.can_go_on:
            raise InputError("there is no search that was stopped; begin one with Find")
        self._search("find", "again", None if self.limit is None else max(1.0, self.limit - self.seconds))

    def polish(self, settings: Mapping[str, Any]) -> None:
        """Improve the code as it is now."""
        self._check_free("search")
        if self.code is None:
            raise InputError("there is no code to begin with; find or import one first")
        if len(self.code) < 2:
            raise InputError("a code of one map draws a point; add maps before it is polished")
        self.settings, self.limit = _checked(settings)
        self.settings.pop("maps", None)  # the code has its own number
        self._search("polish", self.code, self.limit)

    def stop(self) -> None:
        """End the search with what it has."""
        if self.task not in ("find", "polish"):
            raise InputError("no search is going on")
        self.stopping = True
        self.worker.stop()
        self.tell()

    def edit(self, data: Any) -> None:
        """Take another code, made by hand, and judge it as soon as nothing else is done."""
        if self.task in ("find", "polish"):
            raise InputError("a search is going on; stop it before the maps are changed")
        self._picture()
        self._show(IFS.from_json(data).check_contractive())
        self._judge()
        self.tell()

    def choose(self, index: Any) -> None:
        """Take a code of the curve of maps against likeness."""
        if not (type(index) is int and 0 <= index < len(self.curve)):
            raise InputError(f"the curve has {len(self.curve)} codes, there is none of number {index!r}")
        self._check_free("choose a code")
        self._show(self.curve[index].code)
        self._judge()
        self.tell()

    async def save(self) -> None:
        """Write the code and what is known of it; keep it as a tracked run, too, if that can be."""
        self._check_free("save")
        found, picture = self.found, self._picture()
        if found is None:
            raise InputError("there is no code to save yet; find or import one first")
        self.task, self.saved = "save", {}
        self.tell()
        try:
            folder = await self._thread(partial(saving.new_folder, self.output, picture.name))
            names = await self._thread(partial(write, found, folder))
            self.saved = {"folder": str(folder), "files": ", ".join(names)}
            self.tell()
            try:
                self.saved["run"] = await self._thread(partial(saving.track, found, folder, names, self.output,
                                                               picture.name))
            except InputError as error:
                self.saved["not_tracked"] = str(error)
        finally:
            self.task = ""
            self.tell()

    def close(self) -> Path | None:
        """End all work. A code that nobody saved is written; returns its file."""
        self.closing = True
        self.worker.close()
        kept = None
        if self.code is not None and not self.saved and self.picture is not None:
            kept = self.code.save(saving.new_folder(self.output, self.picture.name) / "code.json")
        shutil.rmtree(self.work, ignore_errors=True)
        return kept

    # What comes of it.

    def _taken(self, data: bytes, path: Path, name: str) -> Picture:
        path.write_bytes(data)
        try:
            return Picture.taken(path, name, Reading())
        except InputError:
            path.unlink()
            raise

    def _begin_with(self, picture: Picture) -> None:
        if self.picture is not None and self.picture.path != picture.path:
            self.picture.path.unlink(missing_ok=True)
        self.picture = picture
        self.version["picture"] += 1
        self.code, self.can_go_on, self.seconds, self.curve = None, False, 0.0, ()
        self._forget()
        self.version["code"] += 1

    def _search(self, task: str, begin: str | IFS, seconds: float | None) -> None:
        picture = self._picture()
        if begin == "anew":
            self.code = None
            self.version["code"] += 1
        self._forget()
        self.task, self.stopping, self.can_go_on = task, False, False
        self.worker.do(Find(picture.read, self.work / CHECKPOINT, self.settings, seconds, begin))
        self.tell()

    def _judge(self) -> None:
        """Judge the code as it is now; a code that is changed meanwhile is judged after it."""
        if self.task == "" and self.code is not None and not self.closing:
            self.task = "judge"
            self.worker.do(Judge(self._picture().read, self.code))

    def _hear(self, word: Word) -> None:
        if isinstance(word, Ready):
            self.ready = True
            self.tell()
        elif isinstance(word, Told):
            left = None if word.left is None or not math.isfinite(word.left) else word.left
            self.tell(told="progress", seconds=word.seconds, left=left, stage=word.stage, fraction=word.fraction,
                      error=word.error)
        elif isinstance(word, Best):
            if self.task != "judge":
                self._show(word.code)
                self.scores = word
                self.tell()
        else:
            self._end(word)

    def _end(self, done: Done) -> None:
        task, self.task, self.stopping = self.task, "", False
        self.why = done.why or (self.why if task == "judge" else "")
        found = done.found
        if task == "judge":
            if found is not None and self._is_code(found):
                self.found, self.scores = found, Best(found.code, found.likeness.f1, found.likeness.iou)
            elif found is not None:
                self._judge()  # it was changed meanwhile
        else:
            self.can_go_on = done.interrupted
            if found is not None:
                self.seconds += found.seconds
                self._show(found.code)
                self.found = replace(found, seconds=self.seconds)
                self.scores = Best(found.code, found.likeness.f1, found.likeness.iou)
                self.curve = found.curve or self.curve
            elif self.code is not None:
                self._judge()
        self.tell()

    def _is_code(self, found: Inversion) -> bool:
        """Whether what was judged is the code as it is now; it came back as a copy."""
        return self.code is not None and found.code.to_json() == self.code.to_json()

    def _show(self, code: IFS) -> None:
        self.code = code
        self.version["code"] += 1
        self._forget()

    def _forget(self) -> None:
        """What was known of the code before."""
        self.scores = self.found = None
        self.saved, self.why = {}, ""

    def _picture(self) -> Picture:
        if self.picture is None:
            raise InputError("there is no picture yet; drop one first")
        return self.picture

    def _check_free(self, to: str) -> None:
        doing = {"find": "a search is going on; stop it first", "polish": "a search is going on; stop it first",
                 "read": "a picture is being read; wait a moment", "save": "a code is being saved; wait a moment",
                 "judge": "the code is being judged; wait a moment"}
        if self.task:
            raise InputError(f"cannot {to}: {doing[self.task]}")

    async def _in_a_thread(self, task: str, work: Callable[[], Picture], then: Callable[[Picture], None]) -> None:
        self.task = task
        self.tell()
        try:
            then(await self._thread(work))
        finally:
            self.task = ""
            self.tell()

    async def _thread(self, work: Callable[[], Any]) -> Any:
        return await self.loop.run_in_executor(None, work)


def _checked(settings: Mapping[str, Any]) -> tuple[dict[str, Any], float | None]:
    """The options of a search and its limit of time, from what a page sent."""
    unknown = sorted(set(settings) - {"seconds", "maps", "levels"})
    if unknown:
        raise InputError(f"a search takes seconds, maps and levels, got {unknown[0]!r}")
    given = {name: value for name, value in settings.items() if value is not None}
    seconds = given.pop("seconds", None)
    if seconds is not None and not (isinstance(seconds, int | float) and 1 <= seconds <= MOST_SECONDS):
        raise InputError(f"the limit of time must be 1 to {MOST_SECONDS} seconds, or be left empty, got {seconds!r}")
    if "maps" in given and not (type(given["maps"]) is int and 2 <= given["maps"] <= 1000):
        raise InputError(f"the number of maps must be 2 to 1000, or be left empty, got {given['maps']!r}")
    if given.setdefault("levels", "auto") not in MEANINGS:
        raise InputError(f"levels must be one of {', '.join(MEANINGS)}, got {given['levels']!r}")
    return given, seconds
