"""Points of an attractor sorted into the pixels of a window, at any zoom: numba, multi-threaded, float64.

Throw a Poisson number of points of the invariant measure, T on average. The number of points under the word w = w1 w2 …
of the address tree is Poisson with mean T p_w, independent of the other words of a cut of the tree. They are images
under f_w = f_w1 ∘ f_w2 ∘ … of points of the invariant measure (Hutchinson 1981). So the expected number is handed down
the tree, and words that miss the window are dropped. A word that lies in the window, or that expects few points, gets
its random number of points, and points off the window are rejected. The points in the window are distributed exactly
like points of the chaos game, however rare they are, and however many words there are, because words with few points
are never opened.

Each share of the work plays a few chaos games, some hundreds to thousands of points at a time. Their points are used in
an order that separates neighbours of an orbit. Where a map is slow, neighbours are alike, and a small word's points
would clump.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple

import numpy as np
from numba import get_num_threads
from torch import Tensor

from . import cpu as kernels
from .cpu import COUNTED, DRY
from .pool import choice

TASKS = 64   # shares of the work, each with its own random stream: no result depends on the number of threads
FEWER = 16   # shares for a tree that reuses points, because each share makes its own points; more threads stay idle


class Window(NamedTuple):
    """`width` × `height` pixels with upper left corner (left, top) and `scale` pixels per unit."""

    left: float
    top: float
    scale: float
    width: int
    height: int

    @property
    def size(self) -> tuple[float, float]:
        """Its width and height, as the kernels take them."""
        return float(self.width), float(self.height)


class Tally(NamedTuple):
    """Points `kept` in the window, points `thrown` at it, words `visited`; `finished` unless the budget ran out."""

    kept: int
    thrown: int
    visited: int
    finished: bool


@dataclass(frozen=True)
class AddressTree:
    """A contractive code prepared for sampling: `maps` (N,6), rows a b c d e f about `center`, and a rectangle about
    `center` with half sides `hull` (2,2, as columns) that contains the attractor; what of it lies beyond is left out of
    words whose rectangle is beside the window. A point x of the invariant
    measure is used under up to `reuse` words: f_v(x), f_w(x), …. With 8, a drawing takes half as long as with 1 and its
    pixels are no noisier, but the brightness of large parts may vary up to twice as much.

    `colours` (N,4), if any: the share 1 - b_i of a colour that map i keeps, and the b_i c_i that it adds (see
    `ifs.colours`). A word's colour c -> k c + t is composed like its map."""

    maps: np.ndarray
    mass: np.ndarray
    thresholds: np.ndarray
    guide: np.ndarray
    hull: np.ndarray
    center: np.ndarray
    reuse: int = 1
    colours: np.ndarray = field(default_factory=partial(np.empty, (0, 4)))

    @classmethod
    def of(cls, linear: Tensor, offset: Tensor, probabilities: Tensor, center: np.ndarray, hull: np.ndarray,
           reuse: int = 1, colours: tuple[Tensor, Tensor] | None = None) -> AddressTree:
        """From linear (N,2,2), offset (N,2), probabilities (N,), the rectangle's center (2,) and hull (2,2), and maybe
        colours: rgb (N,3) and blends (N,), some of whose maps with a blend above 0 have a probability above 0."""
        matrix, shift = linear.cpu().double().numpy(), offset.cpu().double().numpy()
        shift = matrix @ center + shift - center
        p = probabilities.cpu().double().numpy()
        return cls(np.column_stack([matrix.reshape(-1, 4), shift]), p / p.sum(), *choice(p), hull, center, reuse,
                   np.empty((0, 4)) if colours is None else _folded(*colours))

    def within(self, window: Window) -> bool:
        """Whether the whole attractor certainly lies in the window."""
        a, b, c, d, x, y = self._root(window)
        return kernels.place(a, b, c, d, x, y, self.hull, window.size)[0] == 1

    def scatter(self, window: Window, thrown: float, *, seed: tuple[int, ...], canvas: np.ndarray | None = None,
                sums: np.ndarray | None = None, mode: int = DRY, tasks: int | None = None, budget: float = math.inf
                ) -> Tally:
        """Sort a Poisson number of points, `thrown` on average, into the pixels of `canvas`.

        `canvas` is what `planes` gives: a bit for each part of a pixel in the modes LIT and COLOURED, a count for
        COUNTED, in a plane for each of numba's threads, and unused for DRY. `sums`, for COLOURED and a tree with
        colours, is (threads,H/f,W/f,4) uint64 for pixels of f² parts: the points of a pixel, and the sums of their red,
        green and blue times COLOUR_UNIT. The points depend only on `seed`, not on the threads, the mode or the colours.
        If words and points would exceed `budget`, the work stops unfinished, with only a part of the points.
        """
        if canvas is None:
            canvas = np.empty((1, 1, 1), np.uint64)
        if sums is None:
            sums = np.empty((1, 1, 1, 4), np.uint64)
        reuse = 1 if mode == DRY else self.reuse  # weighing uses independent points
        tasks = tasks or (TASKS if self.reuse == 1 else FEWER)
        seeds = np.random.SeedSequence(seed).generate_state(tasks, np.uint64)
        tally = np.zeros((tasks, 4), np.int64)
        each = min(budget / tasks, float(sys.maxsize // 2))
        jobs = self.cut(window, thrown, 8 * tasks, whole=reuse > 1)
        tree = kernels.Tree(self.maps, self.mass, self.thresholds, self.guide, self.hull, self.colours)
        across = canvas.shape[2] * (1 if mode == COUNTED else 64)
        marked = kernels.Canvas(canvas.reshape(len(canvas), -1), sums, across, window.height // sums.shape[1])
        kernels.scatter(tree, window.size, jobs, each, seeds, marked, mode, reuse, tally)
        kept, drawn, visited, cut_short = (int(total) for total in tally.sum(0))
        return Tally(kept, drawn, visited, cut_short == 0)

    def cut(self, window: Window, thrown: float, pieces: int, *, whole: bool = False) -> np.ndarray:
        """Words (J,8) that together hold the window's points when `thrown` points are thrown at the attractor. Each is
        a map to pixels a b c d x y, the depth, and the expected number of points; in a tree with colours, four more
        numbers (J,12) are the share that the word keeps of a colour, and what it adds. A large word that lies in the
        window is drawn in several parts, so that there are at least about `pieces` rows; with `whole`, it is split into
        longer words instead, like all others."""
        return kernels.cut(self.maps, self.mass, self.hull, self.colours, window.size, self._root(window),
                           float(thrown), pieces, whole)

    def _root(self, window: Window) -> np.ndarray:
        """The empty word, as a map from points about `center` to pixels (column, row)."""
        s, (x, y) = window.scale, self.center
        return np.array([s, 0.0, 0.0, -s, (x - window.left) * s, (window.top - y) * s])


def planes(height: int, width: int, mode: int) -> np.ndarray:
    """An empty canvas for `AddressTree.scatter`: counts (threads,H,W) uint32 for COUNTED, else bits (threads,H,K)
    uint64. Bit c & 63 of word c >> 6 stands for column c; the last of the K words is not used."""
    if mode != COUNTED:
        return np.zeros((get_num_threads(), height, width // 64 + 2), np.uint64)
    return np.zeros((get_num_threads(), height, width), np.uint32)


def colour_planes(height: int, width: int) -> np.ndarray:
    """Empty sums of colours for `AddressTree.scatter` and an image (H,W)."""
    return np.zeros((get_num_threads(), height, width, 4), np.uint64)


def _folded(rgb: Tensor, blends: Tensor) -> np.ndarray:
    """What each map does to a colour, (N,4): the share that it keeps, and the red, green and blue that it adds."""
    b = blends.cpu().double().numpy()[:, None]
    return np.hstack([1 - b, b * rgb.cpu().double().numpy()])
