"""Everything a fit needs to go on, as tensors and JSON in one safetensors file."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from torch import Tensor

from .errors import InputError

FORMAT = "fractal-exp/checkpoint/1"


@dataclass(frozen=True)
class Snapshot:
    """The state before `iteration`: named tensors and JSON numbers."""

    iteration: int
    tensors: Mapping[str, Tensor]
    numbers: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Checkpoint:
    """Where and how often a fit saves itself.

    path: the file; every: iterations between two saves; identity: the resolved configuration as plain data, which a
    file must share to be resumed; resume: whether to go on from the file, if there is one; first: called at every save
    before the file counts, so that nothing else is behind it if the process is killed.
    """

    path: Path
    every: int = 500
    identity: Mapping[str, Any] = field(default_factory=dict)
    resume: bool = False
    first: Callable[[], object] = lambda: None

    def __post_init__(self) -> None:
        if self.every < 1:
            raise InputError(f"a checkpoint is saved every so many iterations, at least 1, got {self.every}")

    def save(self, snapshot: Snapshot) -> None:
        """Write atomically: at any moment the file on disk is a whole one, the old or the new."""
        from safetensors.torch import save

        notes = {"format": FORMAT, "iteration": snapshot.iteration, "numbers": dict(snapshot.numbers),
                 "identity": dict(self.identity)}
        # Clones, as the file format takes no two tensors that share memory.
        tensors = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in snapshot.tensors.items()}
        self.first()
        write_atomically(self.path, save(tensors, metadata={"notes": json.dumps(notes)}))

    def load(self) -> Snapshot | None:
        """The saved snapshot, or None where nothing is to be resumed.

        Raises `InputError` if the file is damaged or was made by another configuration, naming what differs.
        """
        if not self.resume or not self.path.exists():
            return None
        snapshot, identity = read(self.path)
        differences = compare(identity, json.loads(json.dumps(dict(self.identity))))
        if differences:
            raise InputError(f"{self.path} was made by another configuration: {'; '.join(differences[:4])}"
                             f"{' …' if len(differences) > 4 else ''}. Use the same settings, or start afresh with "
                             "resume=false")
        return snapshot

    def set_aside(self) -> Path | None:
        """Rename an unfinished fit's file that is not to be resumed, so that it is not lost; its new path."""
        if self.resume or not self.path.exists():
            return None
        names = (self.path.with_suffix(f".previous-{i}{self.path.suffix}") for i in itertools.count(1))
        aside = next(name for name in names if not name.exists())
        os.replace(self.path, aside)
        return aside


def read(path: Path) -> tuple[Snapshot, dict[str, Any]]:
    """A checkpoint's snapshot and identity. Raises `InputError` if it is no whole checkpoint of this version."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, "pt") as file:
            notes = json.loads((file.metadata() or {}).get("notes", "{}"))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (OSError, SafetensorError, ValueError) as error:
        raise InputError(f"cannot read the checkpoint {path}: {error}; delete it to start afresh") from error
    if notes.get("format") != FORMAT:
        raise InputError(f"{path} is no checkpoint of this version (expected {FORMAT!r}, got {notes.get('format')!r}); "
                         "delete it to start afresh")
    return Snapshot(notes["iteration"], tensors, notes["numbers"]), notes["identity"]


def compare(old: Any, new: Any, path: str = "") -> list[str]:
    """Where two pieces of plain data differ, as 'key: old -> new'."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        keys = sorted(set(old) | set(new))
        return [line for key in keys for line in
                compare(old.get(key, "absent"), new.get(key, "absent"), f"{path}.{key}" if path else key)]
    return [] if old == new else [f"{path}: {old!r} there, {new!r} now"]


def write_atomically(path: Path, data: bytes) -> None:
    """Write a whole file or none, even if the power fails."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.partial")
    try:
        with open(partial, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
