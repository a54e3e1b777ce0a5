"""Separate the shape of a picture from what stands beside it: axes, frames, captions, specks, other shapes.

All of this uses the picture's `Overview`, white on black. A fractal may well consist of many separate parts. So what is
left out must look like what people put beside a shape, and unlike any part of one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from .bands import Overview
from .checks import Notes
from .frames import frame_of, scan_edges
from .text import is_text, rows_of

# "Span" is the longer side of the box of all lit pixels.
STROKE = 0.4            # level above which pixels are strokes of text; fainter ones would join glyphs
PAGE_ROWS = 6           # minimum rows of text, one below the other, of a page
PAGE_SHARE = 0.7        # minimum share of a page's lit pixels in such rows
CAPTION_SHARE = 0.15    # maximum height of a row of text beside a shape, relative to the span
SPECK_SIZE = 0.012      # maximum size of a speck, relative to the span
SPECK_GAP = 0.1         # minimum distance of a speck from anything else, relative to the span
SPECK_GAPS = 4.0        # the same distance in sizes of the speck
SPECK_SPAN = 150        # pixels; with a smaller span, a speck cannot be told from a point of the shape
MOST_SPECKS = 20        # more specks are dust
SPECK_MASS = 0.005      # maximum share of the lit pixels in specks
LIKE_SPECKS = 3         # with more other parts as small as a speck, the shape itself is dust
MOST_PIECES = 4         # with more larger parts, too
SHAPE_GAP = 0.03        # minimum distance between two shapes, relative to the span
SHAPE_SIZE = 0.15       # minimum area of another shape, relative to the largest one
SHAPE_SOLID = 0.97      # minimum connected share of a shape's lit pixels; a part of a fractal has gaps of its own
MOST_SHAPES = 6
PIECES_OF_SHAPES = 3    # maximum pieces per shape in the picture; with more, they are islands of one fractal
SAME_SIZE = 0.05        # relative difference of sides up to which shapes are of equal size, and so parts of one
MOST_PARTS = 3000       # more parts are dust


@dataclass(frozen=True, eq=False)
class Piece:
    """A connected part of a mask: its label, rows and columns, and the number of its pixels."""

    label: int
    box: tuple[slice, slice]
    count: int

    @property
    def size(self) -> int:
        return max(self.box[0].stop - self.box[0].start, self.box[1].stop - self.box[1].start)


def beside_the_shape(overview: Overview, noise: float, notes: Notes, *, graded: bool) -> np.ndarray | None:
    """Which blocks (h,w) of a picture do not belong to the shape, bool; None if all do. The notes say what they are.

    noise: the level up to which nothing counts as lit. graded: whether levels differ within the shape, as in a density;
    the parts of such a shape are not taken for several shapes.
    """
    lit = overview.highest > noise
    if not lit.any():
        return None
    dropped = np.zeros_like(lit)
    for what, found in _found(lit, overview.highest > STROKE, graded, notes):
        dropped |= found
        notes.append(what)
    if not dropped.any():
        return None
    # With everything nearer to it than to the shape, such as smooth edges.
    nearest = ndimage.distance_transform_edt(~lit, return_distances=False, return_indices=True)
    return (dropped & lit)[tuple(nearest)]


def _found(lit: np.ndarray, strokes: np.ndarray, graded: bool, notes: Notes) -> Iterator[tuple[str, np.ndarray]]:
    """What is beside the shape, in words, and where. Each search starts from what the searches before it left."""
    left = lit.copy()
    for what, search in (("the edge of the paper was ignored", scan_edges),
                         ("axes or a frame around the shape were ignored, with all beyond them", frame_of)):
        found = search(left)
        if found is not None and (left & ~found).any():
            left &= ~found
            yield what, found
    if _is_page(left, strokes):
        notes.no_clear_shape("it looks like a page of text")
        return
    captions = _captions(left, strokes)
    if captions.any():
        left &= ~captions
        yield "text beside the shape was ignored", captions
    pieces, labels = _pieces(left)
    if not 1 < len(pieces) <= MOST_PARTS:
        return
    specks = _specks(pieces, labels, left)
    if specks.any():
        left &= ~specks
        yield "small specks away from the shape were ignored", specks
    others, count = _other_shapes(left, len(pieces)) if not graded else (specks & False, 1)
    if others.any():
        notes.warnings.append(f"{count} shapes in one picture: the largest was taken; crop the picture to choose")
        yield notes.warnings[-1], others


def _pieces(lit: np.ndarray) -> tuple[list[Piece], np.ndarray]:
    """The 8-connected parts of a mask, and their labels (h,w)."""
    labels, count = ndimage.label(lit, np.ones((3, 3)))
    counts = np.bincount(labels.ravel(), minlength=count + 1)
    boxes = ndimage.find_objects(labels)
    return [Piece(label, box, int(counts[label])) for label, box in enumerate(boxes, 1)], labels


def _is_page(lit: np.ndarray, strokes: np.ndarray) -> bool:
    rows = rows_of(lit)
    if len(rows) < PAGE_ROWS:
        return False
    text = [row for row in rows if is_text((lit & strokes)[row])]
    held = sum(int(lit[row].sum()) for row in text)
    return len(text) >= PAGE_ROWS and held > PAGE_SHARE * lit.sum()


def _captions(lit: np.ndarray, strokes: np.ndarray) -> np.ndarray:
    """Consecutive rows of text at the top and at the bottom."""
    found, rows = np.zeros_like(lit), rows_of(lit)
    most = CAPTION_SHARE * _sides(lit)[1]
    for end in (-1, 0):
        while len(rows) > 1 and rows[end].stop - rows[end].start <= most and is_text((lit & strokes)[rows[end]]):
            found[rows.pop(end)] = True
    return found & lit


def _specks(pieces: list[Piece], labels: np.ndarray, lit: np.ndarray) -> np.ndarray:
    """A few tiny pieces, far from anything, if the picture has hardly any others that small."""
    none, span = np.zeros_like(lit), _sides(lit)[1]
    tiny = [piece for piece in pieces if piece.size <= max(3, SPECK_SIZE * span)]
    if span < SPECK_SPAN or not 0 < len(tiny) <= MOST_SPECKS:
        return none
    large = lit & ~np.isin(labels, [piece.label for piece in tiny])
    if not large.any():
        return none
    away = ndimage.distance_transform_edt(~large)
    lone = [piece for piece in tiny
            if away[piece.box].min() > max(SPECK_GAP * span, SPECK_GAPS * piece.size)]
    dusty = len(tiny) - len(lone) > LIKE_SPECKS or len(pieces) - len(tiny) > MOST_PIECES
    if dusty or sum(piece.count for piece in lone) > SPECK_MASS * lit.sum():
        return none
    return np.isin(labels, [piece.label for piece in lone])


def _other_shapes(lit: np.ndarray, pieces: int) -> tuple[np.ndarray, int]:
    """All shapes but the largest, if there are only a few solid shapes of unequal size, well apart; and the number of
    shapes."""
    none, gap = np.zeros_like(lit), SHAPE_GAP * _sides(lit)[1]
    labels, count = ndimage.label(ndimage.distance_transform_edt(~lit) <= gap / 2)
    if not 1 < count <= 10 * MOST_SHAPES:
        return none, 1
    areas = np.bincount(labels.ravel())[1:]
    large = np.flatnonzero(areas >= SHAPE_SIZE * areas.max()) + 1
    if not 1 < len(large) <= MOST_SHAPES:
        return none, 1
    if pieces > PIECES_OF_SHAPES * len(large):
        return none, 1
    shapes = [lit & (labels == label) for label in large]
    if not _apart(shapes, gap) or _equal([_sides(shape) for shape in shapes]) or not all(map(_solid, shapes)):
        return none, 1
    return lit & (labels != int(areas.argmax()) + 1), len(large)


def _apart(shapes: list[np.ndarray], gap: float) -> bool:
    """Whether the boxes of all shapes lie beside or above each other."""
    boxes = [np.array([np.flatnonzero(shape.any(axis))[[0, -1]] for axis in (0, 1)]) for shape in shapes]
    return all(np.maximum(one[:, 0] - other[:, 1], other[:, 0] - one[:, 1]).max() > gap
               for number, one in enumerate(boxes) for other in boxes[:number])


def _sides(shape: np.ndarray) -> tuple[int, int]:
    """The sides of the box of all lit pixels, the shorter one first."""
    first, second = sorted(int(np.ptp(np.flatnonzero(shape.any(axis)))) + 1 for axis in (0, 1))
    return first, second


def _equal(sides: list[tuple[int, int]]) -> bool:
    """Whether all have the same size."""
    low, high = np.min(sides, 0), np.max(sides, 0)
    return bool((high - low <= SAME_SIZE * high + 1).all())


def _solid(shape: np.ndarray) -> bool:
    """Whether a shape is connected, except for gaps of a pixel or two and crumbs."""
    closed = ndimage.binary_dilation(shape, np.ones((3, 3)))
    return max(piece.count for piece in _pieces(closed)[0]) >= SHAPE_SOLID * closed.sum()
