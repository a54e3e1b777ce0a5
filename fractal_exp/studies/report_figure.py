"""The figure of a sweep: a row of pictures for each row of the table, each sample whole and zoomed."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .. import tracking
from .report import Sweep

if TYPE_CHECKING:
    import pandas as pd
    from PIL import Image, ImageFont

LARGEST = 24  # rows of pictures
GAP = 6       # pixels between a picture and what is beside it
WIDEST = 220  # pixels of the column of row names
BACKGROUND, INK, EMPTY = (32, 32, 32), (225, 225, 225), (56, 56, 56)
VIEWS = {"whole": "result", "zoomed": "zoomed"}                 # column heading -> the job's artifact
TARGETS = {"whole": "target", "zoomed": "zoomed_target"}


@dataclass(frozen=True)
class Label:
    """A line of text and the place of its upper left corner."""

    x: int
    y: int
    text: str


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
    """(H,W,3) uint8: a sheet with a name and a pair for each sample in every row, as `layout` says."""
    from PIL import Image, ImageDraw

    size, labels, places = layout(title, samples, rows, side)
    sheet = Image.new("RGB", size, BACKGROUND)
    for picture, x, y in places:
        sheet.paste(_scaled(picture, side), (x, y))
    pen = ImageDraw.Draw(sheet)
    for label in labels:
        pen.text((label.x, label.y), label.text, fill=INK, font=font_for(side))
    return np.asarray(sheet)


def layout(title: str, samples: Sequence[str], rows: Sequence[tuple[str, list[Pair]]], side: int
           ) -> tuple[tuple[int, int], list[Label], list[tuple[Image.Image | None, int, int]]]:
    """The layout: the size of the sheet, its texts, and its pictures with their upper left corners.

    The title is at the top, the sample and the two views above their columns, the name of a row on its left, the score
    below its pair. No text is wider than its place: long names are broken into lines, and cut if there are too many.
    """
    font = font_for(side)
    line = line_height(font)
    names = [part for name, _ in rows for part in broken(name, font.getlength, WIDEST)]
    margin = GAP + max(int(font.getlength(part)) + 1 for part in names) + GAP
    pair = 2 * (side + GAP)
    width = margin + len(samples) * pair
    labels, places = [], []

    def write(x: int, y: int, text: str, room: int, lines: int = 1) -> int:
        parts = broken(text, font.getlength, room)[:lines]
        labels.extend(Label(x, y + number * line, part) for number, part in enumerate(parts))
        return y + len(parts) * line

    y = write(GAP, GAP, title, width - 2 * GAP, lines=3) + GAP
    below = max(write(margin + number * pair, y, sample, pair - GAP, lines=3) for number, sample in enumerate(samples))
    for number in range(len(samples)):
        for column, view in enumerate(VIEWS):
            write(margin + number * pair + column * (side + GAP), below, view, side)
    y = below + line
    for name, pairs in rows:
        write(GAP, y, name, WIDEST, lines=side // line)
        for number, one in enumerate(pairs):
            left = margin + number * pair
            places += [(picture, left + column * (side + GAP), y) for column, picture in enumerate(one.pictures)]
            if one.caption:
                write(left, y + side, one.caption, pair - GAP)
        y += side + (line if any(one.caption for one in pairs) else 0) + GAP
    return (width, y), labels, places


def broken(text: str, length: Callable[[str], float], room: float) -> list[str]:
    """The text in lines no longer than `room`, broken after a space, a comma, an underscore or, at worst, anywhere."""
    lines, rest = [], text
    while length(rest) > room and len(rest) > 1:
        most = max((end for end in range(1, len(rest)) if length(rest[:end]) <= room), default=1)
        soft = max((end for end in range(1, most + 1) if rest[end - 1] in " ,_="), default=most)
        lines.append(rest[:soft].rstrip())
        rest = rest[soft:].lstrip()
    return [*lines, rest]


def font_for(side: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """The font for pictures of `side` pixels."""
    from PIL import ImageFont

    return ImageFont.load_default(size=max(11, side // 13))


def line_height(font: ImageFont.FreeTypeFont | ImageFont.ImageFont) -> int:
    """Pixels from one line of text to the next."""
    return int(font.getbbox("Agjy_")[3]) + 3


def _pair(uri: str, found: pd.DataFrame) -> Pair:
    """The pictures of the job for one row and sample, if there is one."""
    if not len(found):
        return Pair((None, None), "no result")
    job = found.iloc[0]
    return Pair(_read(uri, job, VIEWS), f"F1 {job['metric.f1']:.3f}")


def _read(uri: str, job: pd.Series, names: dict[str, str]) -> tuple[Image.Image | None, ...]:
    from PIL import Image

    images = []
    for name in names.values():
        try:
            data = tracking.read_artifact(uri, job["run_id"], f"views/{name}.png")
        except Exception:  # a sweep over pictures has no zoomed views, and a lost file must not cost the figure
            images.append(None)
        else:
            images.append(Image.open(io.BytesIO(data)).convert("L"))
    return tuple(images)


def _scaled(picture: Image.Image | None, side: int) -> Image.Image:
    from PIL import Image

    if picture is None:
        return Image.new("RGB", (side, side), EMPTY)
    # Averaging over a pixel's area keeps thin shapes; enlarging keeps pixels visible as pixels.
    smaller = picture.width >= side
    return picture.resize((side, side), Image.Resampling.BOX if smaller else Image.Resampling.NEAREST)
