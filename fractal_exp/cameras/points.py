"""Points of an attractor, from trajectories of a fixed length."""

from __future__ import annotations

from typing import Any

from torch import Tensor

from .. import ops

TRAJECTORY = 430   # points of each trajectory, including those of the warm-up
WARMUP = 30        # points at its start that are dropped, which lie off the attractor


def attractor_points(maps: Tensor, probabilities: Tensor, count: int, seed: int) -> Tensor:
    """About `count` points (P,2) of the chaos game with maps (N,6) and probabilities (N,)."""
    return ops.chaos_game(maps[:, :4].unflatten(1, (2, 2)), maps[:, 4:], seed=seed, probabilities=probabilities,
                          **trajectories(count))


def trajectories(count: int) -> dict[str, Any]:
    """Settings of the chaos game for about `count` points."""
    return {"trajectories": count // (TRAJECTORY - WARMUP) + 1, "length": TRAJECTORY, "warmup": WARMUP}
