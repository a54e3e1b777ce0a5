"""The simplest code of a shape that is symmetric under rotations or reflections.

Each map of a code may be preceded by a symmetry of the attractor; the attractor stays the same. Of these codes, people
write down the one whose maps rotate least and mirror only where they must.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import torch
from torch import Tensor
from torch.nn.functional import affine_grid, grid_sample, max_pool2d

from ....ifs import affine
from ..params import RoundingParams
from ..state import WeightedMaps
from .loop import Draft
from .removal import without_doubles

ORDERS = range(2, 9)     # of the rotations that are tried as symmetries: people build fractals from such polygons
AXES_DEGREES = 7.5       # between the axes of the reflections that are tried
TURN_TOLERANCE = 1e-3    # radians within which two maps count as rotating by the same angle
LIT_ABOVE = 0.25         # grey level above which a pixel belongs to the shape whose symmetries are sought
LIKENESS = 0.93          # minimum F1 within a pixel between a shape and its image under a symmetry


def least_turned_code(draft: Draft) -> Iterator[Draft]:
    """The code whose maps rotate least, without doubles: mirrored, two maps of a symmetric shape may be one."""
    objective, shown = draft.objective, draft.shown
    maps = least_turned(shown.maps, symmetries(objective.image.cpu(), objective.params.rounding))
    single = without_doubles(WeightedMaps(maps, shown.weights), objective.params, len(objective.image), objective.seed)
    yield draft.judged(single.maps, single.weights)


def other_least_turned_code(draft: Draft) -> Iterator[Draft]:
    """`least_turned_code`, unless the code is that already."""
    yield from (each for each in least_turned_code(draft) if not torch.equal(each.shown.maps, draft.shown.maps))


def symmetries(image: Tensor, params: RoundingParams) -> list[Tensor]:
    """The symmetries (6,) of the shape in an image (R,R) about its centroid, the identity first: rotations and
    reflections for which the F1 within a pixel between shape and mapped shape is at least `LIKENESS`. Without
    `params.symmetries`, the identity alone."""
    turns = sorted({0.0, *(round(math.tau * k / n, 9) for n in ORDERS for k in range(n))})
    mirrors = torch.arange(0, 180, AXES_DEGREES).deg2rad().mul(2).tolist()
    tried = [_rotation(angle, 1.0) for angle in turns] + [_rotation(angle, -1.0) for angle in mirrors]
    mask = (image > LIT_ABOVE).float()
    side = len(image)
    axis = (torch.arange(side) + 0.5) * 2 / side - 1
    centre = torch.stack([(image.sum(0) * axis).sum(), -(image.sum(1) * axis).sum()]) / image.sum()
    about = [torch.cat([matrix.flatten(), centre - matrix @ centre])
             for matrix in (tried if params.symmetries else tried[:1])]
    return [about[0], *(each for each in about[1:] if _likeness(mask, each) >= LIKENESS)]


def least_turned(maps: Tensor, group: list[Tensor]) -> Tensor:
    """The maps (N,6), each preceded by the symmetry of the group with which it rotates least. A reflection counts as
    more than any rotation."""
    return torch.stack([min((affine.composed(one, symmetry.to(one)) for symmetry in group), key=_turn) for one in maps])


def _rotation(angle: float, sign: float) -> Tensor:
    cos, sin = math.cos(angle), math.sin(angle)
    return torch.tensor([[cos, -sign * sin], [sin, sign * cos]])


def _turn(one: Tensor) -> tuple[bool, int]:
    """Sort key: whether a map (6,) mirrors, and by how much it rotates, in units of the tolerance. To the
    left counts as less than to the right."""
    a, b, c, d = one[:4].tolist()
    mirrored = a * d - b * c < 0
    turn = math.atan2(c + b, a - d) if mirrored else math.atan2(c - b, a + d)  # of the nearest orthogonal matrix
    return mirrored, round(abs(turn) / TURN_TOLERANCE) + (turn < 0)


def _likeness(mask: Tensor, symmetry: Tensor) -> float:
    """F1 within a pixel between a mask (R,R) and its image under a symmetry."""
    a, b, c, d, e, f = symmetry.tolist()
    theta = torch.tensor([[[a, -b, e], [-c, d, -f]]])  # rows run downwards
    image = (grid_sample(mask[None, None], affine_grid(theta, [1, 1, *mask.shape], False), align_corners=False)
             > 0.5).float()[0]
    shares = [float((one * (max_pool2d(other[None], 3, 1, 1)[0] > 0)).sum() / one.sum().clamp_min(1))
              for one, other in ((mask[None], image), (image, mask[None]))]
    return 2 * shares[0] * shares[1] / max(sum(shares), 1e-9)
