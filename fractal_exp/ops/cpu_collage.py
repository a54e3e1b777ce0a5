"""numba kernels of the collage operations: one code after another, threads share out the codes of a batch."""

from __future__ import annotations

import math

import numpy as np
from numba import float32, njit, prange

from .jit import FUSED, kernel
from .reference_collage import BETA_1, BETA_2, FLOOR, Descent

EDGE = float32(1.001)


def pushforward(maps: np.ndarray, weights: np.ndarray, samples: np.ndarray, size: int) -> np.ndarray:
    """See `reference_collage.pushforward`."""
    bins = np.zeros((len(maps), size * size), np.float32)
    _pushforward(maps, weights, samples, size, bins)
    return bins.reshape(len(maps), size, size)


def descend(maps: np.ndarray, weights: np.ndarray, samples: np.ndarray, roots: np.ndarray, mean: np.ndarray,
            covariance: np.ndarray, backgrounds: np.ndarray, chosen: np.ndarray, size: int, levels: int,
            how: Descent) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """See `reference_collage.descend`."""
    maps, weights = maps.copy(), weights.copy()
    errors = np.empty(len(maps), np.float32)
    _descend(maps, weights, samples, roots, mean, covariance, backgrounds, chosen, size, levels, errors, how.steps,
             how.rate, how.weight_rate, how.decay, how.largest, how.prior, how.identity_radius, how.identity_weight,
             how.tied)
    return maps, weights, errors


@njit(inline="always")
def _bin(m, x, y, size):
    """The lower left of the four bins that share a mapped point, and the shares of the next ones."""
    half = float32(0.5 * size)
    u = (m[0] * x + m[1] * y + m[4] + float32(1)) * half - float32(0.5)
    v = (float32(1) - (m[2] * x + m[3] * y + m[5])) * half - float32(0.5)
    u = min(max(u, float32(0)), size - EDGE)
    v = min(max(v, float32(0)), size - EDGE)
    column, row = int(u), int(v)
    return row * size + column, u - column, v - row


@njit(fastmath=FUSED)
def _add(m, weight, samples, size, bins):
    for k in range(samples.shape[0]):
        o, fu, fv = _bin(m, samples[k, 0], samples[k, 1], size)
        mass = weight * samples[k, 2]
        lower = mass * fv
        upper = mass - lower
        bins[o] += upper * (1 - fu)
        bins[o + 1] += upper * fu
        bins[o + size] += lower * (1 - fu)
        bins[o + size + 1] += lower * fu


@kernel(parallel=True, fastmath=FUSED)
def _pushforward(maps, weights, samples, size, bins):
    for b in prange(maps.shape[0]):
        for n in range(maps.shape[1]):
            if weights[b, n] > 0:
                _add(maps[b, n], weights[b, n], samples, size, bins[b])


@njit(fastmath=FUSED)
def _pull(m, weight, samples, size, slope, gradient):
    """The gradient of the error by a map's six numbers into gradient[0:6], by its weight into gradient[6]."""
    ga = gb = gc = gd = ge = gf = gw = float32(0)
    for k in range(samples.shape[0]):
        x, y, mass = samples[k, 0], samples[k, 1], samples[k, 2]
        o, fu, fv = _bin(m, x, y, size)
        d00, d01, d10, d11 = slope[o], slope[o + 1], slope[o + size], slope[o + size + 1]
        upper = d00 + (d01 - d00) * fu
        lower = d10 + (d11 - d10) * fu
        gw += mass * (upper + (lower - upper) * fv)
        du = mass * ((d01 - d00) * (1 - fv) + (d11 - d10) * fv)
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


@njit(fastmath=FUSED)
def _error(maps, weights, samples, roots, background, size, levels, bins, slope):
    """The collage error; leaves its derivative by each finest bin in slope[:size²]."""
    for i in range(size * size):
        bins[i] = background[i]
    for n in range(maps.shape[0]):
        if weights[n] > 0:
            _add(maps[n], weights[n], samples, size, bins)
    start, side = 0, size
    for _ in range(levels - 1):
        half = side // 2
        coarser = start + side * side
        for r in range(half):
            for c in range(half):
                i = start + 2 * r * side + 2 * c
                bins[coarser + r * half + c] = bins[i] + bins[i + 1] + bins[i + side] + bins[i + side + 1]
        start, side = coarser, half
    total = float32(0)
    share = float32(1 / levels)
    for i in range(roots.shape[0]):
        root = np.sqrt(bins[i] + float32(FLOOR))
        difference = root - roots[i]
        total += difference * difference
        slope[i] = share * difference / root
    for _ in range(levels - 1):  # from the coarsest down to the finest
        finer = start - 4 * side * side
        double = 2 * side
        for r in range(double):
            for c in range(double):
                slope[finer + r * double + c] += slope[start + (r // 2) * side + c // 2]
        start, side = finer, double
    return total * share


@njit(inline="always")
def _volume(m):
    return abs(m[0] * m[3] - m[1] * m[2]) + 0.01


@njit
def _push_off_identity(m, weight, mean, covariance, radius, strength, gradient):
    """Add the gradient of strength · weight · max(0, 1 - D²/radius²)², D the rms displacement of the measure."""
    a, b, c, d = m[0] - 1, m[1], m[2], m[3] - 1
    dx, dy = a * mean[0] + b * mean[1] + m[4], c * mean[0] + d * mean[1] + m[5]
    ga, gb = a * covariance[0, 0] + b * covariance[1, 0], a * covariance[0, 1] + b * covariance[1, 1]
    gc, gd = c * covariance[0, 0] + d * covariance[1, 0], c * covariance[0, 1] + d * covariance[1, 1]
    near = 1 - (a * ga + b * gb + c * gc + d * gd + dx * dx + dy * dy) / (radius * radius)
    if near > 0:
        g = -4 * near * strength * weight / (radius * radius)
        gradient[0] += g * (ga + dx * mean[0])
        gradient[1] += g * (gb + dx * mean[1])
        gradient[2] += g * (gc + dy * mean[0])
        gradient[3] += g * (gd + dy * mean[1])
        gradient[4] += g * dx
        gradient[5] += g * dy


@njit
def _contract(m, largest):
    """Clip the singular values at `largest`, by the closed form of the 2 × 2 decomposition."""
    e, f, g, h = (m[0] + m[3]) / 2, (m[0] - m[3]) / 2, (m[2] + m[1]) / 2, (m[2] - m[1]) / 2
    q, r = math.hypot(e, h), math.hypot(f, g)
    if q + r <= largest:
        return
    s1, s2 = largest, min(max(q - r, -largest), largest)
    q_scale = (s1 + s2) / 2 / max(q, 1e-12)
    r_scale = (s1 - s2) / 2 / max(r, 1e-12)
    m[0], m[3] = e * q_scale + f * r_scale, e * q_scale - f * r_scale
    m[2], m[1] = g * r_scale + h * q_scale, g * r_scale - h * q_scale


@njit(fastmath=FUSED)
def _total_volume(maps, weights):
    total = 0.0
    for n in range(maps.shape[0]):
        if weights[n] > 0:
            total += _volume(maps[n])
    return total


@njit(fastmath=FUSED)
def _tie(maps, weights, total):
    """Weights in proportion to the volumes, of the same total."""
    volume = _total_volume(maps, weights)
    for n in range(maps.shape[0]):
        if weights[n] > 0:
            weights[n] = total * _volume(maps[n]) / volume


@njit(fastmath=FUSED)
def _pass_on(m, g, by_volume):
    """Turn the gradient by a tied weight, times the weight's slope by the volume, into one by the map's matrix."""
    if m[0] * m[3] < m[1] * m[2]:
        by_volume = -by_volume
    g[0] += by_volume * m[3]
    g[3] += by_volume * m[0]
    g[1] -= by_volume * m[2]
    g[2] -= by_volume * m[1]
    g[6] = 0


@njit(fastmath=FUSED)
def _adam(g, first, second, k):
    """The moments after step k, and what Adam makes of the gradient, which it replaces."""
    for j in range(7):
        first[j] = BETA_1 * first[j] + (1 - BETA_1) * g[j]
        second[j] = BETA_2 * second[j] + (1 - BETA_2) * g[j] * g[j]
        g[j] = first[j] / (1 - BETA_1**k) / (math.sqrt(second[j] / (1 - BETA_2**k)) + 1e-7)


@kernel(parallel=True, fastmath=FUSED)
def _descend(maps, weights, samples, roots, mean, covariance, backgrounds, chosen, size, levels, errors, steps, rate,
             weight_rate, decay, largest, prior, radius, strength, tied):
    count = maps.shape[1]
    for b in prange(maps.shape[0]):
        m, w, background = maps[b], weights[b], backgrounds[chosen[b]]
        bins, slope = np.empty_like(roots), np.empty_like(roots)
        gradient = np.zeros((count, 7), np.float32)
        first, second = np.zeros((count, 7), np.float32), np.zeros((count, 7), np.float32)
        total = w.sum()
        for k in range(1, steps + 1):
            if tied:
                _tie(m, w, total)
            volume = _total_volume(m, w)
            _error(m, w, samples, roots, background, size, levels, bins, slope)
            pull = 0.0
            for n in range(count):
                if w[n] > 0:
                    _pull(m[n], w[n], samples, size, slope, gradient[n])
                    pull += gradient[n, 6] * w[n] / total
            falling = decay ** (k / steps)
            for n in range(count):
                if w[n] <= 0:
                    continue
                g = gradient[n]
                if tied:
                    _pass_on(m[n], g, (g[6] - pull) * total / volume)
                else:
                    g[6] *= w[n]
                    g[6] += prior * w[n] * math.log(w[n] * volume / (total * _volume(m[n])))
                _push_off_identity(m[n], w[n], mean, covariance, radius, strength, g)
                _adam(g, first[n], second[n], k)
                for j in range(6):
                    m[n, j] -= rate * falling * g[j]
                if not tied:
                    w[n] *= math.exp(-weight_rate * falling * g[6])
                _contract(m[n], largest)
        if tied:
            _tie(m, w, total)
        errors[b] = _error(m, w, samples, roots, background, size, levels, bins, slope)
