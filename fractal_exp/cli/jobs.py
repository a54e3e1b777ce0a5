"""One job of a sweep, as it runs in a worker: named by what varies, alone in its folder, its outcome left in a file."""

from __future__ import annotations

import contextlib
import hashlib
import json
import re
import sys
import time
import traceback
from collections.abc import Collection, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from hydra.core.hydra_config import HydraConfig
from hydra.utils import get_method
from omegaconf import DictConfig

from ..runtime import parent, threads
from ..runtime.files import alone_in, read_record, write_atomically
from ..tracking.addresses import shown
from . import configuration
from .runs import NoRuns

FINISHED, FAILED = "finished", "failed"
LONGEST_NAME = 120


@dataclass(frozen=True)
class Outcome:
    """How a job ended: its status, which row and sample of the table it counts for, its scores or its traceback.

    again: it was finished before, and nothing was done.
    """

    status: str
    row: str
    sample: str
    seconds: float
    scores: dict[str, float] = field(default_factory=dict)
    again: bool = False
    reason: str = ""
    traceback: str = ""

    @staticmethod
    def path(folder: Path) -> Path:
        return folder / "outcome.json"

    @classmethod
    def read(cls, folder: Path) -> Outcome | None:
        """The outcome left in a job's folder, or None."""
        path = cls.path(folder)
        return read_record(path, "the outcome of a job", cls) if path.exists() else None

    def write(self, folder: Path) -> None:
        write_atomically(self.path(folder), json.dumps(asdict(self), indent=1).encode())


def job_name(overrides: Sequence[str], keys: Collection[str]) -> str:
    """A file name that says what varies: the overrides of `keys`, in their order; long ones are cut, with a digest."""
    text = ",".join(override for override in overrides if override.split("=", 1)[0] in keys) or "only"
    name = re.sub(r"[^\w.=,+-]", "-", text)
    if name == text and len(name) <= LONGEST_NAME:
        return name
    return f"{name[:LONGEST_NAME]}-{hashlib.sha256(text.encode()).hexdigest()[:6]}"


def run_job(config: DictConfig) -> str:
    """Fit as configured, or skip what is finished; the outcome's status. What it prints goes to log.txt in its folder.

    A failure is an outcome too: it is noted, tracked and does not stop the other jobs.
    """
    parent.follow(config.sweep.parent)
    name = job_name(HydraConfig.get().overrides.task, config.sweep.varies)
    config.output = str(Path(config.output).expanduser().absolute())
    folder = Path(config.output) / config.study / config.sweep.folder / name
    config.name = f"{config.sweep.folder}/{name}"
    if config.threads is None:  # the cores' share of each worker
        config.threads = max(1, threads.available() // config.sweep.workers)
    row, sample = (_label(config, key, name) for key in ("row", "sample"))
    start = time.perf_counter()
    # A worker may outlive the parent that was killed: then the same job waits here for it.
    with alone_in(folder, wait=True), _printing_to(folder / "log.txt"):
        again = (folder / "finished.json").exists()
        try:
            scores = get_method(config.task)(config)
            outcome = Outcome(FINISHED, row, sample, time.perf_counter() - start, scores, again)
        except Exception as error:
            told = shown(traceback.format_exc())
            print(told, file=sys.stderr)
            outcome = Outcome(FAILED, row, sample, time.perf_counter() - start,
                              reason=shown(f"{type(error).__name__}: {error}"), traceback=told)
            _track_failure(config, row, sample, folder, error)
        outcome.write(folder)
    return outcome.status


def _label(config: DictConfig, key: str, otherwise: str) -> str:
    try:
        return str(config.sweep[key])
    except Exception:  # of whatever kind: the fit itself will say what is wrong with the configuration
        return otherwise


def _track_failure(config: DictConfig, row: str, sample: str, folder: Path, error: BaseException) -> None:
    try:
        runs: NoRuns = configuration.build(config.tracking)
        settings = {key: config[key] for key in ("study", "output")}
        sweep = {"run": config.sweep.run, "folder": config.sweep.folder, "row": row, "sample": sample}
        runs.fail(settings | {"sweep": sweep}, folder, error)
    except Exception:  # the outcome's file tells the parent in any case
        print(shown(traceback.format_exc()), file=sys.stderr)


@contextlib.contextmanager
def _printing_to(path: Path) -> Iterator[None]:
    with open(path, "a", buffering=1) as log, contextlib.redirect_stdout(log), contextlib.redirect_stderr(log):
        yield


def describe_scores(outcome: Outcome) -> str:
    """The scores of a finished job in a few words."""
    names = {"eval/f1": "F1", "eval/iou": "IoU", "eval/psnr": "PSNR"}
    return "  ".join(f"{title} {outcome.scores[name]:.3f}" for name, title in names.items() if name in outcome.scores)
