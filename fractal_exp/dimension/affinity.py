"""The affinity dimension: how fast sums of Falconer's singular value function over all words shrink."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

ANGLES = 256                  # directions of the half circle
ROUNDS, STEADY = 400, 1e-7    # of the power iteration at most; change of the function at which it ends
SHARES = 0.0, 1e-4, 1e-3, 1e-2, 0.1, 0.5  # of a function's maximum, below which it is changed to make a bound tighter
NOTHING = 1e-300              # in the place of 0 where a logarithm is taken


class Pressure:
    """The growth P(s) of the sums of phi^s(A_w) over the words w of n letters: the logarithm of their n-th root, in
    the limit. phi^s is a^s for s up to 1, a b^(s-1) up to 2, (a b)^(s/2) above, with singular values a >= b.

    Up to s = 2, phi^s = a^q |det|^t, and P is the logarithm of the spectral radius of an operator on functions f >= 0
    of directions u: (L f)(u) = sum_i |det A_i|^t |A_i u|^q f(A_i u / |A_i u|). For L, applied n times to 1, sums
    |A_w u|^q |det A_w|^t over words. Any f bounds the radius by the smallest and the largest L f / f where f > 0
    (Collatz, Wielandt). f is linear between `ANGLES` directions, and the ratio is taken there and midway.
    """

    def __init__(self, linear: np.ndarray):
        """linear: matrices (N,2,2), of which all long products are small."""
        angles = np.arange(2 * ANGLES) * (np.pi / (2 * ANGLES))
        x, y = np.moveaxis(linear @ np.stack([np.cos(angles), np.sin(angles)]), 1, 0)
        place = np.arctan2(y, x) % np.pi * (ANGLES / np.pi)
        first, rows = place.astype(np.int64), np.arange(2 * ANGLES) * ANGLES
        self.determinants, self.lengths, self.share = np.abs(np.linalg.det(linear)), np.hypot(x, y), place - first
        self.cells = np.concatenate([rows + first % ANGLES, rows + (first + 1) % ANGLES]).ravel()
        self.function = np.ones(ANGLES)  # from which the next iteration begins

    def growth(self, s: float) -> float:
        """P(s), as precisely as the directions allow."""
        if s >= 2:
            return _log((self.determinants ** (s / 2)).sum())
        step, f, radius = self._operator(s)[::2].copy(), np.maximum(self.function, SHARES[1]), 0.0
        for _ in range(ROUNDS):
            before, image = f, step @ f
            radius = float(image.max())
            f = image / radius if radius else np.ones(ANGLES)
            if np.abs(f - before).max() <= STEADY:
                break
        self.function = f
        return _log(radius)

    def bounds(self, s: float) -> tuple[float, float]:
        """P(s) from below and from above."""
        growth, f = self.growth(s), self.function
        if s >= 2:
            return growth, growth
        operator = self._operator(s)
        return (_log(max(_ratios(operator, np.where(f > share, f, 0)).min() for share in SHARES)),
                _log(min(_ratios(operator, np.maximum(f, share)).max() for share in SHARES)))

    def _operator(self, s: float) -> np.ndarray:
        """L from values at the directions to those there and midway, (2K,K)."""
        q, t = (s, 0.0) if s <= 1 else (2 - s, s - 1)
        weights = self.determinants[:, None] ** t * self.lengths**q
        both = np.concatenate([weights * (1 - self.share), weights * self.share]).ravel()
        return np.bincount(self.cells, both, 2 * ANGLES**2).reshape(2 * ANGLES, ANGLES)


def _ratios(operator: np.ndarray, f: np.ndarray) -> np.ndarray:
    between = np.stack([f, (f + np.roll(f, -1)) / 2], 1).ravel()
    return (operator @ f)[between > 0] / between[between > 0]


def _log(value: float) -> float:
    return float(np.log(max(value, NOTHING)))


def affinity(linear: np.ndarray) -> tuple[float, float, float]:
    """A lower bound of the root of P, the root, and an upper bound, for two matrices or more, see `Pressure`."""
    pressure, top = Pressure(linear), 2.0
    while pressure.growth(top) > 0:
        top *= 2
    functions = lambda s: pressure.bounds(s)[0], pressure.growth, lambda s: pressure.bounds(s)[1]
    low, root, high = sorted(float(brentq(each, 0.0, top, xtol=1e-7)) for each in functions)
    return low, root, high
