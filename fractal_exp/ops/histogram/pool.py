"""Random points of the invariant measure, kept in pools: what the kernels of `histogram` throw under words."""

from __future__ import annotations

import math

import numpy as np
from numba import njit, uint64

ORBITS = 16          # chaos games that a task keeps going, to hide the latency of a step
BURN_IN = 256        # steps that lead from a fixed point to the invariant measure
APART = 72           # numbers between a pool's rows; at a power of two, each would push the other out of the cache
LEAST_POOL, LARGEST_POOL = 256, 1 << 14  # points of the invariant measure that a task keeps, powers of two
REFILLS = 8          # how often a task comes by new ones, at most, before the largest pool is too small for that
GOLDEN_RATIO = (math.sqrt(5) - 1) / 2
GUIDE_BITS = 12      # the guide table inverts the cumulative probabilities to within one of its 4096 steps

GOLDEN = uint64(0x9E3779B97F4A7C15)
MIX_1 = uint64(0xBF58476D1CE4E5B9)
MIX_2 = uint64(0x94D049BB133111EB)


@njit(inline="always")
def random_bits(state):
    """The next state and 64 random bits: SplitMix64 (Steele, Lea and Flood 2014)."""
    state = state + GOLDEN
    z = (state ^ (state >> uint64(30))) * MIX_1
    z = (z ^ (z >> uint64(27))) * MIX_2
    return state, z ^ (z >> uint64(31))


def choice(p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The thresholds (N,) and the guide table (4096,) by which `pick` draws maps of probabilities p (N,), in any
    unit."""
    thresholds = np.round(np.cumsum(p) / p.sum() * 2**32).astype(np.uint64)
    thresholds[np.flatnonzero(p)[-1]:] = 2**32
    steps = np.arange(1 << GUIDE_BITS, dtype=np.uint64) << np.uint64(32 - GUIDE_BITS)
    return thresholds, np.searchsorted(thresholds, steps, side="right").astype(np.uint16)


@njit(inline="always")
def pick(bits, thresholds, guide):
    """The map that 32 random bits stand for."""
    i = int(guide[bits >> uint64(64 - GUIDE_BITS)])
    while bits >> uint64(32) >= thresholds[i]:
        i += 1
    return i


@njit(inline="always")
def step(maps, i, x, y):
    """Where map i of maps (N,6) sends the point (x, y)."""
    return maps[i, 0] * x + (maps[i, 1] * y + maps[i, 4]), maps[i, 2] * x + (maps[i, 3] * y + maps[i, 5])


@njit
def poisson(mean, state):
    """A Poisson variate: by a product of uniforms below 12, else by transformed rejection (PTRS, Hörmann 1993)."""
    unit = 2.0**-53
    if mean < 12.0:
        limit, count, product = math.exp(-mean), -1, 1.0
        while count < 0 or product > limit:
            state, bits = random_bits(state)
            product *= (float(bits >> uint64(11)) + 0.5) * unit
            count += 1
        return state, count
    root, log_mean = math.sqrt(mean), math.log(mean)
    b = 0.931 + 2.53 * root
    a = -0.059 + 0.02483 * b
    inverse_alpha = 1.1239 + 1.1328 / (b - 3.4)
    certain = 0.9277 - 3.6224 / (b - 2)
    while True:
        state, bits = random_bits(state)
        u = (float(bits >> uint64(11)) + 0.5) * unit - 0.5
        state, bits = random_bits(state)
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
def shade(colours, i, point):
    """Give a point (5,) of place and colour the colour that it has after map i."""
    for channel in range(3):
        point[2 + channel] = colours[i, 0] * point[2 + channel] + colours[i, 1 + channel]


@njit
def warm_up(tree, state):
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
            state, bits = random_bits(state)
            i = pick(bits, tree.thresholds, tree.guide)
            x, y = step(maps, i, x, y)
            if len(colours):
                shade(colours, i, orbits[j])
        orbits[j, 0], orbits[j, 1] = x, y
    return state, orbits


@njit
def new_pool(expected, width):
    """Room for points (width,P + APART) of the invariant measure, for a task of which so many are expected."""
    size = LEAST_POOL
    while size < LARGEST_POOL and REFILLS * size <= expected:
        size *= 2
    return np.empty((width, size + APART))


@njit
def fill(pool, tree, state, orbits):
    """The next points of the orbits into the pool (2 or 5,P + APART); the next random state. Those that follow each
    other in an orbit are alike where a map is slow, and would make a word's points clump: they are put .38 P from each
    other."""
    maps, colours = tree.maps, tree.colours
    size = pool.shape[1] - APART
    length, stride = size // ORBITS, int(GOLDEN_RATIO * size) | 1
    for k in range(size):
        j = k & (ORBITS - 1)
        state, bits = random_bits(state)
        i = pick(bits, tree.thresholds, tree.guide)
        x, y = step(maps, i, orbits[j, 0], orbits[j, 1])
        orbits[j, 0], orbits[j, 1] = x, y
        shuffled = (j * length + k // ORBITS) * stride & (size - 1)
        pool[0, shuffled], pool[1, shuffled] = x, y
        if len(colours):
            shade(colours, i, orbits[j])
            for channel in range(2, 5):
                pool[channel, shuffled] = orbits[j, channel]
    return state
