"""Everything a fit needs to go on, as tensors and JSON in one safetensors file."""

from __future__ import annotations

import itertools
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, TypeVar

import torch
from pydantic import Field
from torch import Tensor

from ..errors import InputError
from .checks import shown
from .files import checked, parse_record, read_file, write_atomically
from .tensors import differences, packed, unpacked, word

FORMAT = "fractal-exp/checkpoint/3"
MOST = 2**53  # iterations


T = TypeVar("T")


@dataclass(frozen=True)
class Snapshot:
    """The state before `iteration`: named tensors and JSON numbers."""

    iteration: int
    tensors: Mapping[str, Tensor]
    numbers: Mapping[str, Any] = field(default_factory=dict)

    def like(self, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """Its tensors, each on the device of the one in `tensors` that it takes the place of. Raises `InputError`
        unless names, shapes and types are the same, and on a NaN."""
        wrong = differences(self.tensors, tensors) or [
            f"{name} has a NaN" for name, value in self.tensors.items() if bool(value.isnan().any())]
        if wrong:
            raise InputError(f"the checkpoint is of another search ({'; '.join(wrong[:4])}); use the settings that it "
                             "was made with, or start afresh with resume=false")
        return {name: self.tensors[name].to(value.device) for name, value in tensors.items()}

    def holds(self, prefix: str) -> bool:
        """Whether the names of any of its tensors begin so."""
        return any(name.startswith(prefix) for name in self.tensors)

    def checked(self, schema: type[T], *, finite: bool = True) -> T:
        """Its numbers as the type that says what they may be, see `files.checked`. Raises `InputError`."""
        return checked(dict(self.numbers), schema, "the checkpoint", "start afresh with resume=false", finite=finite)


def under(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names begin so, by the rest of their names."""
    return {name.removeprefix(prefix): value for name, value in tensors.items() if name.startswith(prefix)}


def moments(parameters: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Tensors like those that Adam keeps of each of these parameters."""
    return {f"{name}/{key}": torch.zeros(()) if key == "step" else value for name, value in parameters.items()
            for key in ("step", "exp_avg", "exp_avg_sq")}


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
        """Write atomically: at any moment the file on disk is a whole one, the old or the new.

        Raises `InputError` where it cannot be written, as on a full disk; the file before stays.
        """
        notes = {"iteration": snapshot.iteration, "numbers": dict(snapshot.numbers),
                 "identity": dict(self.identity)}
        tensors = {name: tensor.detach().cpu() for name, tensor in snapshot.tensors.items()}
        self.first()
        self.path.parent.mkdir(parents=True, exist_ok=True)
        try:
            write_atomically(self.path, packed(tensors, FORMAT, "notes", json.dumps(notes)))
        except InputError as error:
            raise InputError(f"{error}; what was saved before stays, and resume=true goes on from it") from error

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


@dataclass
class _Notes:
    iteration: Annotated[int, Field(ge=0, lt=MOST)]
    numbers: dict[str, Any]
    identity: dict[str, Any]


def read(path: Path) -> tuple[Snapshot, dict[str, Any]]:
    """A checkpoint's snapshot and identity. Raises `InputError` if it is no whole checkpoint of this layout."""
    data = read_file(path, "the checkpoint")
    try:
        tensors, note, _ = unpacked(data, FORMAT, "notes", "it")
        notes = parse_record(note, _Notes, "what it tells", "it is no checkpoint")
    except InputError as error:
        raise InputError(f"cannot read the checkpoint {path}: {error}; delete it to start afresh") from error
    return Snapshot(notes.iteration, tensors, notes.numbers), notes.identity


def compare(old: Any, new: Any, path: str = "") -> list[str]:
    """Where two pieces of plain data differ, each in one short line: 'key: old there, new now'."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        keys = sorted(set(old) | set(new))
        return [line for key in keys for line in
                compare(old.get(key, "absent"), new.get(key, "absent"), f"{path}.{word(key)}" if path else word(key))]
    return [] if old == new else [f"{path}: {shown(old)} there, {shown(new)} now"]
