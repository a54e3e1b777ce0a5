"""How a code contracts: in a norm, on average only, or neither. contraction.mjs finds the same for a page."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

NORM, AVERAGE, NEITHER = "norm", "average", "neither"
SHORT = 1 - 1e-9          # a word of this size or more is not known to contract: covers the rounding
PLACES, LOOKS = 9, 60     # ellipses along each side of a look around the best one so far, and looks at most
REACH, LEAST_REACH = 2.0, 1e-4  # of a look, in logarithms of the ratio of the axes: the first and the last
GAIN = 1e-2               # least share of its size by which a look of reach 1 must lower the largest map
MOST_WORDS, MOST_LETTERS = 1 << 11, 64  # words that are looked at together, and of each
ANGLES = 256              # of the half circle of directions
LEAST_SHRINKING = 1e-4    # exponents nearer to 0 cannot be told from 0 by so many angles
STEPS, MOST_STEPS = 32, 4096  # over which the growth of a vector is averaged, at first and at last
TINY = 1e-300


@dataclass(frozen=True, eq=False)
class Contraction:
    """How the maps of a code that are ever chosen contract. `kind` says which of three holds:

    - "norm": every infinite product of the maps contracts (their joint spectral radius is below 1), so the attractor is
      compact. Vectors are measured by |`axes` x|, whose unit circle is an ellipse, axes (2,2). `words` are matrices
      (W,2,2) and offsets (W,2) of words with which every word of `letters` letters begins; they shrink each vector to
      `factor` of its length or less. letters is 1 where the maps themselves do. Where all singular values are below 1,
      axes is the identity.
    - "average": a random product contracts almost surely, since the top Lyapunov exponent under the probabilities is
      negative (Furstenberg and Kesten 1960), so the invariant measure exists (Brandt 1986); its support may be
      unbounded. No bound was found: letters is 0, factor the largest singular value in the best ellipse.
    - "neither".
    """

    axes: np.ndarray
    letters: int
    factor: float
    words: tuple[np.ndarray, np.ndarray] = field(repr=False)
    chances: np.ndarray = field(repr=False)
    _linear: np.ndarray = field(repr=False)

    @classmethod
    def of(cls, linear: np.ndarray, offset: np.ndarray, chances: np.ndarray) -> Contraction:
        """From linear (N,2,2), offset (N,2) and chances (N,), float64; a map of chance 0 does not count."""
        chosen = chances > 0
        linear, offset, chances = linear[chosen], offset[chosen], chances[chosen] / chances.sum()
        axes, factor = np.eye(2), float(largest(linear).max())
        if factor < 1:
            return cls(axes, 1, factor, (linear, offset), chances, linear)
        axes, factor = _ellipse(linear, factor)
        words, letters = _words(linear, offset, axes)
        if letters:
            factor = float(largest(axes @ words[0] @ np.linalg.inv(axes)).max())
        return cls(axes, letters, factor, words, chances, linear)

    @property
    def kind(self) -> str:
        """"norm", "average" or "neither"."""
        if self.letters:
            return NORM
        return AVERAGE if self.exponent < -LEAST_SHRINKING else NEITHER

    @property
    def exponent(self) -> float:
        """The top Lyapunov exponent, the mean logarithm by which a step stretches vectors; `error` above it at most."""
        return self._growth[1]

    @property
    def error(self) -> float:
        """How much larger `exponent` may be than the true one, beside the 1e-4 of its resolution."""
        return self._growth[1] - self._growth[0]

    @cached_property
    def _growth(self) -> tuple[float, float]:
        """The least and the largest mean growth over all directions. Whatever the stationary measure of directions is,
        the exponent lies between them after any number of steps."""
        step = math.pi / ANGLES
        angle = (np.arange(ANGLES) + 0.5) * step  # beside the axes, where a flat map has its kernel
        images = self.axes @ self._linear @ np.linalg.inv(self.axes) @ np.stack([np.cos(angle), np.sin(angle)])
        growth = self.chances @ np.log(np.maximum(np.hypot(images[:, 0], images[:, 1]), TINY))
        place = np.arctan2(images[:, 1], images[:, 0]) / step - 0.5
        first = np.floor(place).astype(np.int64)
        share, row = place - first, np.arange(ANGLES) * ANGLES
        transfer = sum(np.bincount((row + (first + side) % ANGLES).ravel(), (self.chances[:, None] * part).ravel(),
                                   ANGLES**2) for side, part in ((0, 1 - share), (1, share)))
        transfer, steps = np.reshape(transfer, (ANGLES, ANGLES)), STEPS
        while True:
            total = np.zeros(ANGLES)
            for _ in range(steps):
                growth = transfer @ growth
                total += growth
            low, high = float(total.min()) / steps, float(total.max()) / steps
            if high < -LEAST_SHRINKING or low >= -LEAST_SHRINKING or steps >= MOST_STEPS:
                return low, high
            steps *= 2


def largest(matrices: np.ndarray) -> np.ndarray:
    """The larger singular value (…) of matrices (…,2,2)."""
    return _largest(*(matrices[..., i, j] for i in (0, 1) for j in (0, 1)))


def _largest(a: np.ndarray, b: np.ndarray, c: np.ndarray, d: np.ndarray) -> np.ndarray:
    return (np.hypot(a + d, b - c) + np.hypot(a - d, b + c)) / 2  # so in contraction.mjs, to the last map


def _ellipse(linear: np.ndarray, size: float) -> tuple[np.ndarray, float]:
    """The matrix (2,2) of determinant 1 to whose ellipse the largest of the maps is least, and its size there.

    Ellipses are the points of the hyperbolic plane. A map's size is convex along the straight lines there, since the
    logarithm of the ratio of its singular values is the distance from a point to its image. So looks around, each in
    coordinates in which the best ellipse so far is a circle, lead to the least.
    """
    axes, reach = np.eye(2), REACH
    for _ in range(LOOKS):
        slant, height = (reach * np.linspace(-1, 1, PLACES))[:, None], np.exp(reach * np.linspace(-1, 1, PLACES))
        a, b, c, d = (linear[:, i, j, None, None] for i in (0, 1) for j in (0, 1))
        sizes = _largest(a - c * slant, (b + (a - d - c * slant) * slant) / height, c * height, d + c * slant).max(0)
        i, j = np.unravel_index(sizes.argmin(), sizes.shape)
        if sizes[i, j] < size * (1 - GAIN * reach):
            size = float(sizes[i, j])
            change = np.array([[1, -slant[i, 0]], [0, height[j]]])
            axes, linear = change @ axes, change @ linear @ np.linalg.inv(change)
        elif reach < LEAST_REACH:
            break
        else:
            reach /= 3
    return axes / math.sqrt(np.linalg.det(axes)), size


def _words(linear: np.ndarray, offset: np.ndarray, axes: np.ndarray) -> tuple[tuple[np.ndarray, np.ndarray], int]:
    """The matrices (W,2,2) and offsets (W,2) of the shortest words that contract by these axes, and the letters of the
    longest: each infinite word begins with one of them. No words, of 0 letters, if they were not found."""
    inverse, found = np.linalg.inv(axes), []
    matrices, offsets = np.eye(2)[None], np.zeros((1, 2))
    for letters in range(1, MOST_LETTERS + 1):
        if len(matrices) * len(linear) > MOST_WORDS:
            break
        offsets = (np.einsum("wij,nj->wni", matrices, offset) + offsets[:, None]).reshape(-1, 2)
        matrices = (matrices[:, None] @ linear).reshape(-1, 2, 2)
        short = largest(axes @ matrices @ inverse) < SHORT
        found.append((matrices[short], offsets[short]))
        matrices, offsets = matrices[~short], offsets[~short]
        if not len(matrices):
            return (np.concatenate([m for m, _ in found]), np.concatenate([o for _, o in found])), letters
    return (linear[:0], offset[:0]), 0
