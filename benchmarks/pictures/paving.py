"""The plainest code of any shape: as many small copies of the whole as asked for, each laid over a part of it."""

from __future__ import annotations

import warnings

import numpy as np
import torch

from fractal_exp.ifs.code import IFS

LARGEST = 0.95              # singular value of a copy
LEAST = 1e-9                # variance that keeps a root of a matrix real


def paving(mask: np.ndarray, count: int) -> IFS:
    """At most `count` maps on the canvas that cover the lit pixels of a mask (R,R).

    The pixels fall into clusters (k-means); each map takes the mean and the covariance of the whole shape to those of
    a cluster. An empty mask gives a single point.
    """
    from scipy.cluster.vq import kmeans2

    rows, columns = np.nonzero(mask)
    side = len(mask)
    at = np.stack([(2 * columns + 1) / side - 1, 1 - (2 * rows + 1) / side], 1)
    if len(at) == 0:
        return IFS(torch.zeros(1, 2, 2), torch.zeros(1, 2))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of clusters that ran empty
        _, label = kmeans2(at, min(count, len(at)), minit="++", seed=0)
    pixel = np.eye(2) / (3 * side**2)  # a pixel's own variance, of side 2/R
    whole, middle = np.cov(at.T, bias=True) + pixel, at.mean(0)
    back = np.linalg.inv(_root(whole))
    linear, offset = [], []
    for k in np.unique(label):
        part = at[label == k]
        matrix = _shrunk(_root(np.cov(part.T, bias=True) + pixel) @ back)
        linear.append(matrix)
        offset.append(part.mean(0) - matrix @ middle)
    return IFS(torch.from_numpy(np.stack(linear)), torch.from_numpy(np.stack(offset)))


def _root(covariance: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(covariance)
    return vectors * np.sqrt(values.clip(LEAST)) @ vectors.T


def _shrunk(matrix: np.ndarray) -> np.ndarray:
    u, s, v = np.linalg.svd(matrix)
    return u * s.clip(max=LARGEST) @ v
