"""What a folder of fits says: tables as Markdown, and sheets of input, result and difference of every picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch

from fractal_exp.images.pixels import write_image
from fractal_exp.images.reading import read_target
from fractal_exp.rendering.sheets import comparison_strip

from . import fitting
from .sets import SETS

ROWS, SIDE = 16, 240        # of a sheet: pictures, and pixels of each
LARGE = 2                   # so many sheets at most have pictures of this size; more have half of it
# The first of these that a set has stands beside a picture.
MAIN_SCORES = ("iou", "sse", "f1_box", "f1_truth", "f1_light", "f1_input")
RESOLUTION = 256            # of `invert`, unless told otherwise


def write(kind: str, folder: Path) -> str:
    """Write report.md and the sheets of a folder; return the text. Raises SystemExit where there are no fits."""
    lines = fitting.read(folder)
    if not lines:
        raise SystemExit(f"{folder} holds no fits yet")
    order = list(SETS[kind].roles())
    lines.sort(key=lambda line: (_setting(line), order.index(line["picture"]) if line["picture"] in order else 0))
    text = [f"# {kind}: {len(lines)} fits", "",
            f"Fitted by {_all(lines, 'commit', 9)} on {_all(lines, 'machine')}."]
    for setting, group in groupby(lines, _setting):
        text += ["", *_section(kind, setting, list(group))]
    text = "\n".join(text) + "\n"
    (folder / "report.md").write_text(text)
    for old in folder.glob("sheet_*.png"):
        old.unlink()
    _sheets(kind, [line for line in lines if "error" not in line and line["picture"] in order], folder)
    return text


def _section(kind: str, setting: str, lines: list[dict[str, Any]]) -> list[str]:
    fits = pd.DataFrame([line for line in lines if "error" not in line])
    text = [f"## {setting}"]
    for role, rows in [*fits.groupby("role"), ("all", fits)] if len(fits) and fits["role"].nunique() > 1 else [
            (fits["role"].iloc[0], fits)] if len(fits) else []:
        text += ["", f"### Pictures: {role}"]
        for title, table in SETS[kind].tables(rows).items():
            if len(table):
                text += ["", f"**{title}**", "", *markdown(table)]
    failed = [f"- {line['picture']}: {line['error']}" for line in lines if "error" in line]
    return text + (["", "Failed, and in no table:", *failed] if failed else [])


def markdown(table: pd.DataFrame) -> list[str]:
    """A table as lines of Markdown."""
    cells = [[str(name) for name in table.columns], ["---"] * len(table.columns),
             *([("" if pd.isna(value) else str(value)) for value in row] for row in table.itertuples(index=False))]
    return [f"| {' | '.join(row)} |" for row in cells]


def _setting(line: dict[str, Any]) -> str:
    limit = f"{line['limit']:g} s by the {line['clock']} clock" if line["limit"] else "no limit"
    limit += ", begun with the true code" if line.get("from_truth") else ""
    return f"{limit}, {json.dumps(line['options'], sort_keys=True)}" if line["options"] else limit


def _all(lines: list[dict[str, Any]], key: str, length: int | None = None) -> str:
    return ", ".join(sorted({str(line[key])[:length] for line in lines}))


def _sheets(kind: str, lines: list[dict[str, Any]], folder: Path) -> None:
    """Sheets of sixteen pictures each, smaller ones where there are many."""
    side = SIDE if len(lines) <= LARGE * ROWS else SIDE // 2
    for number, first in enumerate(range(0, len(lines), ROWS)):
        fits = [(kind, line) for line in lines[first:first + ROWS]]
        write_image(folder / f"sheet_{number:02d}.png", sheet(fits, side))


def sheet(fits: Sequence[tuple[str, dict[str, Any]]], side: int = SIDE) -> np.ndarray:
    """Input, result and difference of fits, each given by its set and its line of the file, a row each: (H,W,3)
    uint8, with `side` pixels a picture."""
    shown = [_shown(kind, line) for kind, line in fits]
    captions = []
    for _, line in fits:
        captions.append(f"{line['picture']}, {line['maps']} maps, {_score(line)}")
    inputs, results = (torch.stack(images) for images in zip(*shown, strict=True))
    return comparison_strip(results, inputs, captions, side=side)


def _score(line: dict[str, Any]) -> str:
    """What stands beside a picture. In a cloud F1 tells little, so a density stands beside what chance gives the
    truth."""
    if "density_sse" in line:
        return f"density SSE {line['density_sse'] / line['floor_sse']:.3g} times the truth's"
    score = next(key for key in MAIN_SCORES if line.get(key) is not None)
    return f"{score} {line[score]:.3g}"


def _shown(kind: str, line: dict[str, Any]) -> tuple[torch.Tensor, torch.Tensor]:
    """What a fit was given, and what came of it."""
    chosen = SETS[kind]
    options = {**chosen.options, **line["options"]}
    read = read_target(chosen.picture(line["picture"]), options.get("resolution", RESOLUTION),
                       frame=options.get("frame", "fit"))
    image, result = chosen.shown(fitting.code_of(line), read.image.numpy())
    return _resized(image), _resized(result)


def _resized(image: np.ndarray) -> torch.Tensor:
    """An image at the resolution of most."""
    whole = torch.from_numpy(image.astype(np.float32))[None, None]
    return torch.nn.functional.interpolate(whole, size=(RESOLUTION, RESOLUTION), mode="area")[0, 0]
