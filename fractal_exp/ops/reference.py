"""Torch twins of the operations: the specification, for any device, float32 or float64, by plain autograd.

They take what the public functions have checked and flattened: one leading axis B of codes, `thresholds` instead of
probabilities, one seed per code. Kernels draw exactly the same random numbers as these.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d
from torch.utils.checkpoint import checkpoint

GOLDEN = -7046029254386353131      # 0x9E3779B97F4A7C15 as a signed integer: 2^64 over the golden ratio
MIX_1 = -4658895280553007687       # 0xBF58476D1CE4E5B9
MIX_2 = -7723592293110705685       # 0x94D049BB133111EB

ESCAPE = 1e6                       # the coordinate at which a point that runs away is held
ALPHA_MAX = 0.99
ALPHA_MIN = 1 / 255
CHUNK_PIXELS = 1 << 20             # footprint pixels whose opacities are held at a time; for all, their indices only


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


def splat(points: Tensor, resolution: int, *, sigma_px: float, supersample: int) -> Tensor:
    """I = 1 - prod_k (1 - alpha_k) on the supersampled grid, averaged down: points (B,P,2) -> images (B,R,R).

    The product is a sum of logarithms, exact to rounding since alpha <= 0.99.
    """
    side = resolution * supersample
    reach = math.floor(cutoff_radius(sigma_px) + 0.5)
    scale = points.new_tensor([side / 2, -side / 2])
    position = (points + points.new_tensor([1.0, -1.0])) * scale - 0.5  # (column, row) in supersampled pixels
    seen = ((position >= -reach - 0.5) & (position <= side + reach - 0.5)).all(-1)  # False for NaN and infinity
    code = seen.nonzero()[:, 0]
    position = position[seen]

    depth = points.new_zeros(len(points) * side * side)  # sum of -log(1 - alpha)
    chunk = max(1, CHUNK_PIXELS // (2 * reach + 1) ** 2)
    for some in zip(code.split(chunk), position.split(chunk), strict=True):
        depth.scatter_add_(0, *checkpoint(_footprints, *some, side, sigma_px, reach, use_reentrant=False))
    image = -torch.expm1(-depth).view(len(points), side, side)
    return avg_pool2d(image, supersample)


def cutoff_radius(sigma_px: float) -> float:
    """The radius in pixels at which a splat's opacity falls under 1/255."""
    return sigma_px * math.sqrt(-2 * math.log(ALPHA_MIN))


def _footprints(code: Tensor, position: Tensor, side: int, sigma_px: float, reach: int) -> tuple[Tensor, Tensor]:
    """Every pixel that points (K,2) of codes (K,) may touch, as an index into (B,S,S), and its -log(1 - alpha)."""
    nearest = position.detach().round().long()
    steps = torch.arange(-reach, reach + 1, device=position.device)
    column, row = nearest[:, :1] + steps, nearest[:, 1:] + steps                           # (K,F)
    dx, dy = column - position[:, :1], row - position[:, 1:]
    gauss = torch.exp(-(dx[:, None, :] ** 2 + dy[:, :, None] ** 2) / (2 * sigma_px**2))    # (K,F,F)
    alpha = gauss - (gauss.detach() - ALPHA_MAX).clamp(min=0)  # the gradient is the unclamped Gaussian's
    on_canvas = ((column >= 0) & (column < side))[:, None, :] & ((row >= 0) & (row < side))[:, :, None]
    alpha = alpha.where(on_canvas & (gauss >= ALPHA_MIN), 0)
    line = code[:, None] * side + row.clamp(0, side - 1)
    pixel = line[:, :, None] * side + column.clamp(0, side - 1)[:, None, :]
    return pixel.flatten(), -torch.log1p(-alpha).flatten()
