"""numba kernels of `contraction`: a search asks of each code that it tries how its maps contract."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ..runtime.jit import kernel

SHORT = 1 - 1e-9          # a word of this size or more is not known to contract: covers the rounding
PLACES, LOOKS = 9, 60     # ellipses along each side of a look around the best one so far, and looks at most
REACH, LEAST_REACH = 2.0, 1e-4  # of a look, in logarithms of the ratio of the axes: the first and the last
GAIN = 1e-2               # least share of its size by which a look of reach 1 must lower the largest map
MOST_WORDS, MOST_LETTERS = 1 << 11, 64  # words that are looked at together, and of each
ANGLES = 256              # of the half circle of directions
STEPS, MOST_STEPS = 32, 4096  # over which the growth of a vector is averaged, at first and at last
TINY = 1e-300


@njit(inline="always")
def _largest(a, b, c, d):
    return (math.hypot(a + d, b - c) + math.hypot(a - d, b + c)) / 2  # so in contraction.mjs, to the last map


@njit(inline="always")
def _product(p, q):
    return (p[0] * q[0] + p[1] * q[2], p[0] * q[1] + p[1] * q[3],
            p[2] * q[0] + p[3] * q[2], p[2] * q[1] + p[3] * q[3])


@njit(inline="always")
def _inverse(p):
    det = p[0] * p[3] - p[1] * p[2]
    return p[3] / det, -p[1] / det, -p[2] / det, p[0] / det


@njit(inline="always")
def _within(axes, inverse, m):
    """A matrix in the coordinates of other axes."""
    return _product(_product(axes, m), inverse)


@kernel(error_model="numpy")
def best_ellipse(linear, size):
    """The matrix (2,2) of determinant 1 to whose ellipse the largest of the maps (N,2,2) is least; `size` is that of
    the largest one in a circle.

    Ellipses are the points of the hyperbolic plane. A map's size is convex along the straight lines there, since the
    logarithm of the ratio of its singular values is the distance from a point to its image. So looks around, each in
    coordinates in which the best ellipse so far is a circle, lead to the least.
    """
    maps = [(m[0, 0], m[0, 1], m[1, 0], m[1, 1]) for m in linear]
    axes, reach = (1.0, 0.0, 0.0, 1.0), REACH
    for _ in range(LOOKS):
        best, change = math.inf, axes
        for i in range(PLACES):
            slant = reach * (2 * i / (PLACES - 1) - 1)
            for j in range(PLACES):
                height, largest = math.exp(reach * (2 * j / (PLACES - 1) - 1)), 0.0
                for a, b, c, d in maps:
                    largest = max(largest, _largest(a - c * slant, (b + (a - d - c * slant) * slant) / height,
                                                    c * height, d + c * slant))
                if largest < best:
                    best, change = largest, (1.0, -slant, 0.0, height)
        if best < size * (1 - GAIN * reach):
            size, axes, back = best, _product(change, axes), _inverse(change)
            maps = [_within(change, back, m) for m in maps]
        elif reach < LEAST_REACH:
            break
        else:
            reach /= 3
    root = math.sqrt(axes[0] * axes[3] - axes[1] * axes[2])
    return np.array([[axes[0], axes[1]], [axes[2], axes[3]]]) / root


@kernel(error_model="numpy")
def contracting_words(linear, offset, axes):
    """The shortest words that contract by these axes, rows (W,6) of matrix and offset, and the letters of the longest:
    each infinite word begins with one of them. No words, of 0 letters, if they were not found. linear (N,2,2), offset
    (N,2), axes (2,2)."""
    maps, most = len(linear), MOST_WORDS
    own = (axes[0, 0], axes[0, 1], axes[1, 0], axes[1, 1])
    inverse = _inverse(own)
    found, count = np.empty((most, 6)), 0
    now, longer = np.empty((most, 6)), np.empty((most, 6))
    now[0], open_ = np.array([1.0, 0.0, 0.0, 1.0, 0.0, 0.0]), 1
    for letters in range(1, MOST_LETTERS + 1):
        if open_ * maps > most:
            break
        left = 0
        for w in range(open_):
            word = now[w]
            for n in range(maps):
                m = _product((word[0], word[1], word[2], word[3]),
                             (linear[n, 0, 0], linear[n, 0, 1], linear[n, 1, 0], linear[n, 1, 1]))
                x = word[0] * offset[n, 0] + word[1] * offset[n, 1] + word[4]
                y = word[2] * offset[n, 0] + word[3] * offset[n, 1] + word[5]
                a, b, c, d = _within(own, inverse, m)
                if _largest(a, b, c, d) < SHORT:
                    if count == len(found):
                        grown = np.empty((2 * count, 6))
                        grown[:count] = found
                        found = grown
                    found[count] = m[0], m[1], m[2], m[3], x, y
                    count += 1
                else:
                    longer[left] = m[0], m[1], m[2], m[3], x, y
                    left += 1
        now, longer, open_ = longer, now, left
        if left == 0:
            return found[:count].copy(), letters
    return found[:0].copy(), 0


@kernel(error_model="numpy")
def mean_growth(linear, chances, axes, near):
    """The least and the largest mean growth, in logarithms a step, of vectors of all directions, over more and more
    steps, until both lie on one side of -`near`. linear (N,2,2), chances (N,), axes (2,2)."""
    maps, step = len(linear), math.pi / ANGLES
    own = (axes[0, 0], axes[0, 1], axes[1, 0], axes[1, 1])
    inverse = _inverse(own)
    growth, total = np.zeros(ANGLES), np.zeros(ANGLES)
    first, share = np.empty((ANGLES, maps), np.int64), np.empty((ANGLES, maps))
    for k in range(ANGLES):
        angle = (k + 0.5) * step  # beside the axes, where a flat map has its kernel
        x, y = math.cos(angle), math.sin(angle)
        for n in range(maps):
            a, b, c, d = _within(own, inverse, (linear[n, 0, 0], linear[n, 0, 1], linear[n, 1, 0], linear[n, 1, 1]))
            u, v = a * x + b * y, c * x + d * y
            growth[k] += chances[n] * math.log(max(math.hypot(u, v), TINY))
            place = math.atan2(v, u) / step - 0.5
            first[k, n], share[k, n] = math.floor(place), place - math.floor(place)
    first, steps = first % ANGLES, STEPS
    while True:
        total[:] = 0
        for _ in range(steps):
            mean = np.zeros(ANGLES)
            for k in range(ANGLES):
                for n in range(maps):
                    i = first[k, n]
                    mean[k] += chances[n] * ((1 - share[k, n]) * growth[i] + share[k, n] * growth[(i + 1) % ANGLES])
            growth = mean
            total += growth
        low, high = total.min() / steps, total.max() / steps
        if high < -near or low >= -near or steps >= MOST_STEPS:
            return low, high
        steps *= 2
