"""The numba kernels of `histogram`: random points of an invariant measure under the words of its address tree, float64,
multi-threaded."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import get_thread_id, int32, njit, prange, uint64

from ...runtime.jit import kernel

ORBITS = 16          # chaos games that a task keeps going, to hide the latency of a step
BURN_IN = 256        # steps that lead from a fixed point to the invariant measure
APART = 72           # numbers between a pool's rows; at a power of two, each would push the other out of the cache
LEAST_POOL, LARGEST_POOL = 256, 1 << 14  # points of the invariant measure that a task keeps, powers of two
REFILLS = 8          # how often a task comes by new ones, at most, before the largest pool is too small for that
SHARES = 8           # a word is split until its points are so small a part of those kept: none lies twice under it
LEVELS = 512         # but no deeper below the word that the task began with
GOLDEN_RATIO = (math.sqrt(5) - 1) / 2
FEW = 64.0           # expected points under a word, below which throwing them is cheaper than a look at its children
SMALL = 1 / 8        # of the window's side: words that reach no further are drawn and tested, not split
BATCH = 256          # points of a word that are placed at a time
CUT = 4096           # words are split until each holds at most this fraction of the window's points
MAX_DEPTH = 20_000   # of a word; deeper ones likewise
GUIDE_BITS = 12      # the guide table inverts the cumulative probabilities to within one of its 4096 steps

# What becomes of a point: nothing, a 1 in its pixel, one more in its pixel, or a 1 in its part of a pixel and its
# colour added to the pixel's.
DRY, LIT, COUNTED, COLOURED = 0, 1, 2, 3
COLOUR_UNIT = 65536.0  # of a colour's 1 in the sums, which are integers: no order of adding them changes the result
PLACE, WITH_COLOUR = 8, 12  # numbers of a word without and with a colour

GOLDEN = uint64(0x9E3779B97F4A7C15)
MIX_1 = uint64(0xBF58476D1CE4E5B9)
MIX_2 = uint64(0x94D049BB133111EB)


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
def poisson(mean, state):
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
def place(a, b, c, d, x, y, hull, size):
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
def _colour(colours, i, point):
    """Give a point (5,) of place and colour the colour that it has after map i."""
    for channel in range(3):
        point[2 + channel] = colours[i, 0] * point[2 + channel] + colours[i, 1 + channel]


@njit
def _warm_up(tree, state):
    """ORBITS points of the invariant measure, (ORBITS,2), or (ORBITS,5) with their colours."""
    maps, colours = tree.maps, tree.colours
    orbits = np.zeros((ORBITS, 5 if len(colours) else 2))
    if len(colours):  # from the mean colour on, which slow blends would take long to reach
        given = np.zeros(4)
        for i in range(len(colours)):
            given[0] += tree.mass[i] * (1 - colours[i, 0])
            for channel in range(1, 4):
                given[channel] += tree.mass[i] * colours[i, channel]
        for j in range(ORBITS):
            for channel in range(3):
                orbits[j, 2 + channel] = given[1 + channel] / given[0]
    for j in range(ORBITS):
        x = y = 0.0
        for _ in range(BURN_IN):
            state, bits = _random(state)
            i = _pick(bits, tree.thresholds, tree.guide)
            x, y = _step(maps, i, x, y)
            if len(colours):
                _colour(colours, i, orbits[j])
        orbits[j, 0], orbits[j, 1] = x, y
    return state, orbits


@njit
def _new_pool(expected, width):
    """Room for points (width,P + APART) of the invariant measure, for a task of which so many are expected."""
    size = LEAST_POOL
    while size < LARGEST_POOL and REFILLS * size <= expected:
        size *= 2
    return np.empty((width, size + APART))


@njit
def _fill(pool, tree, state, orbits):
    """The next points of the orbits into the pool (2 or 5,P + APART); the next random state. Those that follow each
    other in an orbit are alike where a map is slow, and would make a word's points clump: they are put .38 P from each
    other."""
    maps, colours = tree.maps, tree.colours
    size = pool.shape[1] - APART
    length, stride = size // ORBITS, int(GOLDEN_RATIO * size) | 1
    for k in range(size):
        j = k & (ORBITS - 1)
        state, bits = _random(state)
        i = _pick(bits, tree.thresholds, tree.guide)
        x, y = _step(maps, i, orbits[j, 0], orbits[j, 1])
        orbits[j, 0], orbits[j, 1] = x, y
        shuffled = (j * length + k // ORBITS) * stride & (size - 1)
        pool[0, shuffled], pool[1, shuffled] = x, y
        if len(colours):
            _colour(colours, i, orbits[j])
            for channel in range(2, 5):
                pool[channel, shuffled] = orbits[j, channel]
    return state


@njit
def _throw(pool, begin, end, word, size, canvas, plane, mode, places):
    """Put so much of the pool (2 or 5,P + APART) under a word; how many points fell into the window. `places` (BATCH,)
    int32 is room for where points are on the plane, -1 beside the window. They are computed many at once."""
    a, b, c, d, x, y = word[0], word[1], word[2], word[3], word[4], word[5]
    marks, sums, across, kept = canvas.parts[plane], canvas.sums, int32(canvas.across), 0
    for first in range(begin, end, BATCH):
        last = min(first + BATCH, end)
        xs, ys = pool[0, first:last], pool[1, first:last]
        for k in range(len(xs)):
            column, row = a * xs[k] + (b * ys[k] + x), c * xs[k] + (d * ys[k] + y)
            inside = (column >= 0) & (column < size) & (row >= 0) & (row < size)
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
    return where, where == 1 or reach <= SMALL * size or word[7] < FEW or word[6] >= MAX_DEPTH


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
    state, orbits = _warm_up(tree, state)
    pool, uses = _new_pool(jobs[:, 7].sum(), orbits.shape[1]), reuse
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
                        state, uses = _fill(pool, tree, state, orbits), 0
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
