"""How a code contracts: in a norm, on average only, or neither. contraction.mjs finds the same for a page."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

NORM, AVERAGE, NEITHER = "norm", "average", "neither"
LEAST_SHRINKING = 1e-4    # exponents nearer to 0 cannot be told from 0 by so many angles


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
        from .contraction_kernels import best_ellipse, contracting_words  # maps that all contract need no numba

        axes = best_ellipse(linear, factor)
        words, letters = contracting_words(linear, offset, axes)
        matrices = words[:, :4].reshape(-1, 2, 2)
        factor = float(largest(axes @ (matrices if letters else linear) @ np.linalg.inv(axes)).max())
        return cls(axes, letters, factor, (matrices, words[:, 4:]), chances, linear)

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
        from .contraction_kernels import mean_growth

        return mean_growth(self._linear, self.chances, self.axes, LEAST_SHRINKING)


def largest(matrices: np.ndarray) -> np.ndarray:
    """The larger singular value (…) of matrices (…,2,2)."""
    a, b, c, d = (matrices[..., i, j] for i in (0, 1) for j in (0, 1))
    return (np.hypot(a + d, b - c) + np.hypot(a - d, b + c)) / 2
