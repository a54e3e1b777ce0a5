"""What a step of a descent does to one map: plain functions of numbers, compiled for CPUs and, by `cuda`, for GPUs."""

from __future__ import annotations

import math

from numba import njit

from ...ifs.code import PROBABILITY_FLOOR
from ...runtime.jit import FUSED


@njit(inline="always")
def volume_of(m):
    """|det| + 0.01, to which tied weights are in proportion."""
    return abs(m[0] * m[3] - m[1] * m[2]) + PROBABILITY_FLOOR


@njit
def push_off_identity(m, weight, mean, covariance, radius, strength, gradient):
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
def contract(m, largest, smaller):
    """Clip the singular values, by the closed form of the 2 × 2 decomposition."""
    e, f, g, h = (m[0] + m[3]) / 2, (m[0] - m[3]) / 2, (m[2] + m[1]) / 2, (m[2] - m[1]) / 2
    q, r = math.hypot(e, h), math.hypot(f, g)
    smaller = min(smaller, largest)
    if q + r <= largest and abs(q - r) <= smaller:
        return
    s1, s2 = min(q + r, largest), min(max(q - r, -smaller), smaller)
    q_scale = (s1 + s2) / 2 / max(q, 1e-12)
    r_scale = (s1 - s2) / 2 / max(r, 1e-12)
    m[0], m[3] = e * q_scale + f * r_scale, e * q_scale - f * r_scale
    m[2], m[1] = g * r_scale + h * q_scale, g * r_scale - h * q_scale


@njit(fastmath=FUSED)
def pass_on(m, g, by_volume):
    """Turn the gradient by a tied weight, times the weight's slope by the volume, into one by the map's matrix."""
    if m[0] * m[3] < m[1] * m[2]:
        by_volume = -by_volume
    g[0] += by_volume * m[3]
    g[3] += by_volume * m[0]
    g[1] -= by_volume * m[2]
    g[2] -= by_volume * m[1]
    g[6] = 0


@njit(fastmath=FUSED)
def adam(g, first, second, k, how):
    """The moments after step k, and what Adam makes of the gradient, which it replaces."""
    for j in range(7):
        first[j] = how.beta_1 * first[j] + (1 - how.beta_1) * g[j]
        second[j] = how.beta_2 * second[j] + (1 - how.beta_2) * g[j] * g[j]
        g[j] = first[j] / (1 - how.beta_1**k) / (math.sqrt(second[j] / (1 - how.beta_2**k)) + how.epsilon)
