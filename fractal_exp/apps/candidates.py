"""What `fractal-evaluate` is to judge: codes from files, folders and runs, each with its truth."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .. import tracking
from ..errors import InputError
from ..ifs import IFS
from ..suite import SUITE_COUNT, SUITE_SEED, random_suite
from .commands import read_code

FIT_RECORD = "finished.json"
TARGETS = "fractal_exp.targets."


@dataclass(frozen=True)
class Candidate:
    """A recovered code, what to call it, and the code that it ought to be."""

    name: str
    code: IFS
    truth: IFS


def gather(sources: list[str], truth: str | None, output: str | Path) -> list[Candidate]:
    """All codes that `sources` name: JSON files, folders of them, folders of fits, run:ID in the store of `output`.

    truth: a code (`read_code`) for all of them; a folder with a JSON of the same name for each; suite or suite:all:SEED
    for the fractal of the random suite that the digits of each name tell; None where a fit's record tells. Raises
    `InputError` if a code or its truth cannot be found, or two codes have one name.
    """
    found = [Candidate(name, code, _truth(truth, name, record)) for source in sources
             for name, code, record in _codes(source, output)]
    names = [candidate.name for candidate in found]
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"two codes are called {name!r}; evaluate them one after another")
    return found


def _codes(source: str, output: str | Path) -> Iterator[tuple[str, IFS, Mapping[str, Any] | None]]:
    """Name, code and, if a fit made it, its target's configuration."""
    if source.startswith("run:"):
        yield _run(source.removeprefix("run:"), output)
        return
    path = Path(source).absolute()
    if not path.is_dir():
        yield path.stem, IFS.load(path), None
        return
    fits = [path] if (path / FIT_RECORD).exists() else sorted(record.parent for record in path.glob(f"*/{FIT_RECORD}"))
    for fit in fits:
        record = json.loads((fit / FIT_RECORD).read_text())
        yield fit.name, IFS.load(fit / "code.json"), record["identity"]["target"]
    files = [] if fits else sorted(path.glob("*.json"))
    if not fits and not files:
        raise InputError(f"{path} holds neither codes (*.json) nor finished fits (*/{FIT_RECORD})")
    for file in files:
        yield file.stem, IFS.load(file), None


def _run(run_id: str, output: str | Path) -> tuple[str, IFS, Mapping[str, Any]]:
    from omegaconf import OmegaConf

    database = Path(output).absolute() / "mlflow.db"
    if not (database.exists() or os.environ.get("MLFLOW_TRACKING_URI")):
        raise InputError(f"no runs are kept in {database.parent}; name the output folder of the fits with --output")
    uri = tracking.prepare_store(output)
    try:
        code, config = (tracking.read_artifact(uri, run_id, name) for name in ("code.json", "config.yaml"))
    except InputError:
        raise
    except Exception as error:  # MLflow's own kinds, by version
        raise InputError(f"cannot read run {run_id!r}: {str(error).splitlines()[0]}") from error
    return run_id, IFS.from_json(json.loads(code)), OmegaConf.to_container(OmegaConf.create(config.decode()).target)


def _truth(truth: str | None, name: str, record: Mapping[str, Any] | None) -> IFS:
    if truth is None and record is not None:
        return _recorded(name, record)
    if truth is None:
        raise InputError(f"what should {name} be? Name its truth: --truth suite, a folder, or a code")
    if re.fullmatch(r"suite(:all:\d+)?", truth):
        return _of_the_suite(name, int(truth.rpartition(":")[2]) if ":" in truth else SUITE_SEED)
    if Path(truth).is_dir() and not (Path(truth) / "code.json").exists():
        return IFS.load(Path(truth) / f"{name}.json")
    return read_code(truth)


def _recorded(name: str, target: Mapping[str, Any]) -> IFS:
    from omegaconf import OmegaConf

    from . import configuration

    if not str(target.get("_target_", "")).startswith(TARGETS):  # a record is data: it must not call what it likes
        raise InputError(f"the record of {name} names no target of this package: {target.get('_target_')!r}")
    source = configuration.build(OmegaConf.create(dict(target)))
    if not isinstance(getattr(source, "code", None), IFS):
        raise InputError(f"{name} was fitted to a picture, whose code nobody knows; name a truth with --truth, or look "
                         "at the fit's own scores")
    return source.code


def _of_the_suite(name: str, seed: int) -> IFS:
    digits = re.findall(r"\d+", name)
    if not digits or int(digits[-1]) >= SUITE_COUNT:
        raise InputError(f"{name!r} does not end in the number of a fractal of the suite, as in 007.json")
    return random_suite(int(digits[-1]) + 1, seed)[-1]
