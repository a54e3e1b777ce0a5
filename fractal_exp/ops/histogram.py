"""Points of an attractor sorted into the pixels of a window, at any zoom: numba, multi-threaded, float64.

Throw a Poisson number of points of the invariant measure, T on average. Those under the word w = w1 w2 … of the
address tree are a Poisson number with mean T p_w, independent of those under every other word of a cut of the tree,
and are images under f_w = f_w1 ∘ f_w2 ∘ … of points of the invariant measure (Hutchinson 1981). So the expected number
is handed down the tree and words that miss the window are dropped. A word that lies in the window, or under which few
points are left to expect, gets its random number of points, and those beside the window are rejected. What lands in
the window is distributed exactly as the chaos game's points that land there, however rare those are, and however many
words there are: those of few points are never looked into.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numba import get_num_threads, get_thread_id, njit, prange, uint64
from torch import Tensor

from .jit import kernel

TASKS = 64           # shares of the work, each with its own random stream: no result depends on the number of threads
ORBITS = 16          # chaos games that a task keeps going, to hide the latency of a step
BURN_IN = 256        # steps that lead from a fixed point to the invariant measure
FEW = 64.0           # expected points under a word, below which throwing them is cheaper than a look at its children
SMALL = 1 / 8        # of the window's side: words that reach no further are drawn and tested, not split
CUT = 4096           # words are split until each holds at most this fraction of the window's points
MAX_DEPTH = 20_000   # of a word; deeper ones likewise
GUIDE_BITS = 12      # the guide table inverts the cumulative probabilities to within one of its 4096 steps

DRY, LIT, COUNTED = 0, 1, 2  # what becomes of a point: nothing, a 1 in its pixel, one more in its pixel

GOLDEN = uint64(0x9E3779B97F4A7C15)
MIX_1 = uint64(0xBF58476D1CE4E5B9)
MIX_2 = uint64(0x94D049BB133111EB)


class Window(NamedTuple):
    """The square of `size` × `size` pixels whose upper left corner is at (left, top), `scale` pixels to a unit."""

    left: float
    top: float
    scale: float
    size: int


class Tally(NamedTuple):
    """Points `kept` in the window, points `thrown` at it, words `visited`; `finished` unless the budget ran out."""

    kept: int
    thrown: int
    visited: int
    finished: bool


@dataclass(frozen=True)
class AddressTree:
    """A contractive code made ready for sampling: `maps` (N,6) rows a b c d e f about `center`, and a rectangle with
    half sides `hull` (2,2, as columns) about `center` that holds the attractor for certain."""

    maps: np.ndarray
    mass: np.ndarray
    thresholds: np.ndarray
    guide: np.ndarray
    hull: np.ndarray
    center: np.ndarray

    @classmethod
    def of(cls, linear: Tensor, offset: Tensor, probabilities: Tensor, center: np.ndarray, hull: np.ndarray
           ) -> AddressTree:
        """From linear (N,2,2), offset (N,2), probabilities (N,), and the rectangle's center (2,) and hull (2,2)."""
        matrix, shift = linear.cpu().double().numpy(), offset.cpu().double().numpy()
        shift = matrix @ center + shift - center
        p = probabilities.cpu().double().numpy()
        cumulative = np.cumsum(p) / p.sum()
        thresholds = np.round(cumulative * 2**32).astype(np.uint64)
        thresholds[np.flatnonzero(p)[-1]:] = 2**32
        guide = np.searchsorted(thresholds, np.arange(1 << GUIDE_BITS, dtype=np.uint64) << np.uint64(32 - GUIDE_BITS),
                                side="right")
        return cls(np.column_stack([matrix.reshape(-1, 4), shift]), p / p.sum(), thresholds, guide.astype(np.uint16),
                   hull, center)

    def within(self, window: Window) -> bool:
        """Whether the whole attractor lies in the window for certain."""
        root = self._root(window)
        return _place(*root, self.hull, float(window.size))[0] == 1

    def scatter(self, window: Window, thrown: float, *, seed: tuple[int, ...], canvas: np.ndarray | None = None,
                mode: int = DRY, tasks: int = TASKS, budget: float = math.inf) -> Tally:
        """Sort a Poisson number of points, `thrown` on average, into the pixels of `canvas`.

        `canvas` is (1,S,S) uint8 for the mode LIT, (threads,S,S) uint32 for COUNTED (one plane for each of numba's
        threads, to be added up) and not needed for DRY. The points depend on `seed` alone, not on the threads. The
        work stops, unfinished and with a part of the points only, where words and points would exceed `budget`.
        """
        if canvas is None:
            canvas = np.empty((1, 1, 1), np.uint8)
        seeds = np.random.SeedSequence(seed).generate_state(tasks, np.uint64)
        tally = np.zeros((tasks, 4), np.int64)
        each = min(budget / tasks, float(sys.maxsize // 2))
        size = float(window.size)
        jobs = self.cut(window, thrown, 8 * tasks)
        _scatter(self.maps, self.mass, self.thresholds, self.guide, self.hull, size, jobs, each, seeds, canvas, mode,
                 tally)
        kept, drawn, visited, cut_short = (int(total) for total in tally.sum(0))
        return Tally(kept, drawn, visited, cut_short == 0)

    def cut(self, window: Window, thrown: float, pieces: int) -> np.ndarray:
        """Words (J,8) that share out the points of the window when `thrown` are thrown at the attractor, and among
        them all that lie in it: a map to pixels a b c d x y, the depth, the number of points to expect. Large words
        that are to be drawn whole come in parts, so that there are at least about `pieces`."""
        return _cut(self.maps, self.mass, self.hull, float(window.size), self._root(window), float(thrown), pieces)

    def _root(self, window: Window) -> np.ndarray:
        """The empty word, as a map from points about `center` to pixels (column, row)."""
        s, (x, y) = window.scale, self.center
        return np.array([s, 0.0, 0.0, -s, (x - window.left) * s, (window.top - y) * s])


def planes(size: int, mode: int) -> np.ndarray:
    """An empty canvas for `AddressTree.scatter`."""
    if mode == LIT:
        return np.zeros((1, size, size), np.uint8)
    return np.zeros((get_num_threads(), size, size), np.uint32)


@kernel(parallel=True)
def box_mean(canvas, factor, out):
    """The mean of each factor × factor block of canvas (S,S) uint8 into out (S // factor, S // factor) float32."""
    scale = 1.0 / (factor * factor)
    for row in prange(out.shape[0]):
        for column in range(out.shape[1]):
            total = 0
            for i in range(factor):
                for j in range(factor):
                    total += canvas[row * factor + i, column * factor + j]
            out[row, column] = total * scale


@njit(inline="always")
def _random(state):
    """The next state and 64 random bits: SplitMix64 (Steele, Lea and Flood 2014)."""
    state = state + GOLDEN
    z = (state ^ (state >> uint64(30))) * MIX_1
    z = (z ^ (z >> uint64(27))) * MIX_2
    return state, z ^ (z >> uint64(31))


@njit(inline="always")
def _pick(bits, thresholds, guide):
    """The map that 32 random bits stand for."""
    i = int(guide[bits >> uint64(64 - GUIDE_BITS)])
    while bits >> uint64(32) >= thresholds[i]:
        i += 1
    return i


@njit(inline="always")
def _step(maps, i, x, y):
    return maps[i, 0] * x + (maps[i, 1] * y + maps[i, 4]), maps[i, 2] * x + (maps[i, 3] * y + maps[i, 5])


@njit
def _poisson(mean, state):
    """A Poisson variate: by a product of uniforms below 12, else by transformed rejection (PTRS, Hörmann 1993)."""
    unit = 2.0**-53
    if mean < 12.0:
        limit, count, product = math.exp(-mean), -1, 1.0
        while count < 0 or product > limit:
            state, bits = _random(state)
            product *= (float(bits >> uint64(11)) + 0.5) * unit
            count += 1
        return state, count
    root, log_mean = math.sqrt(mean), math.log(mean)
    b = 0.931 + 2.53 * root
    a = -0.059 + 0.02483 * b
    inverse_alpha = 1.1239 + 1.1328 / (b - 3.4)
    certain = 0.9277 - 3.6224 / (b - 2)
    while True:
        state, bits = _random(state)
        u = (float(bits >> uint64(11)) + 0.5) * unit - 0.5
        state, bits = _random(state)
        v = (float(bits >> uint64(11)) + 0.5) * unit
        edge = 0.5 - abs(u)
        k = math.floor((2 * a / edge + b) * u + mean + 0.43)
        if edge >= 0.07 and v <= certain:
            return state, int(k)
        if k < 0 or (edge < 0.013 and v > edge):
            continue
        if math.log(v * inverse_alpha / (a / (edge * edge) + b)) <= k * log_mean - mean - math.lgamma(k + 1):
            return state, int(k)


@njit
def _place(a, b, c, d, x, y, hull, size):
    """Where a word's parallelogram lies, -1 beside the window [0,size]², 1 within it, 0 across its edge, and how far
    it reaches from its centre: separating axes are those of the window and of the parallelogram."""
    p0, q0 = a * hull[0, 0] + b * hull[1, 0], c * hull[0, 0] + d * hull[1, 0]
    p1, q1 = a * hull[0, 1] + b * hull[1, 1], c * hull[0, 1] + d * hull[1, 1]
    reach_x, reach_y = abs(p0) + abs(p1), abs(q0) + abs(q1)
    reach = max(reach_x, reach_y)
    half = 0.5 * size
    dx, dy = x - half, y - half
    if abs(dx) > half + reach_x or abs(dy) > half + reach_y:
        return -1, reach
    if abs(dx) + reach_x < half and abs(dy) + reach_y < half:
        return 1, reach
    area = abs(p0 * q1 - p1 * q0)
    if abs(p0 * dy - q0 * dx) > area + half * (abs(p0) + abs(q0)):
        return -1, reach
    if abs(p1 * dy - q1 * dx) > area + half * (abs(p1) + abs(q1)):
        return -1, reach
    return 0, reach


@njit
def _warm_up(maps, thresholds, guide, state):
    """ORBITS points (ORBITS,2) of the invariant measure."""
    orbits = np.zeros((ORBITS, 2))
    for j in range(ORBITS):
        x = y = 0.0
        for _ in range(BURN_IN):
            state, bits = _random(state)
            x, y = _step(maps, _pick(bits, thresholds, guide), x, y)
        orbits[j, 0], orbits[j, 1] = x, y
    return state, orbits


@njit
def _throw(count, word, maps, thresholds, guide, state, orbits, size, canvas, plane, mode):
    """Draw `count` points under a word; the next random state, and how many fell into the window."""
    a, b, c, d, x, y = word[0], word[1], word[2], word[3], word[4], word[5]
    kept = 0
    for k in range(count):
        j = k & (ORBITS - 1)
        state, bits = _random(state)
        px, py = _step(maps, _pick(bits, thresholds, guide), orbits[j, 0], orbits[j, 1])
        orbits[j, 0], orbits[j, 1] = px, py
        column, row = a * px + (b * py + x), c * px + (d * py + y)
        if 0 <= column < size and 0 <= row < size:
            kept += 1
            if mode == LIT:
                canvas[plane, int(row), int(column)] = 1
            elif mode == COUNTED:
                canvas[plane, int(row), int(column)] += 1
    return state, kept


@njit
def _is_leaf(word, hull, size):
    """Where a word lies (see `_place`), and whether its points are to be drawn: all of them lie in the window, most
    of them do, or they are too few for a search among its children to pay."""
    where, reach = _place(word[0], word[1], word[2], word[3], word[4], word[5], hull, size)
    return where, where == 1 or reach <= SMALL * size or word[7] < FEW or word[6] >= MAX_DEPTH


@njit
def _compose(word, maps, i, points, child):
    """The word's child i with `points` under it."""
    a, b, c, d = word[0], word[1], word[2], word[3]
    child[0], child[1] = a * maps[i, 0] + b * maps[i, 2], a * maps[i, 1] + b * maps[i, 3]
    child[2], child[3] = c * maps[i, 0] + d * maps[i, 2], c * maps[i, 1] + d * maps[i, 3]
    child[4] = a * maps[i, 4] + (b * maps[i, 5] + word[4])
    child[5] = c * maps[i, 4] + (d * maps[i, 5] + word[5])
    child[6], child[7] = word[6] + 1, points


@kernel()
def _cut(maps, mass, hull, size, root, thrown, pieces):
    """A cut of the tree: words (J,8) that share out the points of the window, none with much more than its share. A
    word is its map to pixels a b c d x y, its depth, and the number of points to expect under it."""
    n = len(maps)
    words = np.zeros((1, 8))
    words[0, :6], words[0, 7] = root, thrown
    visited, split = 0, True
    while split and visited < 64 * CUT:
        share = words[:, 7].sum() / CUT
        below, top, split = np.empty((n * len(words), 8)), 0, False
        for word in words:
            visited += 1
            where, leaf = _is_leaf(word, hull, size)
            if where >= 0 and (leaf or word[7] <= share):
                below[top] = word
                top += 1
            elif where >= 0:
                split = True
                for i in range(n):
                    if mass[i] > 0:
                        _compose(word, maps, i, word[7] * mass[i], below[top])
                        top += 1
        words = below[:top]
    piece = words[:, 7].sum() / pieces
    jobs, top = np.empty((len(words) + pieces, 8)), 0
    for word in words:
        _, leaf = _is_leaf(word, hull, size)
        parts = int(word[7] / piece) + 1 if leaf else 1
        for _ in range(parts):
            jobs[top] = word
            jobs[top, 7] = word[7] / parts
            top += 1
    return jobs[:top]


@njit
def _sample(jobs, maps, mass, thresholds, guide, hull, size, budget, state, canvas, plane, mode, done):
    """Work off a task's words, depth first; `done` (4,) receives its tally."""
    n = len(maps)
    state, orbits = _warm_up(maps, thresholds, guide, state)
    word, stack, top, job = np.empty(8), np.empty((64 * n, 8)), 0, 0
    while top > 0 or job < len(jobs):
        if top == 0:
            word[:] = jobs[job]
            job += 1
        else:
            top -= 1
            word[:] = stack[top]
        done[2] += 1
        where, leaf = _is_leaf(word, hull, size)
        if done[1] + done[2] + (word[7] if leaf else 0.0) > budget:
            done[3] = 1
            return
        if where < 0:
            continue
        if leaf:
            state, count = _poisson(word[7], state)
            state, kept = _throw(count, word, maps, thresholds, guide, state, orbits, size, canvas, plane, mode)
            done[0] += kept
            done[1] += count
            continue
        if top + n > len(stack):
            taller = np.empty((2 * len(stack), 8))
            taller[:top] = stack[:top]
            stack = taller
        for i in range(n):
            if mass[i] > 0:
                _compose(word, maps, i, word[7] * mass[i], stack[top])
                top += 1


@kernel(parallel=True)
def _scatter(maps, mass, thresholds, guide, hull, size, jobs, budget, seeds, canvas, mode, tally):
    tasks = len(seeds)
    for task in prange(tasks):
        plane = get_thread_id() if mode == COUNTED else 0
        _sample(jobs[task::tasks], maps, mass, thresholds, guide, hull, size, budget, seeds[task], canvas, plane,
                mode, tally[task])
