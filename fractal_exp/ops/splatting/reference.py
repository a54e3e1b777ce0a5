"""The torch twin of the splat: the specification, for any device, float32 or float64, by plain autograd.

It takes what the public function has checked and flattened: one leading axis B of images.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d
from torch.utils.checkpoint import checkpoint

ALPHA_MAX = 0.99
ALPHA_MIN = 1 / 255
CHUNK_PIXELS = 1 << 20             # footprint pixels whose opacities are held at a time; for all, their indices only


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
