"""One run in MLflow: how it starts or goes on, and its verbs."""

from __future__ import annotations

import hashlib
import json
import math
import os
import posixpath
import re
import sys
import time
import traceback
from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from .addresses import reason, shown
from .base import Tracker
from .client import connect
from .dashboard import NOTE, describe
from .outbox import ENDS, PATIENT, Note, Outbox, Patience, Upload, read_note, undelivered
from .store import (
    FIRST_PATIENCE,
    PARENT,
    artifact_root,
    changing_hands,
    is_written_elsewhere,
    patiently,
    process_tags,
)

if TYPE_CHECKING:
    import pandas as pd
    from mlflow import MlflowClient
    from mlflow.entities import Run

LONGEST_PARAM = 6000               # characters that MLflow keeps of a parameter
LONGEST_NAME = 250                 # characters of a metric or a parameter
TABLES = "mlflow.loggedArtifacts"  # the tag by which MLflow's dashboard finds tables,
IMAGES = "mlflow.loggedImages"     # and image series


class MlflowTracker(Tracker):
    """A run in MLflow, made by `start_run`. A verb costs microseconds: an `Outbox` sends every few seconds."""

    def __init__(self, client: MlflowClient, run_id: str, folder: str | Path, tables: list[dict] | None = None,
                 on_record: Collection[tuple[str, int, float]] = (),
                 images: Collection[tuple[str, int]] = (), note: str | None = None,
                 patience: Patience = PATIENT) -> None:
        self.run_id = run_id
        self._note, self._scores = note, {}
        self._tables = list(tables or [])
        self._on_record = set(on_record)
        self._last: dict[str, tuple[int, float]] = {}  # step and value by name
        self._images = set(images)
        self._outbox = Outbox(client, run_id, folder, self._on_record, self._images, patience)
        self._names: set[str] = set()
        self._non_finite: dict[str, tuple[int, float, int]] = {}  # name: how many, the first, its step
        self._ended = False

    def log(self, metrics: Mapping[str, float], step: int = 0) -> None:
        now, step = int(time.time() * 1000), int(step)
        self._scores |= {name: value for name, value in metrics.items() if name.startswith("eval/")}
        for name, value in metrics.items():
            if name not in self._names:
                self._names.add(_checked_name("metric", name, r"[\w\-. :]"))
            value = float(value)
            if not math.isfinite(value):
                count, first, at = self._non_finite.get(name, (0, value, step))
                self._non_finite[name] = (count + 1, first, at)
            # A resumed fit goes through the steps since its checkpoint again and finds the same numbers.
            elif (name, step, value) not in self._on_record and self._last.get(name) != (step, value):
                self._outbox.metric(name, value, now, step)
            self._last[name] = step, value

    def image(self, name: str, image: Any, step: int | None = None) -> None:
        from ..images.pixels import png  # and torch, which the dashboard does without

        _checked_name("image", name, r"[A-Za-z0-9_\-. ]")
        if step is None or (name, int(step)) not in self._images:
            self._outbox.upload(Upload(f"views/{name}.png" if step is None else name, png(image), step))

    def artifact(self, name: str, content: Path | str | bytes) -> None:
        _checked_name("artifact", name, r"[\w\-. ]")
        data = content.read_bytes() if isinstance(content, Path) else content
        self._outbox.upload(Upload(name, data.encode() if isinstance(data, str) else data))

    def table(self, name: str, frame: pd.DataFrame) -> None:
        if not name.endswith(".json"):
            raise InputError(f"a table's name must end in .json, got {name!r}")
        # client.log_table appends to a table that is there, which would double the rows of a resumed fit.
        self.artifact(name, str(frame.to_json(orient="split", index=False, date_format="iso", double_precision=15)))
        entry = {"path": name, "type": "table"}
        if entry not in self._tables:
            self._tables.append(entry)
            self._outbox.tag(TABLES, json.dumps(self._tables))

    def secure(self) -> None:
        self._outbox.secure()

    def finish(self, status: str = "FINISHED", error: BaseException | str | None = None) -> None:
        if status not in ENDS:
            raise ValueError(f"a run ends as FINISHED, FAILED or KILLED, got {status!r}")
        if self._ended:
            return
        self._ended = True
        if isinstance(error, BaseException):
            self.artifact("traceback.txt", shown("".join(traceback.format_exception(error))))
            error = reason(error)
        if error is not None:
            self._outbox.tag("error", shown(error))
        if self._note and self._scores:
            scores = ", ".join(f"{name.removeprefix('eval/')} {float(value):.3f}" for name, value in
                               self._scores.items())
            self._outbox.tag(NOTE, f"{self._note}\n\nScores: {scores}")
        if self._non_finite:
            self._outbox.tag("non_finite", "; ".join(f"{name}: {count}, first {value} at step {step}" for
                                                     name, (count, value, step) in self._non_finite.items()))
        self._outbox.close(status)


def start_run(uri: str, experiment: str, name: str, *, folder: str | Path, params: Mapping[str, Any] | None = None,
              tags: Mapping[str, str] | None = None, parent_run_id: str | None = None,
              resume_run_id: str | None = None, note: str | None = None) -> MlflowTracker:
    """Start a run of a study in the store made by `prepare_store`, or go on with the run `resume_run_id`.

    params may be nested, their names are joined by dots; one longer than 6000 characters becomes the file
    params/NAME.txt and leaves its digest. folder is the run's own, for what a lost server did not take. A run with a
    `parent_run_id` is nested below it. note is its description, to which its scores are added. A resumed run is
    RUNNING again, has lost its error, and does not log again what it has on record. Raises `InputError` if the store
    does not answer for a minute, the experiment is deleted, a name is refused, or if the run to resume does not exist,
    is written by another process, or has another value of a parameter.
    """
    client = connect(uri)
    texts, files = _param_texts(params or {})
    tags = {**(tags or {}), **process_tags()}
    if parent_run_id is not None:
        tags[PARENT] = parent_run_id
    if note is not None:
        tags[NOTE] = note = shown(note)
    known: dict[str, Any] = {}
    if resume_run_id is None:
        experiment_id = patiently(uri, _experiment_id, client, uri, experiment)
        run_id = patiently(uri, client.create_run, experiment_id, run_name=name, tags=tags).info.run_id
    else:
        read_note(undelivered(folder, resume_run_id))  # if it is damaged, the run stays as it is
        run_id, known = resume_run_id, _reopen(client, uri, resume_run_id, texts, tags)
    from mlflow.entities import Param

    patiently(uri, client.log_batch, run_id, params=[Param(*item) for item in texts.items()])
    tracker = MlflowTracker(client, run_id, folder, **known, note=note)
    for file, text in files.items():
        tracker.artifact(file, text)
    return tracker


def _experiment_id(client: MlflowClient, uri: str, name: str) -> str:
    from mlflow.exceptions import MlflowException

    found = client.get_experiment_by_name(name)
    if found is None:
        try:
            made = client.create_experiment(name, artifact_location=artifact_root(uri))
            describe(client, made, name)
            return made
        except MlflowException:
            found = client.get_experiment_by_name(name)  # another worker may have been first
            if found is None:
                raise
    if found.lifecycle_stage == "deleted":
        raise InputError(f"the study {name!r} was deleted from {shown(uri)}; choose another name, or restore it with: "
                         f"mlflow experiments restore --experiment-id {found.experiment_id}")
    return found.experiment_id


def _reopen(client: MlflowClient, uri: str, run_id: str, params: Mapping[str, str], tags: Mapping[str, str]) -> dict:
    """Set the run RUNNING with new tags; what the tracker must know of it: its tables and the values on record."""
    from mlflow.entities import RunTag
    from mlflow.exceptions import MlflowException

    try:
        run = patiently(uri, client.get_run, run_id)
    except MlflowException as error:
        raise InputError(f"{shown(uri)} has no run {run_id} to resume ({reason(error)}); start a new one") from error
    if run.info.lifecycle_stage == "deleted":
        raise InputError(f"run {run_id} was deleted; restore it with: mlflow runs restore --run-id {run_id}, "
                         f"or start a new one")
    if run.info.status == "RUNNING" and is_written_elsewhere(run.data.tags):
        raise InputError(f"run {run_id} is being written by process {run.data.tags['pid']}; wait for it, or end it")
    for name, value in params.items():
        if (before := run.data.params.get(name, value)) != value:
            raise InputError(f"run {run_id} was started with {name}={before} and cannot go on with {name}={value}; "
                             f"put it back, or start a new run")
    with changing_hands(uri):
        patiently(uri, client.log_batch, run_id, tags=[RunTag(*item) for item in tags.items()])
        patiently(uri, client.update_run, run_id, status="RUNNING")
    if "error" in run.data.tags:
        patiently(uri, client.delete_tag, run_id, "error")
    return _known(client, uri, run)


def _known(client: MlflowClient, uri: str, run: Run) -> dict[str, Any]:
    """What the store has of a run: its tables, the values of its metrics by step, the steps of its images."""
    run_id = run.info.run_id
    histories = [patiently(uri, client.get_metric_history, run_id, name) for name in run.data.metrics]
    files = patiently(uri, client.list_artifacts, run_id, "images") if IMAGES in run.data.tags else []
    # MLflow writes the small copy of an image last.
    names = [re.fullmatch(r"images/(.*)\+step\+(\d+)\+.*\+compressed\.webp", file.path) for file in files]
    return {"tables": json.loads(run.data.tags.get(TABLES, "[]")),
            "on_record": {(m.key, m.step, m.value) for history in histories for m in history},
            "images": {(name[1], int(name[2])) for name in names if name}}


def deliver(folder: str | Path, uri: str | None = None) -> list[str]:
    """Send what the runs in `folder` and below could not while their store was away; the ids of those runs.

    uri: the store in use; what waits for another one is left where it is, which is said on stderr. None: the store is
    MLFLOW_TRACKING_URI if set, else the one that each run was started with. Raises `InputError` if what waits is
    damaged, the store is still away or does not have the run, or, without a uri, if there is nothing to send.
    """
    notes = sorted(Path(folder).absolute().rglob("undelivered-*/run.json"))
    if not notes and uri is None:
        raise InputError(f"nothing waits to be delivered in {Path(folder).absolute()}; name the run's folder")
    run_ids = []
    for path in notes:
        note = read_note(path.parent)
        if note is None:  # delivered by another process meanwhile
            continue
        if uri is not None and shown(note.uri) != shown(uri):
            print(f"tracking: {path.parent} waits for another store, {shown(note.uri)}; send it with: "
                  f"{sys.executable} -m fractal_exp.tracking deliver '{path.parent.parent}'", file=sys.stderr)
            continue
        _deliver(path.parent, note, uri or os.environ.get("MLFLOW_TRACKING_URI") or note.uri)
        run_ids.append(note.run_id)
    return run_ids


def _deliver(folder: Path, note: Note, uri: str) -> None:
    from mlflow.exceptions import MlflowException

    client = connect(uri)
    try:
        run = patiently(uri, client.get_run, note.run_id, patience=FIRST_PATIENCE)
    except MlflowException as error:
        raise InputError(f"{shown(uri)} has no run {note.run_id}, whose rest waits in {folder} ({reason(error)}); "
                         f"name its store with MLFLOW_TRACKING_URI, or move that folder away") from error
    if run.info.status == "RUNNING" and is_written_elsewhere(run.data.tags):
        raise InputError(f"run {note.run_id} is being written by process {run.data.tags['pid']}, which will "
                         f"send the rest itself")
    if note.status and "error" in run.data.tags:  # it may have been taken for killed meanwhile
        patiently(uri, client.delete_tag, run.info.run_id, "error")
    tracker = MlflowTracker(client, note.run_id, folder.parent, **_known(client, uri, run))
    tracker.finish(note.status or "KILLED")
    if folder.exists():
        raise InputError(f"{shown(uri)} still does not take everything of {folder}; try again")


def _param_texts(params: Mapping[str, Any]) -> tuple[dict[str, str], dict[str, str]]:
    """Parameters as MLflow takes them, by dotted name, and the files for those that are too long."""
    texts, files = {}, {}
    for name, value in _flat(params):
        text = str(value)
        if len(text) > LONGEST_PARAM:
            files[f"params/{name}.txt"] = text
            text = f"{len(text)} characters, sha256 {hashlib.sha256(text.encode()).hexdigest()}: see params/{name}.txt"
        texts[_checked_name("parameter", name, r"[\w\-. :]")] = text
    return texts, files


def _flat(params: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in params.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _checked_name(kind: str, name: str, character: str) -> str:
    """The name, if it is made of such characters (a regular expression) in segments between single slashes."""
    tidy = re.fullmatch(f"{character}+(/{character}+)*", name) and posixpath.normpath(name) == name
    if not tidy or name.startswith(".") or len(name) > LONGEST_NAME:
        raise InputError(f"{kind} names are letters, digits and '_', '-', '.', ' ' with single slashes between, up to "
                         f"{LONGEST_NAME} characters; got {name!r}")
    return name
