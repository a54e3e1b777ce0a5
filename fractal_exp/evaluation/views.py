"""The views that every method is judged on."""

from __future__ import annotations

import hashlib
from bisect import bisect_left
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import InputError
from ..ifs import attractor
from ..ifs.code import IFS, View
from ..runtime.checks import check_choice

ZOOM_RANGES = ((1.0, 2.0), (2.0, 4.0), (4.0, 8.0))
VIEWS_PER_RANGE = 2
WHOLE = "whole"
ZOOM_CLASSES = (WHOLE, *(f"{low:g}-{high:g}x" for low, high in ZOOM_RANGES))

# The centre of a view, from its number, its zoom and a draw (2,) from [-1,1]².
Center = Callable[[int, float, np.ndarray], tuple[float, float]]


def code_of(thing: Any) -> IFS | None:
    """The code of a truth or a reconstruction, or None."""
    code = getattr(thing, "code", thing)
    return code if isinstance(code, IFS) else None


def _on_attractor(truth: Any, seed: int) -> Center:
    code = code_of(truth)
    if code is None:
        raise InputError("views=attractor are centred on points of the truth's attractor, but this truth is not a "
                         "code; take views=released or views=uniform")
    framed = attractor.normalize(code)
    return lambda number, zoom, draw: attractor.random_point(framed, (seed, number))


def _within(reach: Callable[[float], float]) -> Callable[[Any, int], Center]:
    return lambda truth, seed: lambda number, zoom, draw: tuple(draw * reach(zoom))


KINDS: dict[str, Callable[[Any, int], Center]] = {  # of a truth and the seed of its views
    "attractor": _on_attractor,
    "released": _within(lambda zoom: (1 - 1 / zoom) / zoom),  # the authors' program: the closer, the nearer the middle
    "uniform": _within(lambda zoom: 1 - 1 / zoom),            # anywhere, as long as the window stays on the canvas
}


def evaluation_views(truth: Any, kind: str = "attractor", *, seed: int | None = None) -> dict[str, View]:
    """The seven views of a fractal by name: the whole canvas, and two with zooms from each of U[1,2], U[2,4], U[4,8].

    - truth: an `IFS` in any frame, or an object with one as `code`. The views show its `attractor.normalize`.
    - kind: where the six closer views are centred. "attractor" takes points of the true attractor, drawn by its
      invariant measure; no such view is empty, and its window may reach beyond the canvas. "released" is uniform in
      |center| <= (1 - 1/zoom) / zoom, as in the authors' program. "uniform" is uniform as long as the window stays on
      the canvas; about one such view in nine of the random suite is empty.
    - seed: of the zooms and centres; by default `views_seed` of the truth. All kinds share the zooms of a seed.

    Raises `InputError` on another kind, a negative seed, a code that is not contractive, or a truth without a code if
    there is no seed or the views are centred on its attractor.
    """
    check_choice("views", kind, KINDS)
    if seed is None:
        code = code_of(truth)
        if code is None:
            raise InputError("views are drawn from a seed of the fractal; a truth that is not a code needs seed=…")
        seed = views_seed(code)
    if seed < 0:
        raise InputError(f"the seed of the views must be at least 0, got {seed}")
    rng, center = np.random.Generator(np.random.PCG64(seed)), KINDS[kind](truth, seed)
    views = {WHOLE: View()}
    for low, high in ZOOM_RANGES:
        for letter in "ab"[:VIEWS_PER_RANGE]:
            zoom, draw = rng.uniform(low, high), rng.uniform(-1, 1, 2)
            views[f"{low:g}-{high:g}x-{letter}"] = View(center(len(views), zoom, draw), zoom)
    return views


def views_seed(truth: IFS) -> int:
    """A 64-bit seed that depends only on the fractal: it is the same for a code and its `similar` codes."""
    return int.from_bytes(hashlib.sha256(truth.linear.cpu().numpy().astype("<f4").tobytes()).digest()[:8], "little")


def zoom_class(zoom: float) -> str:
    """The class of a zoom in summaries: whole, 1-2x, 2-4x or 4-8x (and beyond)."""
    highs = [high for _, high in ZOOM_RANGES[:-1]]
    return WHOLE if zoom <= 1 else ZOOM_CLASSES[1 + bisect_left(highs, zoom)]
