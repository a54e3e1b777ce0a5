"""What waits to be sent to MLflow, the thread that sends it, and what becomes of it when the store is away."""

from __future__ import annotations

import io
import json
import os
import posixpath
import shutil
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from .addresses import reason, root, shown
from .store import FIRST_RETRY, LAST_RETRY

if TYPE_CHECKING:
    from mlflow import MlflowClient

FLUSH_SECONDS = 5.0  # between two sendings,
BATCH = 1000         # or when so many values wait; also the most that MLflow takes in one call
LAST_WAIT = 60.0     # seconds of silence after which a run that has ended stops trying


@dataclass(frozen=True)
class Upload:
    """A file on its way, or, with a step, a PNG of the image series `name`."""

    name: str
    data: bytes
    step: int | None = None

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


class Outbox:
    """Sends one run's metrics, tags and files from a thread of its own and keeps what has not arrived.

    Putting something in costs a list append. While the store is away everything is kept and tried again, which is
    said once on stderr. What has not arrived by a minute after the end goes to `folder`/undelivered-RUN_ID; the next
    outbox of that run starts with it.
    """

    def __init__(self, client: MlflowClient, run_id: str, folder: str | Path) -> None:
        self._client, self._run_id = client, run_id
        self._folder = Path(folder).absolute() / f"undelivered-{run_id}"
        # The fit appends, the thread deletes from the front what has arrived. Both are atomic: neither waits.
        self._metrics: list[tuple[str, float, int, int]] = []  # name, value, milliseconds since the epoch, step
        self._tags: list[tuple[str, str]] = []
        self._uploads: list[Upload] = []
        self._end: tuple[str, int] | None = None  # status, milliseconds since the epoch
        self._abandoned = False
        self._heard = time.monotonic()
        self._wake = threading.Event()
        self._read_undelivered()
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
        self._uploads.append(upload)
        self._wake.set()

    def close(self, status: str) -> None:
        """Send everything, end the run with `status`, and return when that is done or given up."""
        self._heard, self._end = time.monotonic(), (status, int(time.time() * 1000))
        self._wake.set()
        try:
            while self._thread.is_alive() and time.monotonic() - self._heard < LAST_WAIT:
                self._thread.join(0.1)
        finally:  # also when Ctrl-C cuts the waiting short
            if self._thread.is_alive():
                self._abandoned = True
                self._write_undelivered()
            else:
                shutil.rmtree(self._folder, ignore_errors=True)

    def _run(self) -> None:
        away_since, pause = None, FIRST_RETRY
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
                pause = min(2 * pause, LAST_RETRY)
                continue
            if away_since is not None:
                print(f"tracking: everything arrived after {time.monotonic() - away_since:.0f} s", file=sys.stderr)
                away_since, pause = None, FIRST_RETRY
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

    def _write_undelivered(self) -> None:
        uploads, files = self._uploads[:], []
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            for i, upload in enumerate(uploads):
                file = f"{i}-{posixpath.basename(upload.name)}"
                (self._folder / file).write_bytes(upload.data)
                files.append({"name": upload.name, "step": upload.step, "file": file})
            note = {"uri": shown(self._client.tracking_uri), "run_id": self._run_id, "status": self._end[0],
                    "tags": self._tags, "metrics": self._metrics, "files": files}
            (self._folder / "run.json.part").write_text(json.dumps(note))
            os.replace(self._folder / "run.json.part", self._folder / "run.json")
        except OSError as error:
            print(f"tracking: what the store did not take could not be written to {self._folder} either: {error}",
                  file=sys.stderr)
        else:
            print(f"tracking: the store did not take {len(note['metrics'])} values and {len(files)} files, they are in "
                  f"{self._folder}; send them with: {sys.executable} -m fractal_exp.tracking deliver "
                  f"'{self._folder.parent}'", file=sys.stderr)

    def _read_undelivered(self) -> None:
        if (self._folder / "run.json").exists():
            note = json.loads((self._folder / "run.json").read_text())
            self._metrics.extend(tuple(metric) for metric in note["metrics"])
            self._tags.extend(tuple(tag) for tag in note["tags"])
            self._uploads.extend(Upload(file["name"], (self._folder / file["file"]).read_bytes(), file["step"])
                                 for file in note["files"])
