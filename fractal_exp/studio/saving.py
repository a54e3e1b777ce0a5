"""What the studio writes: a folder for each code that is saved, and a tracked run where MLflow is there."""

from __future__ import annotations

import re
import shutil
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..inversion import Inversion, write
from ..runtime.extras import need
from ..runtime.files import explain
from .reading import Picture

STUDY = "studio"


def new_folder(output: Path, name: str) -> Path:
    """A new folder in `output`, called by the time and by what is plain in `name`. Raises `InputError`."""
    plain = re.sub(r"[^a-z0-9]+", "-", Path(name).stem.lower()).strip("-")[:40] or "picture"
    first = f"{time.strftime('%Y%m%d-%H%M%S')}-{plain}"
    for attempt in range(1000):
        folder = output / (first if attempt == 0 else f"{first}-{attempt + 1}")
        try:
            folder.mkdir(parents=True)
            return folder
        except FileExistsError:
            continue
        except OSError as error:
            raise InputError(f"cannot make the folder {explain(error, folder)}") from error
    raise InputError(f"{output} has a thousand folders called {first}; move some of them away")


def save(found: Inversion, picture: Picture, output: Path) -> dict[str, Any]:
    """Write a code into a new folder in `output`: {folder, names}. The code says on which picture it was found, by name
    and digest. Raises `InputError` if not all can be written; nothing of it is left then."""
    folder = new_folder(output, picture.name)
    meta = {**found.code.meta, "picture": {"name": picture.name, "sha256": picture.digest}}
    try:
        names = write(replace(found, code=replace(found.code, meta=meta)), folder)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return {"folder": str(folder), "names": names}


def track(found: Inversion, folder: Path, names: list[str], output: Path, name: str) -> str:
    """Keep what was written into `folder` as a run of the study "studio"; returns where, in words.

    The store is in `output`, or the server that MLFLOW_TRACKING_URI names. Raises `InputError` where MLflow is not
    installed or the store cannot be used.
    """
    need("mlflow", "pandas", "tenacity")
    from .. import tracking

    uri = tracking.prepare_store(output)
    tags = tracking.standard_tags(variant="full", method=found.method, target=name, scale="studio", backend="cpu",
                                  device="cpu")
    with tracking.start_run(uri, STUDY, folder.name, folder=folder, tags=tags | {"folder": folder.name},
                            params={"method": found.method, "seconds": found.options.get("seconds"),
                                    "seed": found.options.get("seed"), "maps": found.options.get("maps")},
                            note=f"**{name}** in the studio: {found.verdict.words}") as run:
        figures = {name: getattr(found.likeness, name) for name in ("f1", "iou", "f1_1px", "ssim", "f1_dark")}
        run.log({f"likeness/{name}": value for name, value in figures.items() if value is not None}
                | {"likeness/maps": len(found.code), "time/fit_seconds": found.seconds})
        for each in names:
            run.artifact(each, folder / each)
    return f"python -m fractal_exp.tracking dashboard '{output}' --study {STUDY}"
