"""Long straight thin lines that box or border a shape: axes, plot frames, edges of a scanned paper."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

LENGTH = 0.45           # minimum length of a line, relative to the box of all lit pixels
THICK = 0.012           # maximum thickness of a line, relative to the box's longer side (or 3 px)
CLEAR = 0.8             # minimum share of a line with nothing beside it, on either side
ASIDE = 0.008           # how far beside it that is, relative to the longer side (or 3 px)
MEET = 0.02             # maximum gap between two lines that meet, relative to the longer side (or 3 px)
INSIDE = 0.2            # minimum span of a frame's content, relative to the frame's sides
TICK = 0.04             # maximum length of a mark on the inner side of a frame, relative to the longer side
GRID_LENGTH, GRID_CLEAR = 0.85, 0.3  # minimum shares of a frame's side that a grid line spans, and of it that is clear
EDGE = 0.03             # distance from a picture's border within which the edge of a scanned paper runs
EDGE_LENGTH = 0.6       # minimum length of that edge, relative to the picture's side


@dataclass(frozen=True)
class Line:
    """A straight line: rows `near` to `far` (excluded) and columns `start` to `stop` (excluded), with rows and columns
    swapped if it is upright."""

    near: int
    far: int
    start: int
    stop: int


def frame_of(lit: np.ndarray) -> np.ndarray | None:
    """Lines that meet at right angles and hold a shape, with everything outside them (h,w); None if there are none."""
    level, upright = _lines(lit), _lines(lit.T)
    span = max(lit.shape)
    near = max(3, MEET * span)
    meeting = [(a, b) for a in level for b in upright if _meet(a, b, near) and _meet(b, a, near)]
    if not meeting:
        return None
    level, upright = ({line for line in lines} for lines in zip(*meeting, strict=True))
    top, bottom, outside_y = _between(upright, level)
    left, right, outside_x = _between(level, upright)
    inside = lit.copy()
    for line in level:
        inside[max(line.near - 1, 0):line.far + 1, line.start:line.stop] = False
    for line in upright:
        inside[line.start:line.stop, max(line.near - 1, 0):line.far + 1] = False
    inside[:top], inside[bottom:], inside[:, :left], inside[:, right:] = False, False, False, False
    box = inside[top:bottom, left:right]
    for picture in (box, box.T):
        _wipe_grid(picture)
    inside &= ~_ticks(inside, outside_y, outside_x, TICK * span)
    beyond = lit.copy()
    beyond[top:bottom, left:right] = False
    rows, columns = np.flatnonzero(inside.any(1)), np.flatnonzero(inside.any(0))
    if not rows.size or np.ptp(rows) < INSIDE * (bottom - top) and np.ptp(columns) < INSIDE * (right - left):
        return None
    return lit & ~inside if inside.sum() >= _rest(beyond, level, upright) else None


def _wipe_grid(box: np.ndarray) -> None:
    """Remove horizontal lines that run through a frame from side to side, except where something lies beside them."""
    aside = round(max(3, ASIDE * max(box.shape)))
    for line in _lines(box, GRID_LENGTH * box.shape[1], GRID_CLEAR):
        above, below = (box[max(line.near - 1 - aside, 0):max(line.near - 1, 0)],
                        box[line.far + 1:line.far + 1 + aside])
        box[max(line.near - 1, 0):line.far + 1, ~(above.any(0) | below.any(0))] = False


def scan_edges(lit: np.ndarray) -> np.ndarray | None:
    """Thin straight lines along the borders of the picture, with all between them and the border (h,w); or None."""
    found = np.zeros_like(lit)
    for picture, out in ((lit, found), (lit.T, found.T)):
        near, count = max(2, EDGE * picture.shape[0]), picture.shape[0]
        for line in _lines(picture, EDGE_LENGTH * picture.shape[1]):
            if line.far <= near:
                out[:line.far + 1] = True
            elif line.near >= count - near:
                out[line.near - 1:] = True
    return found & lit if found.any() and (lit & ~found).any() else None


def _lines(lit: np.ndarray, least: float = 0.0, clear: float = CLEAR) -> list[Line]:
    """Thin horizontal lines with nothing beside them along most of their length."""
    span, columns = max(lit.shape), np.flatnonzero(lit.any(0))
    if not columns.size:
        return []
    starts, lengths = _longest_runs(lit)
    long = lengths >= max(LENGTH * (np.ptp(columns) + 1), least, 16)
    aside, lines = round(max(3, ASIDE * span)), []
    for (rows,) in ndimage.find_objects(ndimage.label(long)[0]):
        near, far = rows.start, rows.stop
        if far - near > max(3, THICK * span):
            continue
        row = near + int(lengths[near:far].argmax())
        start, stop = int(starts[row]), int(starts[row] + lengths[row])
        beside = (lit[max(near - 1 - aside, 0):max(near - 1, 0), start:stop], lit[far + 1:far + 1 + aside, start:stop])
        if all(1 - side.any(0).mean() >= clear for side in beside if side.size):
            lines.append(Line(near, far, start, stop))
    return lines


def _longest_runs(lit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the longest run of lit pixels of each row (h,) begins, and its length."""
    position = np.arange(1, lit.shape[1] + 1)
    dark = np.maximum.accumulate(np.where(lit, 0, position), axis=1)
    run = position - dark
    ends = run.argmax(1)
    lengths = run[np.arange(len(lit)), ends]
    return ends + 1 - lengths, lengths


def _meet(line: Line, other: Line, near: float) -> bool:
    """Whether a line ends at another one at right angles to it."""
    return min(abs(line.start - other.near), abs(line.stop - other.far)) <= near


def _between(along: set[Line], across: set[Line]) -> tuple[int, int, list[int]]:
    """The range in which the lines `along` run and the lines `across` them lie; and the positions of the latter."""
    ends = [end for line in along for end in (line.start, line.stop)]
    places = [place for line in across for place in (line.near, line.far)]
    return min(ends + places), max(ends + places), places


def _ticks(inside: np.ndarray, levels: list[int], uprights: list[int], length: float) -> np.ndarray:
    """Short marks that begin at one of the lines."""
    labels, _ = ndimage.label(inside, np.ones((3, 3)))
    marks = []
    for label, (y, x) in enumerate(ndimage.find_objects(labels), 1):
        short = max(y.stop - y.start, x.stop - x.start) <= length
        touches = (min(abs(end - place) for end in (y.start, y.stop) for place in levels) <= 2
                   or min(abs(end - place) for end in (x.start, x.stop) for place in uprights) <= 2)
        if short and touches:
            marks.append(label)
    return np.isin(labels, marks)


def _rest(beyond: np.ndarray, level: set[Line], upright: set[Line]) -> int:
    """The number of lit pixels beyond a frame, without the frame's own lines."""
    for line in level:
        beyond[line.near:line.far, line.start:line.stop] = False
    for line in upright:
        beyond[line.start:line.stop, line.near:line.far] = False
    return int(beyond.sum())
