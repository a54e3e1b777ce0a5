"""A plain paving: k-means cuts the shape into cells, and each gets a small copy of the whole shape."""

from __future__ import annotations

import warnings

import numpy as np
import torch
from torch import Tensor

from ....ifs.canvas import pixel_to_canvas
from ....runtime.seeds import derive
from .silhouette import Silhouette

LARGEST = 0.9        # largest singular value that a map may have
KMEANS_ROUNDS = 30   # of k-means (Lloyd 1982), which cuts the shape into cells


def paving(shape: Silhouette, count: int, seed: int = 0, mask: Tensor | None = None) -> Tensor:
    """Maps (count,6) that pave the shape, or the pixels of a mask (R,R) of it.

    k-means (Lloyd 1982, with k-means++ starts) cuts the pixels into cells. Each map gives the whole shape the mean and
    the covariance of a cell, longer axis on longer axis. So for a thin cell, it flattens the shape onto a line. An
    empty cell is replaced by another copy of the largest one. Singular values are clipped at `LARGEST`: the
    shorter axis of a cell may be longer than the shape's own, for instance where a line ends in a knob.
    """
    from scipy.cluster.vq import kmeans2

    whole, part = _centres(shape.mask, shape.side), _centres(shape.mask if mask is None else mask, shape.side)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that a cell is empty
        _, labels = kmeans2(part, min(count, len(part)), minit="++", iter=KMEANS_ROUNDS,
                            seed=derive(seed, "paving") % 2**32)  # pyright: ignore[reportCallIssue]: rng since 1.15
    cells = sorted((part[labels == label] for label in np.unique(labels)), key=len, reverse=True)
    cells = cells + cells[:1] * (count - len(cells))
    mean, (source, lengths) = whole.mean(0), _axes(whole, shape.side)
    linear = np.stack([directions * np.minimum(own / lengths, LARGEST) @ source.T
                       for directions, own in (_axes(cell, shape.side) for cell in cells)])
    offset = np.stack([cell.mean(0) for cell in cells]) - linear @ mean
    return torch.from_numpy(np.concatenate([linear.reshape(count, 4), offset], 1)).float()


def _centres(mask: Tensor, side: int) -> np.ndarray:
    """Positions (n,2) on the canvas of the pixels of a mask (R,R)."""
    return pixel_to_canvas(mask.nonzero().double() + 0.5, side).numpy()


def _axes(points: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """The principal axes of points (n,2) in columns, the shorter first, and the pixels' standard deviations along
    them."""
    off = points - points.mean(0)
    covariance = off.T @ off / len(points) + np.eye(2) * (2 / side) ** 2 / 12
    variances, directions = np.linalg.eigh(covariance)
    return directions, np.sqrt(variances)
