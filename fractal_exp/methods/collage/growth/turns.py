"""Copies that are turned or mirrored within their cells, where the collage is closer to the picture then.

A descent hardly ever turns a copy: halfway there, the copy is like nothing in its cell.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.nn.functional import pad

from ....ops.collage import pushforward
from ....ops.filters import filtered
from .exposed import Exposed

WIDEST = 128   # pixels of the window in which a copy is tried; wider copies stay as they are


def turned(linear: Tensor, points: Tensor, generator: torch.Generator) -> Tensor:
    """Other matrices (N,4), each after a random turn or reflection of points (K,2) about their mean, in coordinates in
    which their covariance is 1. So the points' images keep their covariances."""
    variances, axes = torch.linalg.eigh(points.T @ points / len(points))
    root, inverse = (axes * variances.clamp_min(1e-12)**power @ axes.T for power in (0.5, -0.5))
    angle = 2 * math.pi * torch.rand(len(linear), generator=generator)
    mirror = 2 * torch.randint(2, (len(linear),), generator=generator) - 1
    turn = torch.stack([angle.cos(), -mirror * angle.sin(), angle.sin(), mirror * angle.cos()], 1)
    return (linear.unflatten(1, (2, 2)) @ root @ turn.unflatten(1, (2, 2)) @ inverse).flatten(1)


def closer(new: Tensor, old: Tensor, masses: Tensor, samples: Tensor, drawing: Tensor, target: Exposed,
           blur: tuple[float, ...]) -> Tensor:
    """Which of the maps `new` (N,6), bool (N,), bring the drawing (R,R) of the maps `old` closer to the picture, each
    alone in the place of the old one. Both send the mean to the same points. masses (N,) of the copies; samples (K,3),
    about their mean, of which the drawing was made; blur: of the drawing."""
    side = target.side
    images = torch.stack([new, old])[..., :4].unflatten(-1, (2, 2)) @ samples[:, :2].T
    width = side * images.abs().amax((0, 2, 3)) + 2 * len(blur)   # pixels that hold both copies
    size = min(WIDEST, side, math.ceil(float(width.max())))
    # The windows' first pixels, on images with margins, for a copy may lie at the edge
    left, top = ((((at + 1) * side + size) / 2).round().clamp(0, side + size) for at in (old[:, 4], -old[:, 5]))
    rows, columns = (first.long()[:, None] + torch.arange(size) for first in (top, left))
    cut = [pad(each, 4 * [size])[rows[:, :, None], columns[:, None]] for each in (drawing, target.grey, target.shows)]
    centre = torch.stack([2 * left - size - side, side + size - 2 * top], 1) / side
    copies = []
    for maps in (new, old):
        local = torch.cat([maps[:, :4], maps[:, 4:] - centre], 1) * (side / size)
        copies.append(filtered(pushforward(local[:, None], masses[:, None], samples, size), blur))
    others, grey, shows = cut[0] - copies[1], *cut[1:]
    shown = [target.curve.grey((others + copy).clamp_min(0)) for copy in copies]
    by_new, by_old = (((each - grey) * shows).square().sum((1, 2)) for each in shown)
    return (width <= size) & (by_new < by_old)
