"""numba kernels of the collage operations: one code after another, threads share out the codes of a batch."""

from __future__ import annotations

import math

import numpy as np
from numba import float32, int32, intp, njit, prange, uint64

from ...runtime.jit import FUSED, kernel
from ..chaos.cpu_kernels import GUIDE_BITS, hold, next_state, start
from .reference import EDGE as EDGE_CELLS
from .steps import adam, contract, pass_on, push_off_identity, volume_of

ABREAST = 8   # trajectories that are played together

EDGE = float32(EDGE_CELLS)

# A division that may raise, as Python's does, keeps LLVM from taking several cells at once.
vectorized = njit(fastmath=FUSED, error_model="numpy")


@vectorized
def _locate(m, samples, size, corner, right, down):
    """Of samples (3,K), the lower left of the four bins that share each when it is mapped, and the shares of the next
    ones to the right and down, into (K,) each."""
    half, last, side = float32(0.5 * size), float32(size) - EDGE, int32(size)
    a, b, e = m[0] * half, m[1] * half, (m[4] + float32(1)) * half - float32(0.5)
    c, d, f = -m[2] * half, -m[3] * half, (float32(1) - m[5]) * half - float32(0.5)
    x, y = samples[0], samples[1]
    for k in range(corner.shape[0]):
        u = min(last, max(float32(0), a * x[k] + b * y[k] + e))  # in this order, which makes 0 of NaN
        v = min(last, max(float32(0), c * x[k] + d * y[k] + f))
        column, row = int32(u), int32(v)
        corner[k] = row * side + column
        right[k] = u - float32(column)
        down[k] = v - float32(row)


@vectorized
def _add(weight, mass, corner, right, down, size, bins):
    """Share out the masses (K,) of located samples."""
    for k in range(corner.shape[0]):
        o = intp(corner[k])
        whole = weight * mass[k]
        lower = whole * down[k]
        upper = whole - lower
        beside = upper * right[k]
        bins[o] += upper - beside
        bins[o + 1] += beside
        beside = lower * right[k]
        bins[o + size] += lower - beside
        bins[o + size + 1] += beside


@kernel(parallel=True, fastmath=FUSED)
def pushforward(maps, weights, samples, size, bins):
    """Add the images of samples (3,K) under maps (B,N,6), times weights (B,N), to bins (B,G²)."""
    count = samples.shape[1]
    for b in prange(maps.shape[0]):
        corner, right, down = np.empty(count, np.int32), np.empty(count, np.float32), np.empty(count, np.float32)
        for n in range(maps.shape[1]):
            if weights[b, n] > 0:
                _locate(maps[b, n], samples, size, corner, right, down)
                _add(weights[b, n], samples[2], corner, right, down, size, bins[b])


@kernel(fastmath=FUSED)
def draw_letters(thresholds, guide, seed, letters, starts):
    """The maps that trajectories take, letters (B,L,ABREAST), and where they start, starts (B,2,ABREAST)."""
    for number in range(len(letters) * ABREAST):
        block, j = number // ABREAST, number % ABREAST
        state, starts[block, 0, j], starts[block, 1, j] = start(seed, number)
        for k in range(letters.shape[1]):
            state = next_state(state)
            variate = np.int64(state >> uint64(32))
            i = guide[variate >> (32 - GUIDE_BITS)]
            while variate >= thresholds[i]:
                i += 1
            letters[block, k, j] = i


@njit(fastmath=FUSED)
def _play(maps, letters, begin, warmup, points):
    """The points (ABREAST,2,L - warmup) of trajectories that take each step together: alone, each would wait for its
    own last step."""
    x, y = begin[0].copy(), begin[1].copy()
    for k in range(len(letters)):
        for j in range(ABREAST):
            m = maps[letters[k, j]]  # in the order that LLVM gives the sums of the chaos game: the same points to a bit
            u, v = hold(m[1] * y[j] + (m[0] * x[j] + m[4])), hold(m[3] * y[j] + (m[2] * x[j] + m[5]))
            x[j], y[j] = u, v
            if k >= warmup:
                points[j, 0, k - warmup], points[j, 1, k - warmup] = u, v


@kernel(parallel=True, fastmath=FUSED)
def orbit_bins(maps, letters, starts, trajectories, warmup, size, bins):
    """Add the orbits of codes, maps (B,N,6), to bins (B,G²); letters, starts: see `draw_letters`."""
    count = letters.shape[1] - warmup
    identity = np.array([1, 0, 0, 1, 0, 0], np.float32)
    for b in prange(maps.shape[0]):
        corner, right, down = np.empty(count, np.int32), np.empty(count, np.float32), np.empty(count, np.float32)
        points = np.empty((ABREAST, 2, count), np.float32)
        mass = np.full(count, float32(1 / (trajectories * count)))
        for block in range(len(letters)):
            _play(maps[b], letters[block], starts[block], warmup, points)
            for j in range(min(ABREAST, trajectories - block * ABREAST)):
                _locate(identity, points[j], size, corner, right, down)
                _add(float32(1), mass, corner, right, down, size, bins[b])


@vectorized
def _pull(weight, samples, corner, right, down, size, slope, gradient):
    """The gradient of the error by a map's six numbers into gradient[0:6], by its weight into gradient[6]."""
    ga = gb = gc = gd = ge = gf = gw = float32(0)
    for k in range(corner.shape[0]):
        x, y, mass = samples[0, k], samples[1, k], samples[2, k]
        o, fu, fv = intp(corner[k]), right[k], down[k]
        upper, lower = slope[o], slope[o + size]
        across, below = slope[o + 1] - upper, slope[o + size + 1] - lower
        upper += across * fu
        lower += below * fu
        gw += mass * (upper + (lower - upper) * fv)
        du = mass * (across + (below - across) * fv)
        dv = mass * (upper - lower)
        ga += du * x
        gb += du * y
        ge += du
        gc += dv * x
        gd += dv * y
        gf += dv
    scale = weight * float32(0.5 * size)
    gradient[0], gradient[1], gradient[2], gradient[3] = ga * scale, gb * scale, gc * scale, gd * scale
    gradient[4], gradient[5], gradient[6] = ge * scale, gf * scale, gw


@vectorized
def _look_up(weight, corner, right, down, size, slope, values):
    """Add to `values` (K,) the slope at each located sample."""
    for k in range(corner.shape[0]):
        o = intp(corner[k])
        upper, lower = slope[o], slope[o + size]
        upper += (slope[o + 1] - upper) * right[k]
        lower += (slope[o + size + 1] - lower) * right[k]
        values[k] += weight * (upper + (lower - upper) * down[k])


@kernel(parallel=True, fastmath=FUSED)
def pull_all(maps, weights, samples, size, slope, gradient, by_mass):
    """`_pull` of every map: gradients (B,N,7) from slopes (B,G²) by the bins; and those by the samples' masses,
    (B,K), or (B,0) if they are not wanted."""
    count = samples.shape[1]
    for b in prange(maps.shape[0]):
        corner, right, down = np.empty(count, np.int32), np.empty(count, np.float32), np.empty(count, np.float32)
        for n in range(maps.shape[1]):
            if weights[b, n] > 0:
                _locate(maps[b, n], samples, size, corner, right, down)
                _pull(weights[b, n], samples, corner, right, down, size, slope[b], gradient[b, n])
                if by_mass.size:
                    _look_up(weights[b, n], corner, right, down, size, slope[b], by_mass[b])


@vectorized
def _halve(fine, coarse):
    """The sums of 2 × 2 cells."""
    for r in range(coarse.shape[0]):
        upper, lower, sums = fine[2 * r], fine[2 * r + 1], coarse[r]
        for c in range(sums.shape[0]):
            sums[c] = upper[2 * c] + upper[2 * c + 1] + lower[2 * c] + lower[2 * c + 1]


@vectorized
def _hand_down(coarse, fine):
    """Add to 2 × 2 cells what the cell that they make up has."""
    for r in range(coarse.shape[0]):
        upper, lower, shared = fine[2 * r], fine[2 * r + 1], coarse[r]
        for c in range(shared.shape[0]):
            upper[2 * c] += shared[c]
            upper[2 * c + 1] += shared[c]
            lower[2 * c] += shared[c]
            lower[2 * c + 1] += shared[c]


@njit
def _grid(flat, size, level):
    """The cells of a level, of `size` >> level a side, among those of all grids, the finest first."""
    start, side = 0, size
    for _ in range(level):
        start, side = start + side * side, side // 2
    return flat[start:start + side * side].reshape(side, side)


@vectorized
def _leave_out(known, bins):
    """Nothing in the cells that do not count."""
    for i in range(known.shape[0]):
        bins[i] *= known[i]


@njit
def _tile(maps, weights, target, background, bins, corner, right, down):
    """The measure that the maps make up on all grids; corner, right and down are (N,K), see `_locate`."""
    samples, size, grids = target.samples, target.size, target.grids
    for i in range(size * size):  # a slice takes two seconds longer to compile, for the message of an error
        bins[i] = background[i]
    for n in range(maps.shape[0]):
        if weights[n] > 0:
            _locate(maps[n], samples, size, corner[n], right[n], down[n])
            _add(weights[n], samples[2], corner[n], right[n], down[n], size, bins)
    _leave_out(target.known, bins)
    for level in range(1, grids):
        _halve(_grid(bins, size, level - 1), _grid(bins, size, level))


@vectorized
def _slopes(bins, roots, size, grids, floor, known, slope):
    """The derivative of the collage error by each finest bin, in slope[:size²]."""
    share = float32(1 / grids)
    for i in range(roots.shape[0]):
        root = np.sqrt(bins[i] + floor)
        slope[i] = share * (root - roots[i]) / root
    for level in range(grids - 1, 0, -1):
        _hand_down(_grid(slope, size, level), _grid(slope, size, level - 1))
    _leave_out(known, slope)


@vectorized
def _error(bins, roots, grids, floor):
    """The collage error."""
    total = float32(0)
    for i in range(roots.shape[0]):
        difference = np.sqrt(bins[i] + floor) - roots[i]
        total += difference * difference
    return total * float32(1 / grids)


@njit(fastmath=FUSED)
def _total_volume(maps, weights):
    total = 0.0
    for n in range(maps.shape[0]):
        if weights[n] > 0:
            total += volume_of(maps[n])
    return total


@njit(fastmath=FUSED)
def _tie(maps, weights, total):
    """Weights in proportion to the volumes, of the same total."""
    volume = _total_volume(maps, weights)
    for n in range(maps.shape[0]):
        if weights[n] > 0:
            weights[n] = total * volume_of(maps[n]) / volume


@kernel(parallel=True, fastmath=FUSED, error_model="numpy")  # weights that sum to 0 spoil their own code alone
def descend(maps, weights, target, backgrounds, chosen, how, errors):
    """The target's samples are (3,K) here, `how` is `Settings`."""
    count = maps.shape[1]
    samples, roots, size, grids = target.samples, target.roots, target.size, target.grids
    floor, known = float32(target.floor), target.known
    for b in prange(maps.shape[0]):
        m, w, background = maps[b], weights[b], backgrounds[chosen[b]]
        bins, slope = np.empty_like(roots), np.empty_like(roots)
        located = count, samples.shape[1]
        corner, right, down = np.empty(located, np.int32), np.empty(located, np.float32), np.empty(located, np.float32)
        gradient = np.zeros((count, 7), np.float32)
        first, second = np.zeros((count, 7), np.float32), np.zeros((count, 7), np.float32)
        total = w.sum()
        for k in range(1, how.steps + 1):
            if how.tied:
                _tie(m, w, total)
            volume = _total_volume(m, w)
            _tile(m, w, target, background, bins, corner, right, down)
            _slopes(bins, roots, size, grids, floor, known, slope)
            pull = 0.0
            for n in range(count):
                if w[n] > 0:
                    _pull(w[n], samples, corner[n], right[n], down[n], size, slope, gradient[n])
                    pull += gradient[n, 6] * w[n] / total
            falling = how.decay ** (k / how.steps)
            for n in range(count):
                if w[n] <= 0:
                    continue
                g = gradient[n]
                if how.tied:
                    pass_on(m[n], g, (g[6] - pull) * total / volume)
                else:
                    g[6] *= w[n]
                    g[6] += how.prior * w[n] * math.log(w[n] * volume / (total * volume_of(m[n])))
                push_off_identity(m[n], w[n], target.mean, target.covariance, how.identity_radius,
                                   how.identity_weight, g)
                adam(g, first[n], second[n], k, how)
                for j in range(6):
                    m[n, j] -= how.rate * falling * g[j]
                if not how.tied:
                    w[n] *= math.exp(-how.weight_rate * falling * g[6])
                contract(m[n], how.largest, how.smaller)
        if how.tied:
            _tie(m, w, total)
        _tile(m, w, target, background, bins, corner, right, down)
        errors[b] = _error(bins, roots, grids, floor)
