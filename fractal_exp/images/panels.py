"""Find the panels of a plot, which its axes frame or its grid spans, and the colour bars beside them.

A panel is known by what stands beside it: marks or numbers both to the left of it and below it, or a colour bar.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from scipy import ndimage

from .bands import Bands, Overview
from .colours import border_colour

DIFFERS, DIFFERS_IF_LOSSY = 0.03, 0.12  # difference from the background in any channel above which a pixel is inked
LENGTH = 0.2            # minimum length of an axis, relative to the picture's side
MEET = 0.02             # maximum gap or overshoot where two axes meet, relative to the longer side (or 4 px)
OPEN = 0.7              # minimum share of an axis with nothing on its outer side
MARKS = 3               # minimum number of marks or glyphs to the left of a panel and below it
LABELS = 0.12           # depth of the strip beside a panel in which they are looked for, relative to the longer side
MARK = 0.12             # maximum size of a mark or a glyph, relative to the panel's longer side
GRID_LINES = 3          # minimum number of lines each way of a grid without axes
BAR_NARROW = 5          # minimum length over width of a colour bar
BAR_RANGE, BAR_ACROSS = 0.3, 0.02  # minimum range of its colours along it, maximum deviation across it


class Box(NamedTuple):
    """Rows `top` to `bottom` and columns `left` to `right` of an overview, the last ones excluded."""

    top: int
    bottom: int
    left: int
    right: int

    def meets(self, other: Box) -> bool:
        return (self.top < other.bottom and other.top < self.bottom
                and self.left < other.right and other.left < self.right)


class _Run(NamedTuple):
    """An inked run of a row, or of a column of the transposed mask."""

    place: int
    start: int
    stop: int


def inked_of(picture: Bands, paper: np.ndarray, times: float = 1.0) -> tuple[np.ndarray, int]:
    """Which blocks (h,w) of a picture hold a pixel unlike the paper's colour, and their side in pixels; times: factor
    on the difference that counts."""
    def away(band: np.ndarray) -> np.ndarray:
        distance = np.abs(band - paper.astype(np.float32))
        return distance.max(-1) if picture.channels > 1 else distance

    overview = Overview.of(picture.map(away))
    return overview.highest > times * (DIFFERS_IF_LOSSY if picture.lossy else DIFFERS), overview.block


def _runs(inked: np.ndarray, least: float) -> Iterator[_Run]:
    """All runs of at least so many inked pixels, from the top."""
    edges = np.diff(np.pad(inked, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (rows, starts), (_, stops) = np.nonzero(edges == 1), np.nonzero(edges == -1)
    long = stops - starts >= least
    yield from map(_Run._make, zip(*(each[long].tolist() for each in (rows, starts, stops)), strict=True))


def edges(inked: np.ndarray, least: float, outwards: int) -> list[_Run]:
    """The runs with next to nothing in the row beyond them, below (1) or above (-1)."""
    def is_open(run: _Run) -> bool:
        beyond = run.place + outwards
        return not 0 <= beyond < len(inked) or 1 - inked[beyond, run.start:run.stop].mean() >= OPEN

    return [run for run in _runs(inked, least) if is_open(run)]


def panels_of(inked: np.ndarray, bars: list[Box]) -> list[Box]:
    """The panels of a plot: where an axis to the left and one below meet, or where lines of a grid do."""
    height, width = inked.shape
    near = max(4, MEET * max(height, width))
    below, aside = (edges(_closed(mask), LENGTH * mask.shape[1], outwards)
                    for mask, outwards in ((inked, 1), (inked.T, -1)))
    found = [Box(left.start, low.place + 1, left.place, low.stop) for low in below for left in aside
             if -near <= left.place - low.start <= near and -near <= left.stop - 1 - low.place <= near]
    found += _gridded(below, aside)
    largest: list[Box] = []
    for box in sorted(set(found), key=lambda box: (box.top - box.bottom) * (box.right - box.left)):
        if not any(box.meets(other) for other in (*largest, *bars)):
            largest.append(box)
    outside = inked.copy()
    for box in largest:
        outside[max(box.top - 1, 0):box.bottom + 1, max(box.left - 1, 0):box.right + 1] = False
    return [box for box in largest if _labelled(outside, box)
            or any(bar.top < box.bottom and box.top < bar.bottom or bar.left < box.right and box.left < bar.right
                   for bar in bars)]


def _closed(inked: np.ndarray) -> np.ndarray:
    """A mask whose rows have no gaps of three pixels or less: lines in the paper's colour cross a tinted panel."""
    return ndimage.binary_closing(np.pad(inked, ((0, 0), (4, 4))), np.ones((1, 4)))[:, 4:-4]


def _gridded(level: list[_Run], upright: list[_Run]) -> list[Box]:
    """The box of a grid without axes, whose lines have equal ends."""
    ends = [max(set(runs), key=runs.count) if runs else (0, 0)
            for runs in ([run[1:] for run in lines] for lines in (level, upright))]
    (left, right), (top, bottom) = ends
    counts = [sum(run[1:] == end and low <= run.place < high for run in lines)
              for lines, end, (low, high) in ((level, ends[0], ends[1]), (upright, ends[1], ends[0]))]
    return [Box(top, bottom, left, right)] if min(counts) >= GRID_LINES else []


def _labelled(outside: np.ndarray, box: Box) -> bool:
    """Whether marks or glyphs, and nothing larger, stand both to the left of a box and below it."""
    depth = round(LABELS * max(outside.shape))
    most = MARK * max(box.bottom - box.top, box.right - box.left)
    strips = (outside[box.top:box.bottom, max(box.left - depth, 0):box.left],
              outside[box.bottom:box.bottom + depth, box.left:box.right])
    for strip in strips:
        if not strip.any():
            return False
        sizes = [max(piece.stop - piece.start for piece in pieces)
                 for pieces in ndimage.find_objects(ndimage.label(strip, np.ones((3, 3)))[0])]
        if len(sizes) < MARKS or max(sizes) > most:
            return False
    return True


def bars_of(picture: Bands, inked: np.ndarray, block: int) -> Iterator[Box]:
    """Narrow boxes whose colours change along them and not across."""
    for turned in (False, True):
        mask = inked if turned else inked.T
        runs = edges(mask, LENGTH * mask.shape[1], -1), edges(mask, LENGTH * mask.shape[1], 1)
        for first in runs[0]:
            last = next((last for last in runs[1] if last.place - first.place >= 4
                         and max(abs(first.start - last.start), abs(first.stop - last.stop)) <= 2), None)
            if last is None or (last.place - first.place) * BAR_NARROW > first.stop - first.start:
                continue
            box = (Box(first.place, last.place + 1, first.start, first.stop) if turned
                   else Box(first.start, first.stop, first.place, last.place + 1))
            part = part_of(picture, box, block)
            if _is_gradient(np.atleast_3d(part.rows(0, part.height)), along=int(turned)):
                yield box


def _is_gradient(colours: np.ndarray, along: int) -> bool:
    across = 1 - along
    margin = max(2, round(0.25 * colours.shape[across]))
    middle = np.moveaxis(colours, along, 0)[:, margin:-margin]
    middle = middle[2 + len(middle) // 50:len(middle) - 2 - len(middle) // 50]
    if not middle.size:
        return False
    mean = middle.mean(1)
    steps = np.abs(np.diff(mean, axis=0)).max(-1)
    return bool(np.ptp(mean, axis=0).max() >= BAR_RANGE and middle.std(1).mean() <= BAR_ACROSS
                and steps.max() <= BAR_RANGE / 2)


def beside(bar: Box, shape: tuple[int, int]) -> Box:
    """The larger part of a picture beside a colour bar."""
    height, width = shape
    sides = (Box(0, height, 0, bar.left - 1), Box(0, height, bar.right + 1, width)) if (
        bar.bottom - bar.top > bar.right - bar.left) else (Box(0, bar.top - 1, 0, width),
                                                           Box(bar.bottom + 1, height, 0, width))
    return max(sides, key=lambda side: (side.bottom - side.top) * (side.right - side.left))


def part_of(picture: Bands, box: Box, block: int) -> Bands:
    """The part of a picture in a box, whose sides are counted in blocks of so many pixels."""
    return picture.part(box.top * block, min(box.bottom * block, picture.height),
                        box.left * block, min(box.right * block, picture.width))


def inside(picture: Bands, box: Box, block: int) -> Bands:
    """What a panel holds, without its frame."""
    part = part_of(picture, box, block)
    rim = [round(share * side) for side in (part.height, part.width) for share in (MEET, 1 - MEET)]
    inner = part.part(*rim)
    inked = inked_of(part, border_colour(inner))[0]
    most = round(MEET * max(inked.shape))
    trims = [_frame(side, most) for side in (inked, inked[::-1], inked.T, inked.T[::-1])]
    step = -(-max(part.height, part.width) // max(inked.shape))
    return part.part(trims[0] * step, part.height - trims[1] * step, trims[2] * step, part.width - trims[3] * step)


def _frame(inked: np.ndarray, most: int) -> int:
    """How many rows a frame takes at the top: up to its last full row, and one more for its smooth edge."""
    full = np.flatnonzero(inked[:most].mean(1) > OPEN)
    return int(full[-1]) + 2 if full.size else 0
