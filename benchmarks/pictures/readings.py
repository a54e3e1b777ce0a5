"""How well the pictures of a set are read, without any fit: a table and a sheet."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import torch
from tqdm import tqdm

from fractal_exp.errors import InputError
from fractal_exp.images.pixels import write_image
from fractal_exp.images.reading import ReadImage, read_target
from fractal_exp.rendering.sheets import comparison_strip

from .. import archive
from ..record import machine
from .judging import f1_within_a_pixel, shape_of
from .report import markdown
from .seen import Seen

RESOLUTION, SIDE = 256, 160
GOOD = {"f1": 0.95, "tone": 0.9, "frame": 0.97}   # of a picture that is read well


def write(kind: str, seen: Callable[[str], Seen], names: Sequence[str], folder: Path) -> str:
    """Read the pictures, write reading.md and reading.png into a folder, and return the text.

    f1: F1 within a pixel of the shape as it was read and as it was drawn; tone: the correlation of their grey levels;
    frame: the side of what fills the canvas over what would if the shape stood alone, or its inverse, at most 1. well:
    whether all three are as in `GOOD`, and nothing is taken to be cut off.
    """
    rows, strips = [], []
    for name in tqdm(names, "reading", unit="picture"):
        picture = seen(name)
        try:
            read = read_target(picture.source, RESOLUTION)
        except InputError as error:
            rows.append({"picture": name, "f1": 0.0, "tone": 0.0, "frame": 0.0, "well": False, "warning": str(error)})
            continue
        rows.append({"picture": name, **_likeness(picture, read), "warning": "; ".join(read.warnings)})
        rows[-1]["well"] = read.known is None and all(rows[-1][key] >= least for key, least in GOOD.items())
        strips.append((f"{name} F1 {rows[-1]['f1']:.3f}", read.image, torch.from_numpy(picture.shown(read)).float()))
    table = pd.DataFrame(rows)
    means = table.assign(kind=table["picture"].str.partition("-")[0]).groupby("kind", sort=False).agg(
        n=("well", "size"), f1=("f1", "mean"), tone=("tone", "mean"), frame=("frame", "mean"), well=("well", "sum"))
    commit, well = archive.here()["commit"][:9], int(table["well"].sum())
    text = "\n".join([
        f"# {kind}: {len(table)} pictures as they are read", "",
        f"Read by {commit} on {machine()}. {well} of {len(table)} are read well.", "",
        *markdown(means.round(3).reset_index()), "",
        *markdown(table.round(3)[["picture", "f1", "tone", "frame", "well", "warning"]])])
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "reading.md").write_text(f"{text}\n")
    captions, found, true = zip(*strips, strict=True)
    write_image(folder / "reading.png", comparison_strip(torch.stack(found), torch.stack(true), captions, side=SIDE))
    return text


def _likeness(picture: Seen, read: ReadImage) -> dict[str, float]:
    """f1, tone and frame of a picture, see `write`."""
    found, true = read.image.numpy(), picture.shown(read)
    tone = float(np.corrcoef(found.ravel(), true.ravel())[0, 1]) if found.std() and true.std() else 0.0
    alone = read_target(picture.alone, RESOLUTION, invert=False).placement
    ratio = read.placement.side / alone.side
    return {"f1": f1_within_a_pixel(shape_of(found), shape_of(true)), "tone": tone, "frame": min(ratio, 1 / ratio)}
