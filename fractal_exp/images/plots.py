"""Take what the axes of a plot hold, without its grid, legend, notes and colour bar.

Only inside axes, or in a picture that a grid crosses from border to border, is anything taken for a part of a plot.
"""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from ..errors import InputError
from .bands import Bands
from .checks import Notes
from .colours import background_colour, border_colour
from .panels import (
    GRID_LINES,
    MARK,
    MARKS,
    MEET,
    Box,
    bars_of,
    beside,
    edges,
    inked_of,
    inside,
    panels_of,
    part_of,
)
from .text import is_text

GRID_PARTS = 16         # parts of a panel's side, in each of which a grid line must be seen if it is free there
GRID_SEEN = 0.3         # minimum inked share of a grid line's free pixels in each part; dots and dashes have gaps
GRID_FREE = 0.04        # minimum share of a grid line that is free
MARGIN = 0.03           # less than plots leave free around their points, relative to the panel's longer side
FILLED = 0.3            # minimum share of each side of a panel without a margin that another colour comes that near to
THICK = 0.012           # maximum thickness of a line, relative to the longer side (or 3 px)
LEGEND_SIDE = 0.6       # maximum side of a legend, relative to the panel's
WORD_GAP = 0.045        # maximum gap between the words of a line, relative to the longer side
CROWDED = 0.2           # maximum of anything else within half a line of a text, relative to its own inked pixels
ARROW_LENGTH = 0.04     # minimum length of an arrow from a note, relative to the longer side
INSET = "a box in the plot was read as part of the shape; if it is no part of it, crop the picture or paint it over"


def without_axes(picture: Bands, name: str, notes: Notes) -> Bands:
    """The panel of a plot (H,W) or (H,W,3), its grid, legend and notes painted over; another picture as it is.

    The notes say what was left out. Raises `InputError` if the axes are empty.
    """
    paper = border_colour(picture)
    inked, block = inked_of(picture, paper)
    bars = list(bars_of(picture, inked, block))
    panels = panels_of(inked, bars)
    if not panels and not bars:
        return _without_grid(picture, paper, inked, notes)
    parts = [inside(picture, box, block) for box in panels or [beside(bars[0], inked.shape)]]
    part = max(parts, key=lambda each: int(inked_of(each, border_colour(each))[0].sum()))
    if panels:
        notes.append("axes or a frame around the shape were ignored, with all beyond them")
    if bars:
        notes.append("a colour bar was ignored")
    if len(panels) > 1:
        notes.warn(f"{len(panels)} plots in one picture: the one with most ink was taken; crop the picture to choose")
    part = _grounded(part, paper, notes)
    return _plain(part, name, notes) if panels else part


def _grounded(panel: Bands, paper: np.ndarray, notes: Notes) -> Bands:
    """The panel with its ground along the border, and a warning if either colour may be the ground.

    A shape may fill its axes, so that the border is the shape's rim and what reaches it are holes. Then the ground is
    the paper's colour if the panel holds it, and otherwise the darker one, as in the usual maps of colours.
    """
    border = border_colour(panel)
    inked, block = inked_of(panel, border)
    if not inked.any():
        return panel
    off_paper, margin = inked_of(panel, paper)[0], max(4, round(MARGIN * max(inked.shape)))
    filled = min(side[:margin].any(0).mean() for side in (inked, inked[::-1], inked.T, inked.T[::-1])) >= FILLED
    on_border, on_other = (off_paper[side].mean() < 0.5 for side in (~inked, inked))
    other = background_colour(panel, inked, block)
    ground = other if filled and (on_other or not on_border and np.mean(other) < np.mean(border)) else border
    if filled or on_other and not on_border:
        shape = "that along the axes" if ground is other else "the other one"
        light = np.mean(ground) > np.mean(border if ground is other else other)
        notes.warn(f"either colour in the axes may be the shape: {shape} was taken; "
                   f"invert={str(not light).lower()} takes it the other way")
    if not filled:
        return panel
    rim = np.ones_like(inked)
    rim[1:-1, 1:-1] = False
    return panel.without(rim, block, ground)


def _without_grid(picture: Bands, paper: np.ndarray, inked: np.ndarray, notes: Notes) -> Bands:
    """A picture without a grid that crosses all of it; another one as it is."""
    if not all(_is_regular(grid_lines(mask, mask & False)) for mask in (inked, inked.T)):
        return picture
    said = Notes()
    bridged = _bridged(picture, paper, said)
    if not inked_of(bridged, paper)[0].any():
        return picture
    notes.take(said)
    return bridged


def _is_regular(lines: list[tuple[int, int]]) -> bool:
    if len(lines) < GRID_LINES:
        return False
    steps = np.diff([(near + far) / 2 for near, far in lines])
    return bool(np.abs(steps - np.median(steps)).max() <= 1 + 0.05 * np.median(steps))


def grid_lines(inked: np.ndarray, hidden: np.ndarray) -> list[tuple[int, int]]:
    """The rows [near, far) of thin lines that run from side to side of a mask, seen wherever they are free and not
    hidden."""
    height, width = inked.shape
    aside, thick = max(3, round(0.006 * max(height, width))), max(3, THICK * max(height, width))
    padded = np.pad(inked, ((aside, aside), (0, 0)))
    free = ~padded[:height] & ~padded[2 * aside:] & ~hidden
    parts = np.linspace(0, width, GRID_PARTS + 1).astype(int)[:-1]
    count = np.add.reduceat(free, parts, axis=1, dtype=np.int64)
    seen = np.add.reduceat(free & inked, parts, axis=1, dtype=np.int64)
    holds = (seen >= GRID_SEEN * count) | (count < 8)
    line = holds.all(1) & (count.sum(1) >= GRID_FREE * width) & (seen[:, [0, -1]] >= 4).any(1)
    return [(run.start, run.stop) for (run,) in ndimage.find_objects(ndimage.label(line)[0])
            if run.stop - run.start <= thick]


def _bridged(picture: Bands, paper: np.ndarray, notes: Notes, hidden: np.ndarray | None = None) -> Bands:
    """A picture with what lies beside the lines of a grid in their place. What is too faint to be ink, such as their
    smooth edges, gets the paper's colour. hidden (h,w): where a line may be hidden."""
    inked, block = inked_of(picture, paper)
    hidden = inked & False if hidden is None else hidden
    level, upright = ([(block * near, block * far) for near, far in grid_lines(*masks)]
                      for masks in ((inked, hidden), (inked.T, hidden.T)))
    if not level and not upright:
        return picture
    notes.append("a grid was ignored")
    bridged = picture.bridged(level, upright)
    return bridged.without(~inked_of(bridged, paper, 1 if picture.lossy else 2)[0], block, paper)


def _plain(panel: Bands, name: str, notes: Notes) -> Bands:
    """A panel without its grid, legend, notes and marks. Raises `InputError` if nothing else is on it."""
    paper = border_colour(panel)
    inked, block = inked_of(panel, paper)
    legend = _legend(panel, inked, block, notes)
    panel = _bridged(panel, paper, notes, legend)
    inked = inked_of(panel, paper)[0] & ~legend
    marks = _marks(inked)
    words = _words(inked & ~marks)
    arrows = _arrows(inked & ~marks & ~words, words)
    gone = legend | marks | words | arrows
    for what, found in (("a legend was ignored", legend), ("marks on the axes were ignored", marks),
                        ("text beside the shape was ignored", words), ("lines at a text were ignored", arrows)):
        if found.any():
            notes.append(what)
    if not (inked & ~gone).any():
        raise InputError(f"{name} is a plot with empty axes: there is no shape on it; plot the points before you save "
                         "the figure, or give another picture")
    return panel.without(gone, block, paper) if gone.any() else panel


def _legend(panel: Bands, inked: np.ndarray, block: int, notes: Notes) -> np.ndarray:
    """A box with several small things in it (h,w). A note warns of a box with something else in it."""
    found, near = np.zeros_like(inked), max(4, MEET * max(inked.shape))
    lows = edges(inked, 24, 1)
    for top in edges(inked, 24, -1):
        for low in lows:
            box = Box(top.place, low.place + 1, top.start, top.stop)
            tall, wide = box.bottom - box.top, box.right - box.left
            if not 12 <= tall <= LEGEND_SIDE * inked.shape[0] or wide > LEGEND_SIDE * inked.shape[1] or (
                    low.start > top.start + 2 or low.stop < top.stop - 2):
                continue
            reach = round(min(near, tall / 4))
            sides = (inked[box.top + reach:box.bottom - reach, max(column - reach, 0):column + reach].any(1).mean()
                     for column in (box.left, box.right))
            if min(sides) <= 0.9:
                continue
            inner = part_of(panel, Box(box.top + 3, box.bottom - 3, box.left + 3, box.right - 3), block)
            things = inked_of(inner, border_colour(inner))[0]
            if not 0 < things.mean() < 0.5:
                continue
            if ndimage.label(things, np.ones((3, 3)))[1] >= MARKS:
                found[max(box.top - 1, 0):box.bottom + 1, max(box.left - reach, 0):box.right + reach] = True
            elif INSET not in notes:
                notes.warn(INSET)
    return found


def _marks(inked: np.ndarray) -> np.ndarray:
    """Short thin marks at the border of a mask, at right angles to it (h,w)."""
    labels, _ = ndimage.label(inked, np.ones((3, 3)))
    (height, width), most, marks = inked.shape, 2 * MEET * max(inked.shape), []
    for label, (y, x) in enumerate(ndimage.find_objects(labels), 1):
        tall, wide = y.stop - y.start, x.stop - x.start
        at_end = wide <= 3 and tall <= most and (y.start == 0 or y.stop == height)
        if at_end or tall <= 3 and wide <= most and (x.start == 0 or x.stop == width):
            marks.append(label)
    return np.isin(labels, marks) if len(marks) >= MARKS else np.zeros_like(inked)


def _words(inked: np.ndarray) -> np.ndarray:
    """Lines of text away from anything else, with the sample of a legend before them (h,w)."""
    span, found = max(inked.shape), np.zeros_like(inked)
    pieces, _ = ndimage.label(inked, np.ones((3, 3)))
    large = [label for label, box in enumerate(ndimage.find_objects(pieces), 1)
             if max(side.stop - side.start for side in box) > MARK * span / 2]
    small = inked & ~np.isin(pieces, large)
    lines: list[tuple[slice, slice, np.ndarray]] = []
    labels, _ = ndimage.label(ndimage.binary_dilation(small, np.ones((5, round(WORD_GAP * span)))), np.ones((3, 3)))
    for label, (y, x) in enumerate(ndimage.find_objects(labels), 1):
        if y.stop - y.start <= MARK * inked.shape[0]:
            row = small[y, x] & (labels[y, x] == label)
            rows = np.flatnonzero(row.any(1))
            if is_text(row[rows[0]:rows[-1] + 1]):
                found[y, x] |= row
                lines.append((y, x, row))
    long = round(MARK * span / 2)
    boxes = ndimage.binary_opening(inked, np.ones((1, long))) | ndimage.binary_opening(inked, np.ones((long, 1)))
    for y, x, row in lines:  # parts of a shape may look like glyphs, but have others beside them
        aside = (y.stop - y.start) // 2
        near = slice(max(y.start - aside, 0), y.stop + aside), slice(max(x.start - aside, 0), x.stop + aside)
        if (inked & ~found & ~boxes)[near].sum() > CROWDED * row.sum():
            found[y, x] &= ~row
    return found


def _arrows(inked: np.ndarray, words: np.ndarray) -> np.ndarray:
    """Thin straight lines that begin at a text (h,w), up to where they reach something wider."""
    span, found = max(inked.shape), np.zeros_like(inked)
    if not words.any():
        return found
    beside = ndimage.binary_dilation(words, np.ones((3, 3)), iterations=round(MEET * span))
    labels, count = ndimage.label(beside & inked, np.ones((3, 3)))
    thick = ndimage.binary_dilation(inked, np.ones((3, 3)))
    angles = np.linspace(0, 2 * np.pi, 720, endpoint=False)
    ways = np.stack([np.sin(angles), np.cos(angles)], 1)
    for label, start in enumerate(ndimage.center_of_mass(inked, labels, range(1, count + 1)), 1):
        rays = np.array(start)[:, None, None] + ways.T[:, :, None] * np.arange(span)
        aside = 4 * ways.T[::-1, :, None] * np.array([1, -1])[:, None, None]
        on, left, right = (ndimage.map_coordinates(mask.astype(np.uint8), rays + step * aside, order=0) > 0
                           for mask, step in ((thick, 0), (inked, 1), (inked, -1)))
        lengths = np.argmin(np.pad(on & ~(left & right), ((0, 0), (0, 1))), 1)
        best = int(lengths.argmax())
        if lengths[best] >= ARROW_LENGTH * span:
            line = np.zeros_like(inked)
            line[tuple(np.rint(rays[:, best, :lengths[best]]).astype(int))] = True
            found |= ndimage.binary_dilation(line | (labels == label), np.ones((5, 5)))
    return found & inked
