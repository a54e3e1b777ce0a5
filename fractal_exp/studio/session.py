"""Where a session of the studio stands: its picture, the search, the code; all tabs follow the same one.

Everything here happens in the server's event loop. What takes long is done in a thread or in the worker, and what
comes of it is told to whoever listens, as plain data.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
from collections.abc import Callable, Iterator
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..ifs.code import IFS
from ..runtime.extras import need
from . import saving
from .keeping import Folder, unfinished
from .reading import Picture, Reading, file_name, plain_name
from .standing import SEARCHES, Standing
from .tasks import Best, Done, Find, Judge, Settings, Told
from .worker import Listener, Ready, Word, Worker

DOING = {"find": "a search is going on; stop it first", "polish": "a search is going on; stop it first",
         "read": "a picture is being read; wait a moment", "save": "a code is being saved; wait a moment",
         "judge": "the code is being judged; wait a moment"}

Hear = Callable[[dict[str, Any]], None]
log = logging.getLogger(__name__)


class Session(Standing):
    """One session. folder: in which it keeps what it would need to go on; output: the only other folder that is written
    into; loop: the one in which all methods are called; worker: makes what does the tasks."""

    def __init__(self, folder: Folder, output: Path, loop: asyncio.AbstractEventLoop,
                 worker: Callable[[Listener], Worker] = Worker):
        self.folder, self.output, self.loop = folder, output, loop
        super().__init__(list(unfinished(output)))
        self.closing = False
        self.waiting: Find | None = None      # until the code has been judged
        self.listeners: set[Hear] = set()
        self.reading = asyncio.Lock()         # one picture at a time, for its memory
        self.unkept, self.keeping = False, None
        self.worker = worker(lambda word: loop.call_soon_threadsafe(self._hear, word))

    # What is told.

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
        path = self.folder.path / f"{secrets.token_hex(4)}-{file_name(name)}"
        await self._read(partial(Picture.put, data, path, name))

    async def read(self, reading: Reading) -> None:
        """The same picture, read otherwise."""
        self._check_free("read the picture anew")
        await self._read(partial(self._picture().again, reading))

    async def resume(self) -> None:
        """Go on with the newest session that ended without saving its code."""
        self._check_free("open another session")
        if self.picture is not None or not self.offers:
            raise InputError("there is no session to open here; start the studio anew to be offered one")
        folder = self.offers[0]
        state, code = folder.state()
        await self._read(partial(Picture.taken, folder.path / state.picture, state.name, Reading(**state.reading)))
        self.offers.remove(folder)
        self.folder.remove()
        self.folder, self.settings, self.seconds = folder, Settings(**state.settings), state.seconds
        self.can_go_on, self.polishing = state.goes_on and folder.checkpoint.exists(), state.polishing
        self.past, self.ahead = ([each.made() for each in codes] for codes in (state.past, state.ahead))
        if code is not None:
            self._show(code)
        self._set_free()

    def discard(self) -> None:
        """Delete the newest session that ended without saving its code."""
        if self.offers:
            self.offers.pop(0).remove()
        self.tell()

    def find(self, settings: Settings) -> None:
        """Search from the beginning."""
        self._check_free("search", "judge")
        self._picture()
        self._step()
        self.settings, self.seconds = settings, 0.0
        self._show(None)
        self._search("find", "anew", settings.seconds)

    def go_on(self) -> None:
        """Go on with a search that was stopped, for as long as its limit leaves."""
        self._check_free("search", "judge")
        if not self.can_go_on:
            raise InputError("there is no search that was stopped; begin one with Find")
        limit = self.settings.seconds
        self._search("find", "again", None if limit is None else max(1.0, limit - self.seconds))

    def polish(self, settings: Settings) -> None:
        """Improve the code as it is now."""
        self._check_free("search", "judge")
        if self.code is None:
            raise InputError("there is no code to begin with; find or import one first")
        if len(self.code) < 2:
            raise InputError("a code of one map draws a point; add maps before it is polished")
        self.settings = settings.updated(maps=None)  # the code has its own number
        self._step()
        self._search("polish", self.code, settings.seconds)

    async def mend(self) -> None:
        """Do what is most likely to help, as the verdict says."""
        self._check_free("search")
        change = self._change()
        if not change:
            raise InputError("there is nothing that the studio could do by itself")
        (name, value), = change.items()
        settings = self.settings
        if name in Reading.model_fields:
            await self.read(self._picture().reading.updated(**change))
        else:
            settings = settings.updated(**{name: value})
        self.find(settings)

    def stop(self) -> None:
        """End the search with what it has."""
        if self.task not in SEARCHES:
            raise InputError("no search is going on")
        self.stopping = True
        self.worker.stop()
        self.tell()

    def edit(self, code: IFS, mark: str = "") -> None:
        """Take another code, made by hand, and judge it as soon as nothing else is done. mark: by which the page knows
        that it is its own."""
        if self.task in (*SEARCHES, "read"):
            raise InputError(f"cannot change the maps: {DOING[self.task]}")
        self._picture()
        if not self.mark:
            self._step()
        self._show(code)
        self.mark = mark or "hand"
        self._set_free(self.task)

    def choose(self, index: int) -> None:
        """Take a code of the curve of maps against likeness."""
        if not 0 <= index < len(self.curve):
            raise InputError(f"the curve has {len(self.curve)} codes, there is none of number {index!r}")
        self._check_free("choose a code", "judge")
        self._step()
        self._show(self.curve[index].code)
        self._set_free(self.task)

    def colour(self, yes: bool) -> None:
        """Give codes the colours of the picture, this one and those to come, or none."""
        self._check_free("change the colours", "judge")
        self._picture()
        if yes:
            need("skimage")
        self.settings, self.judged = self.settings.updated(colour=yes), 0
        self._forget()
        self._set_free(self.task)

    def back(self) -> None:
        """Take the code before the last search, choice or work by hand."""
        self._go(self.past, self.ahead, "before")

    def forth(self) -> None:
        """Take back the last step back."""
        self._go(self.ahead, self.past, "after")

    async def save(self) -> None:
        """Write the code and what is known of it; keep it as a tracked run, too, if that can be. It is told as saved
        only if it is still the code that is shown."""
        self._check_free("save")
        found, picture = self.found, self._picture()
        if found is None:
            raise InputError("there is no code to save yet; find or import one first")
        with self._at("save"):
            saved = await asyncio.to_thread(saving.save, found, picture, self.output)
            if self.found is found:
                self.saved = saved
                self.tell()
            try:
                folder = Path(saved["folder"])
                saved["run"] = await asyncio.to_thread(saving.track, found, folder, saved["names"], self.output,
                                                       picture.name)
            except InputError as error:
                saved["not_tracked"] = str(error)
            except Exception as error:  # of whatever kind: the files are there
                log.exception("a code was saved, but not tracked")
                saved["not_tracked"] = f"{type(error).__name__}: {error}"

    async def close(self) -> str:
        """End all work. A code that nobody saved stays in the session's folder. Returns what became of it, in words."""
        self.closing = True
        await asyncio.to_thread(self.worker.close)
        if self.keeping is not None:
            await self.keeping
        for each in self.offers:
            each.leave()
        if self.picture is None or self.saved or (self.code is None and not self.can_go_on):
            self.folder.remove()
            return ""
        try:
            path = await asyncio.to_thread(self.folder.keep, self._state(), self.code)
            words = f"kept {path if self.code is not None else path.parent}; the next start offers it"
        except InputError as error:
            words = f"{error}; the code that was not saved: {json.dumps(self.code and self.code.to_json())}"
        self.folder.leave()
        return words

    # What comes of it.

    async def _read(self, work: Callable[[], Picture]) -> None:
        with self._at("read"):
            async with self.reading:
                picture = await asyncio.to_thread(work)
            before, self.picture = self.picture, picture
            if before is not None and before.path == picture.path:
                self._step()
            else:
                self.past, self.ahead = [], []
                if before is not None:
                    before.path.unlink(missing_ok=True)
            self.version["picture"] += 1
            self.can_go_on, self.seconds, self.curve = False, 0.0, ()
            self._show(None)

    def _search(self, task: str, begin: str | IFS, seconds: float | None) -> None:
        if begin != "again":
            self.polishing = task == "polish"
        options = self.settings.model_dump(exclude={"seconds", "colour"}, exclude_none=True)
        find = Find(self._target(), self.folder.checkpoint, options, seconds, begin, self.polishing, beat=self.code,
                    colour=self.settings.colour)
        if self.task == "judge":  # a code that was changed a moment ago
            self.waiting = find
        else:
            self.worker.do(find)
        self.found, self.judged, self.saved, self.why = None, 0, {}, ""
        self.task, self.stopping, self.can_go_on = task, False, False
        self._keep()
        self.tell()

    def _set_free(self, task: str = "") -> None:
        """A task has ended: judge a code that was not judged yet. All tabs are told."""
        self.task = task
        code = self.code
        if task == "" and code is not None and self.judged != self.version["code"] and not self.closing:
            self.task, self.judged = "judge", self.version["code"]
            self.worker.do(Judge(self._target(), code, self.settings.colour))
        self._keep()
        self.tell()

    def _hear(self, word: Word) -> None:
        if isinstance(word, Ready):
            self.ready = True
            self.tell()
        elif isinstance(word, Told):
            self.tell(told="progress", **asdict(word))
        elif isinstance(word, Best):
            self._show(word.code)
            self.likeness = word.likeness.f1_1px
            self._keep()
            self.tell()
        else:
            self._end(word)

    def _end(self, done: Done) -> None:
        find, self.waiting = self.waiting, None
        if find is not None and not self.stopping and not self.closing:
            return self.worker.do(find)
        if find is not None:  # it was stopped before it began
            done = Done()
        task, self.stopping, found = self.task, False, done.found
        self.why = done.why or (self.why if task not in SEARCHES else "")
        if task in SEARCHES:
            self.can_go_on = done.interrupted
            if found is not None:
                self.seconds += found.seconds
                self._show(replace(found.code, colours=None))
                self._know(replace(found, seconds=self.seconds))
                self.curve = found.curve or self.curve
        elif found is not None and self.judged == self.version["code"]:  # else it was changed meanwhile
            self._know(found)
        self._set_free("" if task in (*SEARCHES, "judge") else task)

    def _go(self, from_: list[IFS], to: list[IFS], where: str) -> None:
        self._check_free("change the code", "judge")
        if not from_:
            raise InputError(f"there is no code {where} this one")
        if self.code is not None:
            to.append(self.code)
        self._show(from_.pop())
        self._set_free(self.task)

    def _check_free(self, to: str, *but: str) -> None:
        if self.task and self.task not in but:
            raise InputError(f"cannot {to}: {DOING[self.task]}")

    # What is kept on the disk, so that nothing is lost however the studio ends.

    def _keep(self) -> None:
        """Write where the session stands, beside all else, and not more often than the disk can."""
        self.unkept = self.picture is not None
        if self.keeping is None and self.unkept and not self.closing:
            self.keeping = self.loop.create_task(self._kept())

    async def _kept(self) -> None:
        try:
            while self.unkept:
                self.unkept = False
                await asyncio.to_thread(self.folder.keep, self._state(), self.code)
        except InputError as error:
            self.why = f"{error}; until then the code is lost if the studio ends unexpectedly"
            self.tell()
        finally:
            self.keeping = None

    @contextlib.contextmanager
    def _at(self, task: str) -> Iterator[None]:
        self.task = task
        self.tell()
        try:
            yield
        finally:
            self._set_free()
