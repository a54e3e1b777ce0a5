"""The folder of a session, which outlives it: a session that ended without saving its code is offered again."""

from __future__ import annotations

import json
import shutil
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from filelock import FileLock, Timeout
from pydantic import BaseModel, ConfigDict, Field

from ..errors import InputError
from ..ifs.code import IFS
from ..runtime.files import explain, read_record, write_atomically
from ..viewer.page import MOST_MAPS
from . import saving
from .reading import Reading
from .tasks import Settings

WORK, STATE, CODE, CHECKPOINT, LOCK = "session", "session.json", "code.json", "search.safetensors", ".lock"

Pair = tuple[float, float]


class Code(BaseModel):
    """A code as the editor of the page sends it: the package's plain data without notes and colours."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)

    format: Literal["fractal-exp/ifs"]
    version: Literal[1]
    linear: Annotated[list[tuple[Pair, Pair]], Field(min_length=1, max_length=MOST_MAPS)]
    offset: Annotated[list[Pair], Field(max_length=MOST_MAPS)]
    probabilities: Annotated[list[float], Field(max_length=MOST_MAPS)] | None = None

    def made(self) -> IFS:
        """Raises `InputError` on what is no contractive code."""
        return IFS.from_json(self.model_dump())


def plain(code: IFS) -> dict[str, Any]:
    """A code as the editor of the page knows it."""
    return {name: part for name, part in code.to_json().items() if name in Code.model_fields}


class State(BaseModel):
    """All that is needed to go on, besides the files of the picture, of the code and of the search.

    picture, name: the file in the folder, and what it was called; seconds: that searches took; polishing: whether the
    search began with a code; goes_on: whether it can go on; past, ahead: codes before and after this one.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    version: Literal[1] = 1
    picture: str
    name: str
    reading: dict[str, Any]
    settings: dict[str, Any]
    seconds: float = 0.0
    polishing: bool = False
    goes_on: bool = False
    past: list[Code] = []
    ahead: list[Code] = []

    @classmethod
    def of(cls, **given: Any) -> Self:
        """From plain data, checked as a file of it would be."""
        return cls.model_validate_json(json.dumps(given))


@dataclass(eq=False)
class Folder:
    """A session's folder. Its lock is the kernel's, and goes with the process, however that ends."""

    path: Path
    lock: FileLock = field(repr=False)

    @classmethod
    def new(cls, output: Path) -> Self:
        """Raises `InputError` if it cannot be made."""
        path = saving.new_folder(output, WORK)
        try:
            return cls(path, _locked(path))
        except OSError as error:
            raise InputError(f"cannot write {explain(error, path)}") from error

    @property
    def checkpoint(self) -> Path:
        return self.path / CHECKPOINT

    def keep(self, state: State, code: IFS | None) -> Path:
        """Write where a session stands; the code's file. Raises `InputError` where that cannot be, as on a full disk;
        what was written before stays."""
        if code is not None:
            code.save(self.path / CODE)
        write_atomically(self.path / STATE, state.model_dump_json())
        if code is None:
            (self.path / CODE).unlink(missing_ok=True)
        return self.path / CODE

    def state(self) -> tuple[State, IFS | None]:
        """What `keep` wrote. Raises `InputError` where it is damaged."""
        state = read_record(self.path / STATE, "the session", State)
        Reading(**state.reading)
        Settings(**state.settings)
        if Path(state.picture).name != state.picture:
            raise InputError(f"{self.path / STATE} is damaged (its picture lies elsewhere); delete it")
        return state, IFS.load(self.path / CODE) if (self.path / CODE).exists() else None

    @cached_property
    def about(self) -> dict[str, Any]:
        """What tells a user which session it was: plain data."""
        state, code = self.state()
        when = time.localtime((self.path / STATE).stat().st_mtime)
        return {"name": state.name, "maps": code and len(code), "when": time.strftime("%Y-%m-%d %H:%M", when)}

    def leave(self) -> None:
        """Let others take it."""
        self.lock.release()

    def remove(self) -> None:
        """Delete it with all that is in it."""
        shutil.rmtree(self.path, ignore_errors=True)
        self.lock.release()


def unfinished(output: Path) -> Iterator[Folder]:
    """The folders of sessions that ended with something unsaved, the newest first, each locked. Those with nothing are
    removed, and damaged ones left alone."""
    for path in sorted((each.parent for each in output.glob(f"*-{WORK}*/{STATE}")), reverse=True):
        try:
            folder = Folder(path, _locked(path))
        except (Timeout, OSError):  # it is at work, or not ours
            continue
        try:
            state, code = folder.state()
            _ = folder.about
        except (InputError, OSError):
            folder.leave()
            continue
        if code is not None or (state.goes_on and folder.checkpoint.exists()):
            yield folder
        else:
            folder.remove()


def _locked(path: Path) -> FileLock:
    lock = FileLock(path / LOCK, timeout=0, thread_local=False)
    lock.acquire()
    return lock
