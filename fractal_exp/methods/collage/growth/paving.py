"""A plain paving: the shape cut into cells by k-means, a small copy of the whole in each."""

from __future__ import annotations

import warnings

import numpy as np
import torch
from torch import Tensor

from ....runtime.seeds import derive
from .silhouette import Silhouette

ROUNDS = 30          # of k-means


def paving(shape: Silhouette, count: int, seed: int = 0, mask: Tensor | None = None, *, largest: float) -> Tensor:
    """So many maps (count,6), which pave the shape, or the pixels of a mask (R,R) of it.

    The pixels are cut into cells by k-means (Lloyd 1982, begun as k-means++ says). Each map gives the whole shape the
    mean and the covariance of a cell, its longer axis along the cell's: a thin cell gets the shape flattened onto a
    line. Of a cell without pixels there is another copy of the largest one. No map has a singular value above
    `largest`: the shorter axis of a cell may be longer than that of the whole, for instance where a line ends in a
    knob.
    """
    from scipy.cluster.vq import kmeans2

    whole, part = _centres(shape.mask, shape.side), _centres(shape.mask if mask is None else mask, shape.side)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # that a cell is empty
        _, labels = kmeans2(part, min(count, len(part)), minit="++", iter=ROUNDS, seed=derive(seed, "paving") % 2**32)
    cells = sorted((part[labels == label] for label in np.unique(labels)), key=len, reverse=True)
    cells = cells + cells[:1] * (count - len(cells))
    mean, (source, lengths) = whole.mean(0), _axes(whole, shape.side)
    linear = np.stack([directions * np.minimum(own / lengths, largest) @ source.T
                       for directions, own in (_axes(cell, shape.side) for cell in cells)])
    offset = np.stack([cell.mean(0) for cell in cells]) - linear @ mean
    return torch.from_numpy(np.concatenate([linear.reshape(count, 4), offset], 1)).float()


def _centres(mask: Tensor, side: int) -> np.ndarray:
    """Where the pixels of a mask (R,R) are on the canvas, (n,2)."""
    row, column = mask.nonzero().T.numpy() + 0.5
    return np.stack([2 * column / side - 1, 1 - 2 * row / side], 1)


def _axes(points: np.ndarray, side: int) -> tuple[np.ndarray, np.ndarray]:
    """The principal axes of points (n,2) in columns, the shorter one first, and the standard deviations of the pixels
    along them."""
    off = points - points.mean(0)
    covariance = off.T @ off / len(points) + np.eye(2) * (2 / side) ** 2 / 12
    variances, directions = np.linalg.eigh(covariance)
    return directions, np.sqrt(variances)
