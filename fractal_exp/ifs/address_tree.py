"""numba kernels on the address tree of an IFS: how far it can reach at most, the word that reaches farthest, and the
points that chaos games visit."""

from __future__ import annotations

import math

import numpy as np

from ..runtime.jit import kernel


@kernel()
def lowered(table, first, weights, shift, tolerance, sweeps):
    """The upper bounds (K,) of the table after at most so many sweeps h_k <- min(h_k, max_i w_ik0 h_f + w_ik1 h_f+1 +
    s_ik), f = first_ik; first (N,K), weights (N,K,2), shift (N,K). Ends where no bound falls by more than `tolerance`.
    """
    maps, directions = shift.shape
    for _ in range(sweeps):
        swept, fall = np.empty_like(table), 0.0
        for k in range(directions):
            highest = -math.inf
            for i in range(maps):
                f = first[i, k]
                reach = weights[i, k, 0] * table[f] + weights[i, k, 1] * table[(f + 1) % directions] + shift[i, k]
                highest = max(highest, reach)
            swept[k] = min(table[k], highest)
            fall = max(fall, table[k] - swept[k])
        table = swept
        if fall <= tolerance:
            break
    return table


@kernel()
def raised(table, first, weights, shift, sweeps):
    """The upper bounds (K,) of u_k·f_w(x) over all words w of at most `sweeps` letters, from those of u_k·x in the
    table: as in `lowered`, but from below, h_k <- max(h_k, max_i w_ik0 h_f + w_ik1 h_f+1 + s_ik)."""
    maps, directions = shift.shape
    for _ in range(sweeps):
        swept, rise = table.copy(), False
        for k in range(directions):
            for i in range(maps):
                f = first[i, k]
                reach = weights[i, k, 0] * table[f] + weights[i, k, 1] * table[(f + 1) % directions] + shift[i, k]
                if reach > swept[k]:
                    swept[k], rise = reach, True
        table = swept
        if not rise:
            break
    return table


@kernel()
def farthest_word(u, linear, offset, chance, mean, table, least, tolerance):
    """max u·f_w(mean) over the words w of chance at least `least`, to within `tolerance`, and that word, its letters
    from the outermost map on: depth first, the most promising map first, leaving out what the half planes of `table`
    (K,) show to be nearer.

    A word is kept as the row v = u^T M_w, the number s = u·b_w and its chance, since u·f_w(x) = v·x + s; and as the
    number of its last letter among all `letters`, each of which knows the one before.
    """
    maps, directions = linear.shape[0], table.shape[0]
    delta = 2 * math.pi / directions
    stack = np.empty((256, 5))
    stack[0] = u[0], u[1], 0.0, 1.0, -1.0
    letters, before, count = np.empty(256, np.int32), np.empty(256, np.int64), 0
    value = np.empty(maps)
    height, best, last = 1, -math.inf, -1
    while height > 0:
        height -= 1
        v0, v1, s, p, letter = stack[height]
        reached = v0 * mean[0] + v1 * mean[1] + s
        if reached > best:
            best, last = reached, int(letter)
        angle = math.atan2(v1, v0) % (2 * math.pi)
        k = min(int(angle / delta), directions - 1)
        phi = angle - k * delta
        upper = math.sin(delta - phi) * table[k] + math.sin(phi) * table[(k + 1) % directions]
        if math.hypot(v0, v1) / math.sin(delta) * upper + s <= best + tolerance:
            continue
        if height + maps > len(stack):
            grown = np.empty((2 * len(stack) + maps, 5))
            grown[:height] = stack[:height]
            stack = grown
        if count + maps > len(letters):
            letters = np.concatenate((letters, np.empty(len(letters) + maps, np.int32)))
            before = np.concatenate((before, np.empty(len(before) + maps, np.int64)))
        first = height
        for i in range(maps):
            if p * chance[i] < least:
                continue
            r0 = v0 * linear[i, 0, 0] + v1 * linear[i, 1, 0]
            r1 = v0 * linear[i, 0, 1] + v1 * linear[i, 1, 1]
            t = s + v0 * offset[i, 0] + v1 * offset[i, 1]
            x = r0 * mean[0] + r1 * mean[1] + t
            j = height
            while j > first and value[j - 1 - first] > x:  # sorted, so that the farthest is taken next
                stack[j] = stack[j - 1]
                value[j - first] = value[j - 1 - first]
                j -= 1
            letters[count], before[count] = i, int(letter)
            stack[j] = r0, r1, t, p * chance[i], float(count)
            value[j - first] = x
            height, count = height + 1, count + 1
    length, node = 0, last
    while node >= 0:
        length, node = length + 1, before[node]
    word = np.empty(length, np.int32)
    while last >= 0:
        length -= 1
        word[length], last = letters[last], before[last]
    return best, word


@kernel(error_model="numpy")
def visited(linear, offset, letters, start, skipped):
    """The points (S - skipped, K, 2) of K chaos games from one start (2,), which take the maps of letters (S,K)."""
    steps, games = letters.shape
    points, now = np.empty((steps - skipped, games, 2)), np.empty((games, 2))
    now[:] = start
    for step in range(steps):
        for k in range(games):
            i, x, y = letters[step, k], now[k, 0], now[k, 1]
            now[k, 0] = linear[i, 0, 0] * x + linear[i, 0, 1] * y + offset[i, 0]
            now[k, 1] = linear[i, 1, 0] * x + linear[i, 1, 1] * y + offset[i, 1]
        if step >= skipped:
            points[step - skipped] = now
    return points


@kernel(error_model="numpy")
def chosen(cumulative, uniform):
    """The numbers (S,K) of the first cumulated chance (N,) above each uniform number (S,K)."""
    letters = np.empty(uniform.shape, np.int64)
    for s in range(uniform.shape[0]):
        for k in range(uniform.shape[1]):
            i = 0
            while cumulative[i] <= uniform[s, k]:
                i += 1
            letters[s, k] = i
    return letters
