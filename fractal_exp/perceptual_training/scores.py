"""Rank correlation of a distance with what it is to measure, within one truth and over all of them."""

from __future__ import annotations

import numpy as np


def spearman(distances: np.ndarray, sizes: np.ndarray) -> tuple[np.ndarray, float]:
    """Spearman's correlation of distances (T,K) and sizes (T,K): (T,), one for each truth, and that of all T·K pairs."""
    within = np.array([_correlation(_ranks(a), _ranks(b)) for a, b in zip(distances, sizes, strict=True)])
    return within, _correlation(_ranks(distances.ravel()), _ranks(sizes.ravel()))


def intervals(distances: np.ndarray, sizes: np.ndarray, draws: int = 1000, seed: int = 0) -> dict[str, list[float]]:
    """Mean within a truth and pooled correlation, each with its 95% bootstrap interval over the truths."""
    within, pooled = spearman(distances, sizes)
    rng = np.random.Generator(np.random.PCG64(seed))
    picks = rng.integers(len(distances), size=(draws, len(distances)))
    ranked = [(within[pick].mean(), spearman(distances[pick], sizes[pick])[1]) for pick in picks]
    low, high = np.quantile(ranked, [0.025, 0.975], axis=0)
    return {"within": [float(within.mean()), float(low[0]), float(high[0])],
            "pooled": [pooled, float(low[1]), float(high[1])]}


def _ranks(values: np.ndarray) -> np.ndarray:
    """Ranks from 0, ties at their mean."""
    _, inverse, counts = np.unique(values, return_inverse=True, return_counts=True)
    return (np.cumsum(counts) - (counts + 1) / 2)[inverse]


def _correlation(a: np.ndarray, b: np.ndarray) -> float:
    a, b = a - a.mean(), b - b.mean()
    scale = np.sqrt((a * a).sum() * (b * b).sum())
    return float((a * b).sum() / scale) if scale > 0 else 0.0
