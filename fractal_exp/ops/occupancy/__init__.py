"""The pixels that the attractors of many codes light: one image for each code of a batch, without gradients."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from ...errors import InputError
from ...runtime.checks import check_count, check_memory, check_number
from .. import backends
from ..chaos import _check_code, _seeds, cumulative_thresholds

LEAST_SIDE = 1e-4  # a smaller attractor is a point: it is not enlarged further


@dataclass(frozen=True)
class Game:
    """Settings of a chaos game for the backends: `trajectories` of `length` points each, the first `warmup` dropped.

    frame: the longer side of the box, centred on the canvas, to which the points are brought; 0: they stay in place.
    """

    trajectories: int
    length: int
    warmup: int
    frame: float


def occupancy(
    linear: Tensor,                        # (…, N, 2, 2)
    offset: Tensor,                        # (…, N, 2)
    resolution: int,
    *,
    points: int = 65_536,
    trajectories: int = 64,
    warmup: int = 20,
    probabilities: Tensor | None = None,   # (…, N) or (N,)
    frame: float | None = None,
    seed: int | Tensor = 0,                # int, or int64 (…)
    backend: str = "auto",
) -> Tensor:                               # (…, R, R) uint8
    """1 where a pixel holds at least one point of the chaos game, else 0: images of the canvas [-1,1]², the y axis up.

    Each code gets about `points` points in `trajectories`, with the random numbers of `chaos_game`, which also explains
    `warmup`, `probabilities` and `seed`. Points off the canvas are left out. frame: the longer side to which the
    points' box is scaled, centred on the canvas, as in the paper's point generator (1.5); None leaves the points in
    place. A box below 0.0001 is not enlarged further.

    Raises `InputError` on wrong shapes, dtypes or devices, counts below 1, a frame that is not above 0, probabilities
    as in `chaos_game`, sizes that take more memory than there is, or a backend that cannot take the tensors.
    """
    batch, maps = _check_code(linear, offset)
    for name, value, least in (("resolution", resolution, 1), ("points", points, 1), ("trajectories", trajectories, 1),
                               ("warmup", warmup, 0)):
        check_count(name, value, least)
    if frame is not None:
        check_number("frame", frame, "a finite number above 0, or None", 1e-6)
    codes = math.prod(batch)
    check_memory(f"drawing {codes} codes at {resolution}²", float(codes) * resolution**2, linear.device,
                 "lower the resolution, or draw fewer codes at a time")
    if linear.dtype not in (torch.float32, torch.float64):
        raise InputError(f"linear must be float32 or float64, got {linear.dtype}; use tensor.float()")
    game = Game(trajectories, warmup + -(-points // trajectories), warmup, float(frame or 0))
    thresholds = cumulative_thresholds(probabilities, batch, maps, linear.device).expand(codes, maps)
    seeds = _seeds(seed, batch, linear.device).expand(codes)
    run = backends.load(__name__, backends.choose(backend, linear)).occupancy
    lit = run(linear.detach().reshape(codes, maps, 2, 2), offset.detach().reshape(codes, maps, 2), thresholds, seeds,
              game, resolution)
    return lit.view(*batch, resolution, resolution)
