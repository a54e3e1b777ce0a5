"""The simplest code of a shape that is symmetric under rotations or reflections.

Each map of a code may be preceded by a symmetry of the attractor; the attractor stays the same. Of these codes, people
write down the one whose maps rotate least and mirror only where they must.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn.functional import affine_grid, grid_sample, max_pool2d

from .. import maps as affine
from ..params.rounding import RoundingParams


def symmetries(image: Tensor, params: RoundingParams) -> list[Tensor]:
    """The symmetries (6,) of the shape in an image (R,R) about its centroid, the identity first. A map counts as a
    symmetry if the F1 within a pixel between shape and mapped shape is at least `params.symmetric_likeness`. Without
    `params.symmetries`, the identity alone."""
    mask = (image > params.symmetric_level).float()
    side = len(image)
    axis = (torch.arange(side) + 0.5) * 2 / side - 1
    centre = torch.stack([(image.sum(0) * axis).sum(), -(image.sum(1) * axis).sum()]) / image.sum()
    about = [_about(matrix, centre) for matrix in _tried(params)]
    return [about[0], *(each for each in about[1:] if _likeness(mask, each) >= params.symmetric_likeness)]


def simplest(maps: Tensor, group: list[Tensor], params: RoundingParams) -> Tensor:
    """The maps (N,6), each preceded by the symmetry of the group with which it rotates least. A reflection counts as
    more than any rotation."""
    found = []
    for one in maps:
        options = [affine.composed(one, symmetry.to(one)) for symmetry in group]
        found.append(min(options, key=lambda each: _turn(each, params.turn_tolerance)))
    return torch.stack(found)


def _tried(params: RoundingParams) -> list[Tensor]:
    """Rotations and reflections (2,2), the identity first."""
    if not params.symmetries:
        return [_rotation(0.0, 1.0)]
    turns = sorted({0.0, *(round(math.tau * k / n, 9) for n in params.symmetry_orders for k in range(n))})
    mirrors = torch.arange(0, 180, params.symmetry_axes_degrees).deg2rad().mul(2).tolist()
    return [*(_rotation(angle, 1.0) for angle in turns), *(_rotation(angle, -1.0) for angle in mirrors)]


def _rotation(angle: float, sign: float) -> Tensor:
    cos, sin = math.cos(angle), math.sin(angle)
    return torch.tensor([[cos, -sign * sin], [sin, sign * cos]])


def _about(matrix: Tensor, centre: Tensor) -> Tensor:
    return torch.cat([matrix.flatten(), centre - matrix @ centre])


def _turn(one: Tensor, tolerance: float) -> tuple[bool, int]:
    """Sort key: whether a map (6,) mirrors, and by how much it rotates, in units of the tolerance (radians). To the
    left counts as less than to the right."""
    a, b, c, d = one[:4].tolist()
    mirrored = a * d - b * c < 0
    turn = math.atan2(c + b, a - d) if mirrored else math.atan2(c - b, a + d)  # of the nearest orthogonal matrix
    return mirrored, round(abs(turn) / tolerance) + (turn < 0)


def _likeness(mask: Tensor, symmetry: Tensor) -> float:
    """F1 within a pixel between a mask (R,R) and its image under a symmetry."""
    a, b, c, d, e, f = symmetry.tolist()
    theta = torch.tensor([[[a, -b, e], [-c, d, -f]]])  # rows run downwards
    image = (grid_sample(mask[None, None], affine_grid(theta, [1, 1, *mask.shape], False), align_corners=False)
             > 0.5).float()[0]
    shares = [float((one * (max_pool2d(other[None], 3, 1, 1)[0] > 0)).sum() / one.sum().clamp_min(1))
              for one, other in ((mask[None], image), (image, mask[None]))]
    return 2 * shares[0] * shares[1] / max(sum(shares), 1e-9)
