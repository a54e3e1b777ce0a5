"""What the studio writes: a folder for each code that is saved, and a tracked run where MLflow is there."""

from __future__ import annotations

import re
import time
from pathlib import Path

from ..errors import InputError
from ..inversion import Inversion
from ..runtime.extras import need
from ..runtime.files import explain

STUDY = "studio"
RENDERING = 1024         # pixels a side
LARGEST_OVERLAY = 4096   # pixels of the picture's longer side
PAGE = "code.html"


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


def write(found: Inversion, folder: Path) -> list[str]:
    """Write what is known of a code into a folder, and return the names of the files.

    They are code.json, inversion.json, target.png, rendering.png, code.html unless a code is too large for a page, and
    overlay.png unless the picture is too large. Raises `InputError` where a file cannot be written.
    """
    found.save(folder)
    found.render(resolution=RENDERING, path=folder / "rendering.png")
    names = ["code.json", "inversion.json", "target.png", "rendering.png"]
    try:
        found.code.save_html(folder / PAGE)
        names.append(PAGE)
    except InputError:
        pass  # more maps than a page shows
    if max(found.placement.size) <= LARGEST_OVERLAY:
        found.overlay(folder / "overlay.png")
        names.append("overlay.png")
    return names


def track(found: Inversion, folder: Path, names: list[str], output: Path, name: str) -> str:
    """Keep what was written into `folder` as a run of the study "studio"; returns where, in words.

    The store is in `output`, or the server that MLFLOW_TRACKING_URI names. Raises `InputError` where MLflow is not
    installed or the store cannot be used.
    """
    need("mlflow", "pandas")
    from .. import tracking

    uri = tracking.prepare_store(output)
    tags = tracking.standard_tags(variant="full", method=found.method, target=name, scale="studio", backend="cpu",
                                  device="cpu")
    with tracking.start_run(uri, STUDY, folder.name, folder=folder, tags=tags | {"folder": folder.name},
                            params={"method": found.method, "seconds": found.options.get("seconds"),
                                    "seed": found.options.get("seed"), "maps": found.options.get("maps")},
                            note=f"**{name}** in the studio: {found.verdict.words}") as run:
        run.log({"likeness/f1": found.likeness.f1, "likeness/iou": found.likeness.iou,
                 "likeness/f1_1px": found.likeness.f1_1px, "likeness/maps": len(found.code),
                 "time/fit_seconds": found.seconds})
        for each in names:
            run.artifact(each, folder / each)
    return f"python -m fractal_exp.tracking dashboard '{output}' --study {STUDY}"
