"""The views that every method is judged on."""

from __future__ import annotations

import hashlib
from bisect import bisect_left
from collections.abc import Callable

import numpy as np

from ..errors import InputError
from ..ifs import IFS, View

ZOOM_RANGES = ((1.0, 2.0), (2.0, 4.0), (4.0, 8.0))
VIEWS_PER_RANGE = 2
WHOLE = "whole"
ZOOM_CLASSES = (WHOLE, *(f"{low:g}-{high:g}x" for low, high in ZOOM_RANGES))

# How far from the canvas's middle a window's centre may lie along each axis, by zoom.
REACHES: dict[str, Callable[[float], float]] = {
    "paper": lambda zoom: 1 - 1 / zoom,              # anywhere, as long as the window stays on the canvas
    "released": lambda zoom: (1 - 1 / zoom) / zoom,  # the authors' program: the closer, the nearer to the middle
}


def evaluation_views(seed: int, kind: str = "paper") -> dict[str, View]:
    """The seven views of a fractal by name: the whole canvas, and two with zooms from each of U[1,2], U[2,4], U[4,8].

    Centres are uniform within the reach of `kind`: `paper` keeps the window on the canvas, `released` is how the
    authors' program draws them, |center| <= (1 - 1/zoom) / zoom. Both kinds share the zooms of a seed. Raises
    `InputError` on another kind or a negative seed.
    """
    if kind not in REACHES:
        raise InputError(f"views must be one of {', '.join(REACHES)}, got {kind!r}")
    if seed < 0:
        raise InputError(f"the seed of the views must be at least 0, got {seed}")
    rng = np.random.Generator(np.random.PCG64(seed))
    views = {WHOLE: View()}
    for low, high in ZOOM_RANGES:
        for letter in "ab"[:VIEWS_PER_RANGE]:
            zoom, reach = rng.uniform(low, high), rng.uniform(-1, 1, 2)
            x, y = reach * REACHES[kind](zoom)
            views[f"{low:g}-{high:g}x-{letter}"] = View((x, y), zoom)
    return views


def views_seed(truth: IFS) -> int:
    """A seed of 64 bits that depends on the fractal alone: the same for a code and its `similar` ones."""
    return int.from_bytes(hashlib.sha256(truth.linear.cpu().numpy().astype("<f4").tobytes()).digest()[:8], "little")


def zoom_class(zoom: float) -> str:
    """The class that a zoom is summarised in: whole, 1-2x, 2-4x or 4-8x (and beyond)."""
    highs = [high for _, high in ZOOM_RANGES[:-1]]
    return WHOLE if zoom <= 1 else ZOOM_CLASSES[1 + bisect_left(highs, zoom)]
