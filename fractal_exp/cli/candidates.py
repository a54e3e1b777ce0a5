"""What `fractal-evaluate` is to judge: codes from files, folders and runs, each with its truth or its picture."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from .. import codes, tracking
from ..errors import InputError
from ..ifs.code import IFS
from ..runtime.files import check_file
from ..suite import SUITE_COUNT, SUITE_SEED, random_suite
from . import records
from .code_names import file_and_name, read_code
from .records import Aim, Read


@dataclass(frozen=True, eq=False)
class Submission:
    """A recovered code, what to call it, and what it was to be: a code, or the picture that it was fitted to."""

    name: str
    code: IFS
    aim: Aim


def gather(sources: list[str], truth: str | None, output: str | Path) -> list[Submission]:
    """All codes that `sources` name: files, FILE:NAME for one of several codes, folders of JSON files, folders of fits,
    run:ID in the store of `output`.

    truth: a code (`read_code`) for all of them, a classic with its probabilities by area, as targets are drawn unless
    told otherwise; a folder with a JSON of the same name for each; suite or suite:all:SEED for the fractal of the
    random suite that the digits of each name tell; None for what the fits themselves say. Raises `InputError` if a
    code or its truth cannot be found, or two codes have one name.
    """
    found = [candidate for source in sources for candidate in _candidates(source, truth, output)]
    names = [candidate.name for candidate in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two codes are called {name!r}; evaluate them one after another")
    return found


def unfinished(sources: list[str]) -> list[str]:
    """The names of the fits in the folders among `sources` that were begun and are not finished."""
    folders = [Path(source).absolute() for source in sources if not source.startswith("run:")]
    return [record.parent.name for folder in folders for pattern in (records.CONFIG, f"*/{records.CONFIG}")
            for record in sorted(folder.glob(pattern)) if not (record.parent / records.FINISHED).exists()]


def without_code(sources: list[str]) -> list[str]:
    """The names of the finished fits in the folders among `sources` whose method finds no code."""
    folders = [Path(source).absolute() for source in sources if not source.startswith("run:")]
    return [record.parent.name for folder in folders for pattern in (records.ENLARGED, f"*/{records.ENLARGED}")
            for record in sorted(folder.glob(pattern)) if _finished_without_code(record.parent)]


def _finished_without_code(folder: Path) -> bool:
    return all((folder / name).exists() == there for name, there in (
        (records.FINISHED, True), (records.ENLARGED, True), (records.CODE, False)))


def _candidates(source: str, truth: str | None, output: str | Path) -> Iterator[Submission]:
    if source.startswith("run:"):
        run_id = source.removeprefix("run:")
        yield _fit(run_id, f"run {run_id}", _run_reader(run_id, output), truth)
        return
    path = Path(source).absolute()
    if not path.is_dir():
        path, entry = file_and_name(source)
        name = path.stem if entry is None else entry.removeprefix("#")
        yield Submission(name, IFS.load(path, entry), _aim(name, truth))
        return
    finished = [path] if (path / records.FINISHED).exists() else sorted(
        record.parent for record in path.glob(f"*/{records.FINISHED}"))
    coded = [folder for folder in finished if not _finished_without_code(folder)]
    if finished and not coded:
        raise InputError(f"{path} holds no code, but images that were enlarged; fractal-train has judged them, see "
                         "per_view.csv beside them")
    for folder in coded:
        yield _fit(folder.name, str(folder), _folder_reader(folder), truth)
    files = [] if finished else sorted(path.glob("*.json"))
    if not finished and not files:
        raise InputError(f"{path} holds neither codes (*.json) nor finished fits (*/{records.FINISHED})")
    for file in files:
        yield Submission(file.stem, IFS.load(file), _aim(file.stem, truth))


def _fit(name: str, where: str, read: Read, truth: str | None) -> Submission:
    code = records.read_code(read, records.CODE, where)
    if code is None:
        raise InputError(f"{where} holds no {records.CODE}")
    return Submission(name, code, records.read_aim(read, where) if truth is None else _aim(name, truth))


def _folder_reader(folder: Path) -> Read:
    def read(name: str) -> bytes | None:
        try:
            if not (folder / name).exists():
                return None
            return check_file(folder / name, "the fit's file", records.most_bytes(name)).read_bytes()
        except OSError as error:
            raise InputError(f"cannot read {folder / name}: {error.strerror}") from error
    return read


def _run_reader(run_id: str, output: str | Path) -> Read:
    database = Path(output).absolute() / "mlflow.db"
    if not (database.exists() or os.environ.get("MLFLOW_TRACKING_URI")):
        raise InputError(f"no runs are kept in {database.parent}; name the output folder of the fits with --output")
    uri = tracking.prepare_store(output)

    def read(name: str) -> bytes | None:
        try:
            return tracking.read_artifact(uri, run_id, name, records.most_bytes(name))
        except tracking.NoArtifact:
            return None
        except InputError:
            raise
        except Exception as error:  # MLflow's own kinds, by version
            raise InputError(f"cannot read run {run_id!r}: {str(error).splitlines()[0]}") from error
    return read


def _aim(name: str, truth: str | None) -> Aim:
    if truth is None:
        raise InputError(f"what should {name} be? Name its truth: --truth suite, a folder, or a code")
    if re.fullmatch(r"suite(:all:\d+)?", truth):
        return Aim(_of_the_suite(name, int(truth.rpartition(":")[2]) if ":" in truth else SUITE_SEED))
    if Path(truth).is_dir() and not (Path(truth) / "code.json").exists():
        return Aim(IFS.load(Path(truth) / f"{name}.json"))
    code = read_code(truth)
    return Aim(replace(code, probabilities=None) if truth in codes.names() and not Path(truth).exists() else code)


def _of_the_suite(name: str, seed: int) -> IFS:
    digits = re.findall(r"\d+", name)
    if not digits or int(digits[-1]) >= SUITE_COUNT:
        raise InputError(f"{name!r} does not end in the number of a fractal of the suite, as in 007.json")
    return random_suite(int(digits[-1]) + 1, seed)[-1]
