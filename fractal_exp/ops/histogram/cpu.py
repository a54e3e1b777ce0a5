"""The numba kernels of `histogram`: points of an invariant measure under the words of its address tree, float64,
multi-threaded."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import get_thread_id, int32, njit, prange, uint64

from ...runtime.jit import kernel
from .pool import APART, fill, new_pool, poisson, warm_up

SHARES = 8           # a word is split until its points are so small a part of those kept: none lies twice under it
LEVELS = 512         # but no deeper below the word that the task began with
FEW = 64.0           # expected points under a word, below which throwing them is cheaper than a look at its children
SMALL = 1 / 8        # of the window's shorter side: words that reach no further are drawn and tested, not split
BATCH = 256          # points of a word that are placed at a time
CUT = 4096           # words are split until each holds at most this fraction of the window's points
MAX_DEPTH = 20_000   # of a word; deeper ones likewise

# What becomes of a point: nothing, a 1 in its pixel, one more in its pixel, or a 1 in its part of a pixel and its
# colour added to the pixel's.
DRY, LIT, COUNTED, COLOURED = 0, 1, 2, 3
COLOUR_UNIT = 65536.0  # of a colour's 1 in the sums, which are integers: no order of adding them changes the result
PLACE, WITH_COLOUR = 8, 12  # numbers of a word without and with a colour


class Tree(NamedTuple):
    """The arrays of an `AddressTree`, N maps: maps (N,6), mass (N,), thresholds (N,), guide (4096,), hull (2,2), and
    colours (N,4), the share that a map keeps of a colour and the red, green and blue that it adds; (0,4) without."""

    maps: np.ndarray
    mass: np.ndarray
    thresholds: np.ndarray
    guide: np.ndarray
    hull: np.ndarray
    colours: np.ndarray


class Canvas(NamedTuple):
    """Where points are marked: rows of `across` pixels (threads,S·across), or of `across` bits, one for each part of a
    pixel, in words (threads,S·across/64); and the sums of a pixel's colours, of `factor`² parts (threads,S/f,S/f,4)."""

    parts: np.ndarray
    sums: np.ndarray
    across: int
    factor: int


@njit
def place(a, b, c, d, x, y, hull, size):
    """Where a word's parallelogram lies, -1 beside the window, 1 within it, 0 across its edge, and how far it reaches
    from its centre: separating axes are those of the window and of the parallelogram. size: the window's width and
    height."""
    p0, q0 = a * hull[0, 0] + b * hull[1, 0], c * hull[0, 0] + d * hull[1, 0]
    p1, q1 = a * hull[0, 1] + b * hull[1, 1], c * hull[0, 1] + d * hull[1, 1]
    reach_x, reach_y = abs(p0) + abs(p1), abs(q0) + abs(q1)
    reach = max(reach_x, reach_y)
    half_x, half_y = 0.5 * size[0], 0.5 * size[1]
    dx, dy = x - half_x, y - half_y
    if abs(dx) > half_x + reach_x or abs(dy) > half_y + reach_y:
        return -1, reach
    if abs(dx) + reach_x < half_x and abs(dy) + reach_y < half_y:
        return 1, reach
    area, aspect = abs(p0 * q1 - p1 * q0), half_y / half_x
    if abs(p0 * dy - q0 * dx) > area + half_x * (aspect * abs(p0) + abs(q0)):
        return -1, reach
    if abs(p1 * dy - q1 * dx) > area + half_x * (aspect * abs(p1) + abs(q1)):
        return -1, reach
    return 0, reach


@njit
def _throw(pool, begin, end, word, size, canvas, plane, mode, places):
    """Put so much of the pool (2 or 5,P + APART) under a word; how many points fell into the window. `places` (BATCH,)
    int32 is room for where points are on the plane, -1 beside the window. They are computed many at once."""
    a, b, c, d, x, y = word[0], word[1], word[2], word[3], word[4], word[5]
    marks, sums, across, kept = canvas.parts[plane], canvas.sums, int32(canvas.across), 0
    width, height = size
    for first in range(begin, end, BATCH):
        last = min(first + BATCH, end)
        xs, ys = pool[0, first:last], pool[1, first:last]
        for k in range(len(xs)):
            column, row = a * xs[k] + (b * ys[k] + x), c * xs[k] + (d * ys[k] + y)
            inside = (column >= 0) & (column < width) & (row >= 0) & (row < height)
            place = int32(row) * across + int32(column)
            places[k] = place if inside else int32(-1)
            kept += inside
        if mode == COUNTED:
            for k in range(len(xs)):
                if places[k] >= 0:
                    marks[places[k]] += 1
        elif mode != DRY:
            for k in range(len(xs)):
                at = places[k]
                if at >= 0:
                    marks[at >> 6] |= uint64(1) << uint64(at & 63)
        if mode == COLOURED:
            _add_colours(pool[2:, first:last], word, places, across, canvas.factor, sums[plane])
    return kept


@njit
def _add_colours(shades, word, places, across, factor, sums):
    """Add the colours that points of a pool's colours (3,K) have under a word to the sums of their pixels."""
    for k in range(shades.shape[1]):
        at = places[k]
        if at >= 0:
            pixel = sums[at // across // factor, at % across // factor]
            pixel[0] += 1
            for channel in range(3):
                pixel[1 + channel] += int(COLOUR_UNIT * (word[8] * shades[channel, k] + word[9 + channel]) + 0.5)


@njit
def _is_leaf(word, hull, size):
    """Where a word lies (see `place`), and whether its points are to be drawn: all of them lie in the window, most
    of them do, or they are too few for a search among its children to pay."""
    where, reach = place(word[0], word[1], word[2], word[3], word[4], word[5], hull, size)
    return where, where == 1 or reach <= SMALL * min(size) or word[7] < FEW or word[6] >= MAX_DEPTH


@njit
def _compose(word, maps, colours, i, points, child):
    """The word's child i with `points` under it."""
    a, b, c, d = word[0], word[1], word[2], word[3]
    child[0], child[1] = a * maps[i, 0] + b * maps[i, 2], a * maps[i, 1] + b * maps[i, 3]
    child[2], child[3] = c * maps[i, 0] + d * maps[i, 2], c * maps[i, 1] + d * maps[i, 3]
    child[4] = a * maps[i, 4] + (b * maps[i, 5] + word[4])
    child[5] = c * maps[i, 4] + (d * maps[i, 5] + word[5])
    child[6], child[7] = word[6] + 1, points
    if len(colours):
        child[8] = word[8] * colours[i, 0]
        for channel in range(3):
            child[9 + channel] = word[9 + channel] + word[8] * colours[i, 1 + channel]


@njit
def _copy(source, target):
    """Into the first of a longer target (K,). An array assigned to a slice takes a second or two to compile, for the
    message of an error that its shape might raise."""
    for k in range(len(source)):
        target[k] = source[k]


@kernel()
def cut(maps, mass, hull, colours, size, root, thrown, pieces, whole):
    """A cut of the tree: words (J,8) that share out the points of the window, none with much more than its share. A
    word is its map to pixels a b c d x y, its depth, and the number of points to expect under it. With colours (N,4),
    words (J,12) also have the share that they keep of a colour, and what they add to it."""
    n, width = len(maps), WITH_COLOUR if len(colours) else PLACE
    words = np.zeros((1, width))
    _copy(root, words[0])
    words[0, 7] = thrown
    if len(colours):
        words[0, 8] = 1.0
    visited, split = 0, True
    while split and visited < 64 * CUT:
        share = words[:, 7].sum() / (pieces if whole else CUT)
        below, top, split = np.empty((n * len(words), width)), 0, False
        for word in words:
            visited += 1
            where, leaf = _is_leaf(word, hull, size)
            if where >= 0 and (word[7] <= share or leaf and not whole):
                _copy(word, below[top])
                top += 1
            elif where >= 0:
                split = True
                for i in range(n):
                    if mass[i] > 0:
                        _compose(word, maps, colours, i, word[7] * mass[i], below[top])
                        top += 1
        words = below[:top]
    if whole:
        return words
    piece = words[:, 7].sum() / pieces
    jobs, top = np.empty((len(words) + pieces, width)), 0
    for word in words:
        _, leaf = _is_leaf(word, hull, size)
        parts = int(word[7] / piece) + 1 if leaf else 1
        for _ in range(parts):
            _copy(word, jobs[top])
            jobs[top, 7] = word[7] / parts
            top += 1
    return jobs[:top]


@njit
def _sample(jobs, tree, size, budget, state, canvas, plane, mode, reuse, done):
    """Work off a task's words, depth first; `done` (4,) receives its tally."""
    maps, mass, colours = tree.maps, tree.mass, tree.colours
    n, width = len(maps), jobs.shape[1]
    state, orbits = warm_up(tree, state)
    pool, uses = new_pool(jobs[:, 7].sum(), orbits.shape[1]), reuse
    capacity, deepest, places = pool.shape[1] - APART, 0.0, np.empty(BATCH, np.int32)
    at = capacity
    word, stack, top, job = np.empty(width), np.empty((64 * n, width)), 0, 0
    while top > 0 or job < len(jobs):
        if top == 0:
            _copy(jobs[job], word)
            deepest = word[6] + LEVELS
            job += 1
        else:
            top -= 1
            _copy(stack[top], word)
        done[2] += 1
        where, leaf = _is_leaf(word, tree.hull, size)
        if done[1] + done[2] + (word[7] if leaf else 0.0) > budget:
            done[3] = 1
            return
        if where < 0:
            continue
        if leaf and (SHARES * word[7] <= capacity or word[6] >= deepest):
            state, count = poisson(word[7], state)
            done[1] += count
            while count > 0:
                if at == capacity:
                    at, uses = 0, uses + 1
                    if uses >= reuse:
                        state, uses = fill(pool, tree, state, orbits), 0
                taken = min(count, capacity - at)
                done[0] += _throw(pool, at, at + taken, word, size, canvas, plane, mode, places)
                at, count = at + taken, count - taken
            continue
        if top + n > len(stack):
            taller = np.empty((2 * len(stack), width))
            for k in range(top):
                _copy(stack[k], taller[k])
            stack = taller
        for i in range(n):
            if mass[i] > 0:
                _compose(word, maps, colours, i, word[7] * mass[i], stack[top])
                top += 1


@kernel(parallel=True)
def scatter(tree, size, jobs, budget, seeds, canvas, mode, reuse, tally):
    """Work off the words (J,8 or 12) of `cut` by as many tasks as there are seeds; tally (tasks,4) receives what they
    did."""
    tasks = len(seeds)
    for task in prange(tasks):
        plane = get_thread_id() if mode != DRY else 0
        _sample(jobs[task::tasks], tree, size, budget, seeds[task], canvas, plane, mode, reuse, tally[task])
