"""Codes near a code, and how far they are from it: by what the points of one address are moved, root mean square."""

from __future__ import annotations

import numpy as np
import torch

from fractal_exp.ifs.attractor import FRAME_SIDE
from fractal_exp.ifs.code import IFS
from fractal_exp.training.codes import Maps, table
from fractal_exp.training.drawing import orbit

POINTS = 2048          # of an attractor, to frame it and to measure displacements by
LARGEST_SINGULAR = 0.99
KINDS = ("all", "one", "rotation", "translation", "scale")


def ifs(maps: Maps) -> IFS:
    """The code of maps (N,6); `fractal_exp.training.codes.rows` is the way back."""
    return IFS(torch.from_numpy(maps[:, :4]).reshape(-1, 2, 2), torch.from_numpy(maps[:, 4:]))


def frame(points: np.ndarray) -> tuple[float, np.ndarray]:
    """Scale and shift (2,) that bring the box of points (P,2) to the canvas as `attractor.normalize` does."""
    low, high = points.min(0), points.max(0)
    scale = FRAME_SIDE / max(float((high - low).max()), 1e-5)
    return scale, -scale * (low + high) / 2


def perturbed(maps: Maps, kind: str, size: float, center: np.ndarray, rng: np.random.Generator) -> Maps:
    """A copy of a code whose parameters moved at random by about `size`, and no map expands.

    kind: `all` parameters or those of `one` map by a normal variate of this spread; the `rotation` of one map in
    radians about the image of `center`, its `translation`, its `scale` (about that image too, as a logarithm).
    """
    moved, which = maps.copy(), int(rng.integers(len(maps)))
    if kind == "all":
        moved += size * rng.standard_normal(maps.shape)
    elif kind == "one":
        moved[which] += size * rng.standard_normal(6)
    elif kind == "translation":
        moved[which, 4:] += size * rng.standard_normal(2)
    else:
        amount = size * rng.standard_normal()
        cos, sin = np.cos(amount), np.sin(amount)
        turn = np.array([[cos, -sin], [sin, cos]]) if kind == "rotation" else np.exp(amount) * np.eye(2)
        linear = maps[which, :4].reshape(2, 2)
        moved[which, :4] = (turn @ linear).ravel()
        moved[which, 4:] += (linear - turn @ linear) @ center
    return contractive(moved)


def contractive(maps: Maps) -> Maps:
    """The code with every matrix that stretches by more than .99 shrunk to that."""
    stretch = np.linalg.norm(maps[:, :4].reshape(-1, 2, 2), ord=2, axis=(1, 2))
    maps = maps.copy()
    maps[:, :4] *= np.minimum(1, LARGEST_SINGULAR / np.maximum(stretch, 1e-9))[:, None]
    return maps


def orbits_of_one_address(truth: Maps, copies: list[Maps], seed: int) -> np.ndarray:
    """Points (1 + C,2048,2) of a code and of copies with as many maps, point by point of the same addresses."""
    maps, p = table([truth, *copies])
    return orbit(maps, p[:1].repeat(len(maps), 0), np.full(len(maps), seed, np.int64), POINTS)


def displacement(points: np.ndarray, moved: np.ndarray) -> float:
    """Root mean square distance of points (P,2) from those of the same address, in the points' unit."""
    return float(np.sqrt(np.square(points - moved).sum(-1).mean()))
