"""Codes of few and of many maps on one sheet, which shows what more maps are worth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import adaptive_avg_pool2d, avg_pool2d

from ..ifs.code import View
from ..likeness import OUTLINE
from ..methods.base import CurvePoint
from ..rendering import sheets
from ..rendering.still import render_with_info
from ..rendering.tone import own_tone

SIDE = 256    # pixels of a drawing
CLOSER = 16   # times, in the right column


def offered(curve: Sequence[CurvePoint]) -> list[CurvePoint]:
    """Of the codes that are more like the picture than all with fewer maps: the simplest that has its character, which
    is more than its outline, one in the middle, and the closest. They are fewer than three if there are no three, and
    the simplest is any if none has the character."""
    rising: list[CurvePoint] = []
    for each in sorted(curve, key=lambda point: (point.maps, -point.likeness)):
        if not rising or each.likeness > rising[-1].likeness:
            rising.append(each)
    alike = [each for each in rising if each.likeness >= OUTLINE] or rising
    return [alike[i] for i in sorted({0, len(alike) // 2, len(alike) - 1})]


def sheet(picture: Tensor, points: Sequence[CurvePoint]) -> np.ndarray:
    """A picture (R,R) and codes of it as (H,W,3) uint8: each in a row of its own, on the left the whole and on the
    right a place, the same for all, `CLOSER` times closer."""
    modes = ["tone" if own_tone(each.code) else "occupancy" for each in points]
    whole = [render_with_info(each.code, resolution=SIDE, mode=mode)[0]
             for each, mode in zip(points, modes, strict=True)]
    top, left = _striking(torch.stack(whole))
    part, half = SIDE // CLOSER, SIDE / 2
    view = View(((left + part / 2) / half - 1, 1 - (top + part / 2) / half), CLOSER)
    patch = adaptive_avg_pool2d(picture[None], SIDE)[0, top:top + part, left:left + part]
    images, captions = [picture, patch], ["the picture"]
    for each, mode, image in zip(points, modes, whole, strict=True):
        images += [image, render_with_info(each.code, view, resolution=SIDE, mode=mode)[0]]
        captions.append(f"{each.maps} maps, likeness {each.likeness:.2f}")
    below = [text for caption in captions for text in (caption, f"{CLOSER} times closer")]
    return sheets.contact_sheet(images, below, columns=2, side=SIDE)


def _striking(drawings: Tensor) -> tuple[int, int]:
    """Row and column of the upper left pixel of the place with most greys, neither black nor white, in whichever of the
    drawings (n,S,S) has fewest there: all show it, and it is no plain white within a shape."""
    greys = avg_pool2d((drawings * (1 - drawings))[:, None], SIDE // CLOSER, stride=1).amin((0, 1))
    row, column = divmod(int(greys.argmax()), len(greys))
    return row, column
