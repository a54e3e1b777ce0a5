"""Powers of two that keep gradients away from denormal numbers, which are slow on processors."""

from __future__ import annotations

import numpy as np


def factors(gradients: np.ndarray, exponent: int) -> np.ndarray:
    """For each row (B,…), the power of two (B,), float64, that brings its largest finite magnitude into [2^(exponent -
    1), 2^exponent); 1 for a row of zeros. Multiplying and dividing by it is exact in float64.
    """
    rows = gradients.reshape(len(gradients), -1)
    largest = np.maximum(rows.max(1), -rows.min(1))  # NaN if the row has one
    spoilt = ~np.isfinite(largest)
    if spoilt.any():
        largest[spoilt] = np.abs(np.where(np.isfinite(rows[spoilt]), rows[spoilt], 0)).max(1)
    _, exponents = np.frexp(largest.astype(np.float64))
    return np.where(largest > 0, np.ldexp(1.0, exponent - exponents), 1.0)
