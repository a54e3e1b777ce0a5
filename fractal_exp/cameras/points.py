"""Points of an attractor, from trajectories of a fixed length."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor

from .. import ops
from ..ifs import affine
from ..ifs.code import IFS
from ..ops.counts import point_counts
from ..runtime.seeds import generator

TRAJECTORY = 430   # points of each trajectory, including those of the warm-up
WARMUP = 30        # points at its start that are dropped, which lie off the attractor


def attractor_points(maps: Tensor, probabilities: Tensor, count: int, seed: int) -> Tensor:
    """About `count` points (P,2) of the chaos game with maps (N,6) and probabilities (N,)."""
    return ops.chaos_game(maps[:, :4].unflatten(1, (2, 2)), maps[:, 4:], seed=seed, probabilities=probabilities,
                          **trajectories(count))


def trajectories(count: int) -> dict[str, Any]:
    """Settings of the chaos game for about `count` points."""
    return {"trajectories": count // (TRAJECTORY - WARMUP) + 1, "length": TRAJECTORY, "warmup": WARMUP}


def counted(code: IFS, resolution: int, count: float, seed: int, spread: float = 0.0) -> Tensor:
    """The number of points in each pixel (R,R), of about `count` on the canvas and beyond. spread: the standard
    deviation, canvas units, by which each is moved at random."""
    points = attractor_points(affine.from_code(code), code.sampling_probabilities(), max(1, round(count)), seed)
    if spread:
        points = points + spread * torch.randn(points.shape, generator=generator(seed, "spread"))
    return point_counts(points, resolution).to(points.dtype)
