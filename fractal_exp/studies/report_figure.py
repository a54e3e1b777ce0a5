"""The figure of a sweep: a row of pictures for each row of the table, each sample whole and zoomed."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from PIL import Image, ImageDraw

from .. import tracking
from ..rendering.sheets import fitted, font_of, scaled
from .report import Sweep

LARGEST = 24  # rows of pictures
GAP = 6       # pixels between a picture and what is beside it
WIDEST = 220  # pixels of the column of row names
BACKGROUND, INK, EMPTY = (32, 32, 32), (225, 225, 225), 56
VIEWS = {"whole": "result", "zoomed": "zoomed"}                 # column heading -> the job's artifact
TARGETS = {"whole": "target", "zoomed": "zoomed_target"}


@dataclass(frozen=True)
class Pair:
    """The whole and the zoomed picture of one job (or None), and the line below them."""

    pictures: tuple[Image.Image | None, ...]
    caption: str


def figure(uri: str, sweep: Sweep, *, samples: int = 2, side: int = 160) -> np.ndarray | None:
    """(H,W,3) uint8: the targets in the first row, then each row of the table, two pictures for each of the first
    `samples` samples. None if no job finished. The pictures come from the store."""
    jobs = sweep.jobs[sweep.jobs["status"] == "FINISHED"]
    if not len(jobs):
        return None
    chosen = list(dict.fromkeys(jobs["sample"]))[:samples]
    rows = [("target", [Pair(_read(uri, jobs[jobs["sample"] == sample].iloc[0], TARGETS), "") for sample in chosen])]
    for row in list(dict.fromkeys(jobs["row"]))[:LARGEST]:
        of_row = jobs[jobs["row"] == row]
        rows.append((str(row), [_pair(uri, of_row[of_row["sample"] == sample]) for sample in chosen]))
    return drawn(f"{sweep.title}, {sweep.scale} scale", [str(sample) for sample in chosen], rows, side)


def drawn(title: str, samples: Sequence[str], rows: Sequence[tuple[str, list[Pair]]], side: int) -> np.ndarray:
    """(H,W,3) uint8: a sheet with a name and a pair for each sample in every row.

    The title is at the top, the sample and the two views above their columns, the name of a row on its left, the score
    below its pair. A text that is wider than its place is written smaller, or without its middle.
    """
    font = font_of(max(11, side // 13))
    line, pair = round(font.getbbox("Agjy_")[3]) + 3, 2 * (side + GAP)
    margin = 2 * GAP + min(WIDEST, max(math.ceil(font.getlength(name)) for name, _ in rows))
    heights = [side + (line if any(one.caption for one in pairs) else 0) + GAP for _, pairs in rows]
    y = 2 * GAP + 3 * line
    sheet = Image.new("RGB", (margin + len(samples) * pair, y + sum(heights)), BACKGROUND)
    pen = ImageDraw.Draw(sheet)

    def write(x: int, y: int, text: str, room: int) -> None:
        text, fitting = fitted(text, room, font)
        pen.text((x, y), text, fill=INK, font=fitting)

    write(GAP, GAP, title, sheet.width - 2 * GAP)
    lefts = [margin + number * pair for number in range(len(samples))]
    for left, sample in zip(lefts, samples, strict=True):
        write(left, y - 2 * line, sample, pair - GAP)
        for column, view in enumerate(VIEWS):
            write(left + column * (side + GAP), y - line, view, side)
    for (name, pairs), height in zip(rows, heights, strict=True):
        write(GAP, y, name, margin - 2 * GAP)
        for left, one in zip(lefts, pairs, strict=True):
            for column, picture in enumerate(one.pictures):
                shown = Image.new("L", (side, side), EMPTY) if picture is None else scaled(picture, side)
                sheet.paste(shown, (left + column * (side + GAP), y))
            write(left, y + side, one.caption, pair - GAP)
        y += height
    return np.asarray(sheet)


def _pair(uri: str, found: pd.DataFrame) -> Pair:
    """The pictures of the job for one row and sample, if there is one."""
    if not len(found):
        return Pair((None, None), "no result")
    job = found.iloc[0]
    return Pair(_read(uri, job, VIEWS), f"F1 {job['metric.f1']:.3f}")


def _read(uri: str, job: pd.Series, names: dict[str, str]) -> tuple[Image.Image | None, ...]:
    images = []
    for name in names.values():
        try:
            data = tracking.read_artifact(uri, job["run_id"], f"views/{name}.png")
        except Exception:  # a sweep over pictures has no zoomed views, and a lost file must not cost the figure
            images.append(None)
        else:
            images.append(Image.open(io.BytesIO(data)).convert("L"))
    return tuple(images)
