"""Rank correlation of a distance with what it is to measure, within one truth and over all of them."""

from __future__ import annotations

import numpy as np


def spearman(distances: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, float]:
    """Spearman's correlation of distances (T,K) and sizes (T,K): (T,), one a truth, and that of all T·K pairs."""
    within = np.array([_correlation(_ranks(a), _ranks(b)) for a, b in zip(distances, sizes, strict=True)])
    return within, _correlation(_ranks(distances.ravel()), _ranks(sizes.ravel()))


def intervals(distances: np.ndarray, sizes: np.ndarray, other: np.ndarray | None = None, draws: int = 1000,
              seed: int = 0) -> dict[str, list[float]]:
    """Mean within a truth and pooled correlation, each with its 95% bootstrap interval over the truths; with the
    distances of another measure, `other` (T,K) on the same pairs, by how much they are above that one's."""
    def both(pick: np.ndarray) -> np.ndarray:
        within, pooled = spearman(distances[pick], sizes[pick])
        scores = np.array([within.mean(), pooled])
        if other is not None:
            within, pooled = spearman(other[pick], sizes[pick])
            scores -= within.mean(), pooled
        return scores

    rng = np.random.Generator(np.random.PCG64(seed))
    drawn = [both(pick) for pick in rng.integers(len(distances), size=(draws, len(distances)))]
    low, high = np.quantile(drawn, [0.025, 0.975], axis=0)
    rows = zip(("within", "pooled"), both(np.arange(len(distances))), low, high, strict=True)
    return {name: [float(mean), float(least), float(most)] for name, mean, least, most in rows}


def _ranks(values: np.ndarray) -> np.ndarray:
    """Ranks from 0, ties at their mean."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts + 1) / 2)[inverse]


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    a, b = a - a.mean(), b - b.mean()
    scale = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / scale) if scale > 0 else 0.0
