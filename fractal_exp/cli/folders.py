"""The folder of one fit: what lies in it, and whether the fit is finished."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..errors import InputError
from ..ifs.code import IFS
from ..images.pixels import write_image
from ..runtime.checkpoint import Checkpoint, compare
from ..runtime.files import alone_in, read_record, remove_partial, write_atomically
from ..tracking.addresses import shown

FINISHED, CONFIG, RUN = "finished.json", "config.yaml", "run.json"
CODE, TRUTH, PICTURE = "code.json", "truth.json", "target.png"
ENLARGED = "enlarged.png"  # in place of a code, where the method found none
WHITE = 65535  # of 16 bits


@dataclass
class _Finished:
    identity: dict[str, Any]
    scores: dict[str, float]


@dataclass
class _Run:
    uri: str
    run_id: str | None


@dataclass(frozen=True)
class FitFolder:
    """truth.json or target.png, config.yaml, code.json, code.html, inversion.json (all that is known of the code) and
    its pictures, course.json (quality over time, where a sweep asks for it), per_view.csv, views/,
    checkpoint.safetensors while the fit runs, finished.json after."""

    path: Path

    @classmethod
    def open(cls, parent: Path, name: str) -> FitFolder:
        """Make the folder if need be. Raises `InputError` if it cannot be made or written."""
        folder = cls(Path(parent).absolute() / name)
        try:
            folder.views.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder.path).close()  # of a name of its own, as fits may start together
        except OSError as error:
            raise InputError(f"cannot write to the output folder {folder.path}: {error.strerror}; choose another with "
                             "output=FOLDER, study=STUDY or name=NAME") from error
        return folder

    def alone(self) -> AbstractContextManager[None]:
        """Keep other fits out of the folder. Raises `InputError` if one is at work in it."""
        remedy = "wait until it has ended, or choose another folder with name=NAME or output=FOLDER"
        return alone_in(self.path, wait=False, remedy=remedy)

    @property
    def views(self) -> Path:
        return self.path / "views"

    @property
    def checkpoint(self) -> Path:
        return self.path / "checkpoint.safetensors"

    def checkpoint_of(self, what: str, every: int, identity: Mapping[str, Any], resume: bool) -> Checkpoint:
        """The checkpoint that is to go on, or a new one; that of an unfinished `what` is then set aside. Raises
        `InputError` if it is damaged or of another configuration."""
        checkpoint = Checkpoint(self.checkpoint, every, identity, resume)
        checkpoint.load()
        if aside := checkpoint.set_aside():
            print(f"an unfinished {what} was there; its checkpoint is kept as {aside}")
        return checkpoint

    def finished_scores(self, identity: Mapping[str, Any]) -> dict[str, float] | None:
        """The scores of a finished fit of this identity, or None. Raises `InputError` if another one finished here."""
        path = self.path / FINISHED
        if not path.exists():
            return None
        finished = read_record(path, "the record of a finished fit", _Finished)
        differences = compare(finished.identity, json.loads(json.dumps(identity)))
        if differences:
            raise InputError(f"{self.path} holds a fit of another configuration: {'; '.join(differences[:4])}. Choose "
                             "another name=NAME, or delete the folder (fractal-evaluate scores a finished code anew)")
        return finished.scores

    def finish(self, identity: Mapping[str, Any], scores: Mapping[str, float]) -> None:
        """Mark the fit as finished; its checkpoint has served."""
        write_atomically(self.path / FINISHED, json.dumps({"identity": identity, "scores": scores}, indent=1).encode())
        self.checkpoint.unlink(missing_ok=True)

    def begin(self, config: str) -> None:
        """Note the configuration (YAML) of the fit that begins, forget that an earlier one finished here, and remove
        what a killed one had not finished writing."""
        for each in (self.path, self.views):
            remove_partial(each)
        write_atomically(self.path / CONFIG, config.encode())
        (self.path / FINISHED).unlink(missing_ok=True)

    def keep_target(self, image: Tensor, truth: IFS | None) -> Path:
        """Keep what the fit is to find, its path: the code that drew the target in truth.json, or else the picture
        (R,R) in target.png, of 16 bits, where no lit pixel becomes black."""
        kept, other = (self.path / name for name in ((TRUTH, PICTURE) if truth is not None else (PICTURE, TRUTH)))
        other.unlink(missing_ok=True)
        if truth is not None:
            write_atomically(kept, (json.dumps(truth.to_json(), indent=1) + "\n").encode())
            return kept
        levels = torch.maximum((image.double() * WHITE).round(), (image > 0).double()).numpy().astype(np.uint16)
        return write_image(kept, levels, bits=16)

    def keep_course(self, points: Sequence[Mapping[str, float]], seconds: float, f1: float) -> Path:
        """Keep the F1 of the codes on the way, and that of the result, as course.json: a list of seconds, step and f1.
        The result has the last step, if any is known."""
        path = self.path / "course.json"
        last = {"step": points[-1]["step"]} if points else {}
        finite = [*points, {"seconds": seconds, **last, "f1": f1}]
        write_atomically(path, json.dumps([point for point in finite if np.isfinite(point["f1"])], indent=1) + "\n")
        return path

    def remember_run(self, uri: str, run_id: str | None) -> None:
        """Keep which MLflow run this fit logs to, so that a resumed fit goes on with it; no password is written."""
        write_atomically(self.path / RUN, json.dumps({"uri": shown(uri), "run_id": run_id}).encode())

    def run_to_resume(self, uri: str) -> str | None:
        """The run that the interrupted fit logged to in this store, or None."""
        if not ((self.path / RUN).exists() and self.checkpoint.exists()):
            return None
        run = read_record(self.path / RUN, "the record of the MLflow run", _Run)
        return run.run_id if shown(run.uri) == shown(uri) else None
