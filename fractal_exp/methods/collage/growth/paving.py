"""A plain paving: k-means cuts the measure into cells, and each gets a small copy of the whole."""

from __future__ import annotations

import warnings

import numpy as np
import torch

from ....runtime.seeds import derive, generator
from ..state import WeightedMaps
from .exposed import Exposed

LARGEST = 0.95          # largest singular value that a map may have
KMEANS_ROUNDS = 30      # of k-means (Lloyd 1982), which cuts the measure into cells
POINTS_OF_A_CELL = 200  # of the measure, on average
LEAST_POINTS = 20_000   # of the measure in all


def paving(target: Exposed, count: int, seed: int = 0) -> WeightedMaps:
    """Maps (count,6) that pave a picture, weighted with the mass of their cells.

    k-means (Lloyd 1982, with k-means++ starts) cuts points of the measure into cells. Each map gives the whole measure
    the mean and the covariance of a cell, longer axis on longer axis, upright rather than upside down. So for a thin
    cell, it flattens the picture onto a line. An empty cell is replaced by another copy of the largest one. Singular
    values are clipped at `LARGEST`.
    """
    from scipy.cluster.vq import kmeans2

    g = generator(seed, "paving")
    points = target.points(max(LEAST_POINTS, POINTS_OF_A_CELL * count), g).double().numpy()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that a cell is empty
        _, labels = kmeans2(points, count, minit="++", iter=KMEANS_ROUNDS,
                            seed=derive(seed, "cells") % 2**32)  # pyright: ignore[reportCallIssue]: rng since 1.15
    cells = sorted((points[labels == label] for label in np.unique(labels)), key=len, reverse=True)
    cells = cells + cells[:1] * (count - len(cells))
    mean, (source, lengths) = points.mean(0), _axes(points, target.side)
    linear = np.stack([directions * np.minimum(own / lengths, LARGEST) @ source.T
                       for directions, own in (_axes(cell, target.side) for cell in cells)])
    linear[linear[:, 1, 1] < 0] *= -1
    offset = np.stack([cell.mean(0) for cell in cells]) - linear @ mean
    maps = torch.from_numpy(np.concatenate([linear.reshape(count, 4), offset], 1)).float()
    return WeightedMaps(maps, torch.tensor([len(cell) / len(points) for cell in cells]))


def _axes(points: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """The principal axes of points (n,2) in columns, the shorter first, right-handed, and the standard deviations along
    them, at least those of a pixel."""
    off = points - points.mean(0)
    covariance = off.T @ off / len(points) + np.eye(2) * (2 / side) ** 2 / 12
    variances, directions = np.linalg.eigh(covariance)
    if np.linalg.det(directions) < 0:
        directions = directions * [-1, 1]
    return directions, np.sqrt(variances)
