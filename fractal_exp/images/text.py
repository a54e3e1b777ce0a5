"""Find rows of text in a mask: glyphs of many forms on one line."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

GLYPHS = 4              # minimum glyphs in a row of text
GLYPH_PX = 5            # minimum height of most glyphs
HEIGHTS = (0.4, 1.05)   # range of most glyphs' heights, relative to the row without its longest descenders
MOST = 0.7              # the share that "most" means
WIDEST = 2.5            # maximum width over height of most glyphs, and three times as much for every glyph
LONG_ROW = 2.5          # minimum length over height of a row
BASELINE = 0.2          # share of the row's height within which most glyphs end at one line
FILLS = (0.15, 0.9)     # range of the lit share of most glyphs' boxes
VARIETY = 0.12          # minimum standard deviation of the glyphs' lit pixels over their mean


def rows_of(lit: np.ndarray) -> list[slice]:
    """The row ranges of a mask between dark rows, from the top."""
    joined: list[slice] = []
    for (row,) in ndimage.find_objects(ndimage.label(lit.any(1))[0]):
        last = joined[-1] if joined else None
        if last and row.start - last.stop <= 2 and (last.stop - last.start) * 3 < row.stop - row.start:
            joined[-1] = slice(last.start, row.stop)  # accents and the dots of an i
        else:
            joined.append(row)
    return joined


def is_text(row: np.ndarray) -> bool:
    """Whether a mask, cut to some rows, holds one row of text and nothing else."""
    labels, count = ndimage.label(row, np.ones((3, 3)))
    if count < GLYPHS:
        return False
    columns = np.flatnonzero(row.any(0))
    counts = np.bincount(labels.ravel())[1:]
    boxes = np.array([(y.start, y.stop, x.start, x.stop) for y, x in ndimage.find_objects(labels)])
    tall, wide = boxes[:, 1] - boxes[:, 0], boxes[:, 3] - boxes[:, 2]
    body = tall > 0.3 * tall.max()  # no dots, no hyphens
    if body.sum() < GLYPHS or columns[-1] - columns[0] < LONG_ROW * row.shape[0]:
        return False
    tall, wide, counts, ends = tall[body], wide[body], counts[body], boxes[body, 1]
    height, fills = np.quantile(tall, 0.8), counts / (tall * wide)
    return bool(
        np.median(tall) >= GLYPH_PX
        and _most((tall >= HEIGHTS[0] * height) & (tall <= HEIGHTS[1] * height + 1))
        and _most(wide <= WIDEST * tall) and (wide <= 3 * WIDEST * height).all()
        and _most(np.abs(ends - np.median(ends)) <= BASELINE * height + 1)
        and _most((fills >= FILLS[0]) & (fills <= FILLS[1]))
        and counts.std() > VARIETY * counts.mean())


def _most(holds: np.ndarray) -> bool:
    return float(holds.mean()) >= MOST
