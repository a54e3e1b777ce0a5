"""What waits to be sent to MLflow, the thread that sends it, and what becomes of it when the store is away."""

from __future__ import annotations

import contextlib
import io
import json
import posixpath
import re
import reprlib
import shutil
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from pydantic import Field, FiniteFloat

from ..errors import InputError
from ..runtime.files import read_file, read_record, write_atomically
from .addresses import reason, root, shown
from .store import FIRST_RETRY, LAST_RETRY

if TYPE_CHECKING:
    from mlflow import MlflowClient

FLUSH_SECONDS = 5.0  # between two sendings,
BATCH = 1000         # or when so many values wait; also the most that MLflow takes in one call
NOTE = "run.json"    # in the folder of what is undelivered
End = Literal["FINISHED", "FAILED", "KILLED"]
ENDS = get_args(End)
LARGEST_NOTE = 2**28  # bytes, four million values: hours without a store

Whole = Annotated[int, Field(gt=-2**63, lt=2**63)]


@dataclass(frozen=True)
class Upload:
    """A file on its way, or, with a step, a PNG of the image series `name`; `file` holds it if it is written down."""

    name: str
    data: bytes
    step: int | None = None
    file: str = ""

    def send(self, client: MlflowClient, run_id: str) -> None:
        """Hand it to MLflow; raises whatever MLflow raises."""
        if self.step is not None:
            from PIL import Image

            client.log_image(run_id, Image.open(io.BytesIO(self.data)), key=self.name, step=self.step)
            return
        folder, name = posixpath.split(self.name)
        with tempfile.TemporaryDirectory() as scratch:
            path = Path(scratch, name)
            path.write_bytes(self.data)
            client.log_artifact(run_id, str(path), folder or None)


@dataclass(frozen=True)
class Waiting:
    """A file of the folder of what is undelivered: what it is called in the run, or an image series and its step."""

    name: str
    step: int | None
    file: str


@dataclass(frozen=True)
class Note:
    """What lies undelivered: metrics are name, value, milliseconds since the epoch and step."""

    uri: str
    run_id: str
    status: End | None
    metrics: list[tuple[str, FiniteFloat, Whole, Whole]]
    tags: list[tuple[str, str]]
    files: list[Waiting]


@dataclass(frozen=True)
class Patience:
    """While the store is away: the seconds from the first attempt to the next, which double up to `last_retry`, and
    those of silence after which a run that has ended stops trying."""

    first_retry: float = FIRST_RETRY
    last_retry: float = LAST_RETRY
    last_wait: float = 60.0


PATIENT = Patience()


class Outbox:
    """Sends one run's metrics, tags and files from a thread of its own and keeps what has not arrived.

    Putting something in costs a list append. While the store is away everything is kept and tried again, which is
    said once on stderr. What has not arrived at a call of `secure`, or by a minute after the end, is written to
    `folder`/undelivered-RUN_ID; the next outbox of that run starts with it.

    on_record: name, step and value of the metrics that the store has; images: name and step of its image series. What
    lies in the folder is added to both.
    """

    def __init__(self, client: MlflowClient, run_id: str, folder: str | Path,
                 on_record: set[tuple[str, int, float]], images: set[tuple[str, int]],
                 patience: Patience = PATIENT) -> None:
        self._client, self._run_id, self._patience = client, run_id, patience
        self._folder = undelivered(folder, run_id)
        # The fit appends, the thread deletes from the front what has arrived. Both are atomic: neither waits.
        self._metrics: list[tuple[str, float, int, int]] = []  # name, value, milliseconds since the epoch, step
        self._tags: list[tuple[str, str]] = []
        self._uploads: list[Upload] = []
        self._end: tuple[str, int] | None = None  # status, milliseconds since the epoch
        self._abandoned = self._insecure = False
        self._heard = time.monotonic()
        self._wake = threading.Event()
        self._written: set[str] = set()  # files of uploads in the folder
        self._read_undelivered(on_record, images)
        self._thread = threading.Thread(target=self._run, name=f"tracking {run_id}", daemon=True)
        self._thread.start()

    def metric(self, name: str, value: float, milliseconds: int, step: int) -> None:
        """Put in one finite value of a metric."""
        self._metrics.append((name, value, milliseconds, step))
        if len(self._metrics) >= BATCH:
            self._wake.set()

    def tag(self, name: str, value: str) -> None:
        """Put in a tag; the last value of a name stays."""
        self._tags.append((name, value))

    def upload(self, upload: Upload) -> None:
        """Put in a file."""
        self._uploads.append(replace(upload, file=f"{self._number}-{posixpath.basename(upload.name)}"))
        self._number += 1
        self._wake.set()

    def secure(self) -> None:
        """Write what is on its way to the folder, so that it outlives this process."""
        try:
            self._write_undelivered(None)
        except (InputError, OSError) as error:
            if not self._insecure:
                print(f"tracking: what is on its way to the store could not be written to {self._folder}: {error}; a "
                      f"kill would lose it", file=sys.stderr)
            self._insecure = True

    def close(self, status: str) -> None:
        """Send everything, end the run with `status`, and return when that is done or given up."""
        self._heard, self._end = time.monotonic(), (status, int(time.time() * 1000))
        self._wake.set()
        try:
            while self._thread.is_alive() and time.monotonic() - self._heard < self._patience.last_wait:
                self._thread.join(0.1)
        finally:  # also when Ctrl-C cuts the waiting short
            if self._thread.is_alive():
                self._abandoned = True
                self._give_up(status)
            else:
                with contextlib.suppress(OSError):  # the note first: it must not outlive the files that it names
                    (self._folder / NOTE).unlink()
                shutil.rmtree(self._folder, ignore_errors=True)

    def _run(self) -> None:
        away_since, pause = None, self._patience.first_retry
        while not self._abandoned:
            self._wake.wait(0 if away_since else FLUSH_SECONDS)
            self._wake.clear()
            end = self._end  # read first: what was put in before the end is sent before it
            try:
                self._send(end)
            except Exception as error:  # of MLflow, its database, the disk or the network: none may end a fit
                if away_since is None:
                    away_since = time.monotonic()
                    print(f"tracking: the store does not take what is sent ({reason(root(error))}); the fit goes on, "
                          f"everything is kept and tried again", file=sys.stderr)
                time.sleep(pause)
                pause = min(2 * pause, self._patience.last_retry)
                continue
            if away_since is not None:
                print(f"tracking: everything arrived after {time.monotonic() - away_since:.0f} s", file=sys.stderr)
                away_since, pause = None, self._patience.first_retry
            if end:
                return

    def _send(self, end: tuple[str, int] | None) -> None:
        from mlflow.entities import Metric, RunTag

        left = len(self._metrics)
        while left > 0 or self._tags:
            metrics, tags = self._metrics[:BATCH], self._tags[:]
            self._client.log_batch(self._run_id, metrics=[Metric(*metric) for metric in metrics],
                                   tags=[RunTag(*tag) for tag in dict(tags).items()])
            del self._metrics[:len(metrics)], self._tags[:len(tags)]
            left -= len(metrics)
            self._heard = time.monotonic()
        failure = None
        for upload in self._uploads[:]:
            try:
                upload.send(self._client, self._run_id)
            except Exception as error:  # one file that the store will not have must not hold up the others
                failure = error
            else:
                self._uploads.remove(upload)
                self._heard = time.monotonic()
        if end:
            self._client.set_terminated(self._run_id, status=end[0], end_time=end[1])
        if failure:
            raise failure

    def _give_up(self, status: str) -> None:
        try:
            values, files = self._write_undelivered(status)
        except (InputError, OSError) as error:
            print(f"tracking: what the store did not take could not be written to {self._folder} either: {error}",
                  file=sys.stderr)
        else:
            print(f"tracking: the store did not take {values} values and {files} files, they are in {self._folder}; "
                  f"send them with: {sys.executable} -m fractal_exp.tracking deliver '{self._folder.parent}'",
                  file=sys.stderr)

    def _write_undelivered(self, status: str | None) -> tuple[int, int]:
        """Write what waits (status None: the run goes on); how many values and files."""
        uploads, metrics = self._uploads[:], self._metrics[:]
        self._folder.mkdir(parents=True, exist_ok=True)
        for upload in uploads:
            if upload.file not in self._written:
                write_atomically(self._folder / upload.file, upload.data)
                self._written.add(upload.file)
        note = {"uri": shown(self._client.tracking_uri), "run_id": self._run_id, "status": status, "metrics": metrics,
                "tags": self._tags[:],
                "files": [{"name": upload.name, "step": upload.step, "file": upload.file} for upload in uploads]}
        write_atomically(self._folder / NOTE, json.dumps(note))
        return len(metrics), len(uploads)

    def _read_undelivered(self, on_record: set[tuple[str, int, float]], images: set[tuple[str, int]]) -> None:
        # Numbers go on: a file must not change under a note that names it.
        numbers = [int(match[1]) for file in self._folder.glob("*") if (match := re.match(r"(\d+)-", file.name))]
        self._number = 1 + max(numbers, default=-1)
        note = read_note(self._folder)
        if note is None:
            return
        for name, value, milliseconds, step in note.metrics:
            if (name, step, value) not in on_record:  # the process may have been killed after it was sent
                on_record.add((name, step, value))
                self._metrics.append((name, value, milliseconds, step))
        self._tags.extend(note.tags)
        for each in note.files:
            key = each.name, each.step
            if key in images:
                continue
            if each.step is not None:
                images.add((each.name, each.step))
            data = read_file(self._folder / each.file, "what is undelivered,")
            self._uploads.append(Upload(each.name, data, each.step, each.file))
            self._written.add(each.file)


def undelivered(folder: str | Path, run_id: str) -> Path:
    """The folder of what a run could not send; `folder` is the run's own."""
    return Path(folder).absolute() / f"undelivered-{run_id}"


def read_note(folder: Path) -> Note | None:
    """What waits in a folder of undelivered things, None if nothing does.

    The note may have been damaged, or made by somebody else to get at other files. Raises `InputError` unless every
    part of it is as an outbox writes it and every file that it names lies in the folder.
    """
    path = folder / NOTE
    if not path.exists():
        return None
    remedy = f"move {folder} away to go on without what it holds"
    note = read_record(path, "the note of what is undelivered,", Note, remedy, LARGEST_NOTE)
    if folder.name != f"undelivered-{note.run_id}":
        raise InputError(f"{path} is damaged: it is of the run {reprlib.repr(note.run_id)}; {remedy}")
    for name, file in ((each.name, each.file) for each in note.files):
        if posixpath.normpath(name) != name or name[:1] in (".", "/"):
            raise InputError(f"{path} is damaged: no file is called {reprlib.repr(name)}; {remedy}")
        if Path(file).name != file or not (folder / file).is_file() or (folder / file).is_symlink():
            raise InputError(f"{path} is damaged: {reprlib.repr(file)} is no file of this folder; {remedy}")
    return note
