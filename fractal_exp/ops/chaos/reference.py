"""The torch twin of the chaos game: the specification, for any device, float32 or float64, by plain autograd.

The public function has checked and flattened its arguments: one leading axis B of codes, `thresholds` instead of
probabilities, one seed per code. Kernels draw exactly the same random numbers.
"""

from __future__ import annotations

import torch
from torch import Tensor

GOLDEN = -7046029254386353131      # 0x9E3779B97F4A7C15 as a signed integer: 2^64 over the golden ratio
MIX_1 = -4658895280553007687       # 0xBF58476D1CE4E5B9
MIX_2 = -7723592293110705685       # 0x94D049BB133111EB
ESCAPE = 1e6  # coordinate at which a point that runs away is stopped


def chaos_game(linear: Tensor, offset: Tensor, thresholds: Tensor, seeds: Tensor, *, trajectories: int, length: int,
               warmup: int) -> Tensor:
    """x <- M_i x + b_i along every trajectory: (B,N,2,2), (B,N,2), (B,N) int64, (B,) int64 -> points (B,P,2).

    Trajectory by trajectory, in the order of the steps, the first `warmup` points dropped.
    """
    thresholds = thresholds.contiguous()
    state = initial_states(seeds, trajectories)
    code = torch.arange(len(linear), device=linear.device)[:, None]
    start = []
    for _ in range(2):
        state = next_states(state)
        start.append(_shift_right(state, 40).to(linear.dtype) * 2.0**-23 - 1)
    x = torch.stack(start, -1)
    points = []
    for _ in range(length):
        state = next_states(state)
        index = torch.searchsorted(thresholds, _shift_right(state, 32), right=True)
        x = ((linear[code, index] @ x[..., None])[..., 0] + offset[code, index]).clamp(-ESCAPE, ESCAPE)
        points.append(x)
    return torch.stack(points[warmup:], dim=2).flatten(1, 2)


def initial_states(seeds: Tensor, trajectories: int) -> Tensor:
    """The state (B,T) of each trajectory's own stream: splitmix64's hash of its code's seed and its number.

    Steele, Lea and Flood 2014. int64 arithmetic wraps around, so the bits are those of unsigned integers.
    """
    number = torch.arange(1, trajectories + 1, device=seeds.device)
    state = _mix(_mix(seeds + GOLDEN)[:, None] + number * GOLDEN)
    return torch.where(state == 0, GOLDEN, state)  # zero is xorshift's only fixed point


def next_states(state: Tensor) -> Tensor:
    """One step of xorshift64 (Marsaglia 2003); the top bits serve as uniform variates."""
    state = state ^ (state << 13)
    state = state ^ _shift_right(state, 7)
    return state ^ (state << 17)


def _mix(z: Tensor) -> Tensor:
    z = (z ^ _shift_right(z, 30)) * MIX_1
    z = (z ^ _shift_right(z, 27)) * MIX_2
    return z ^ _shift_right(z, 31)


def _shift_right(z: Tensor, bits: int) -> Tensor:
    """The shift of an unsigned integer: torch's own repeats the sign."""
    return (z >> bits) & ((1 << (64 - bits)) - 1)
