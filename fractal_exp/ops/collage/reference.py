"""Torch twins of the collage operations: the specification, for any device."""

from __future__ import annotations

import math
from collections import namedtuple
from dataclasses import dataclass, fields
from typing import NamedTuple

import torch
from torch import Tensor

from ...errors import InputError
from ...ifs.code import PROBABILITY_FLOOR
from ...runtime.checks import check_count, check_number, shown

FLOOR = 1e-5                # default of `BinnedMeasure.floor`
BETA_1, BETA_2 = 0.9, 0.98  # defaults of Adam's `Descent.beta_1` and `Descent.beta_2`
EPSILON = 1e-7              # default of Adam's `Descent.epsilon`
EDGE = 1.001                # cells that stay free at a grid's far edge: one for a sample's neighbour, and rounding
MAX_STEPS = 1_000_000       # of a descent; more would take hours in one call that cannot be interrupted
LEAST_RADIUS = 1e-6         # canvas units; the code divides by the radius
LEAST = 1e-12               # of a floor and of Adam's epsilon; the code divides by both
BELOW_ONE = math.nextafter(1.0, 0.0)


@dataclass(frozen=True)
class Descent:
    """Settings of `descend`: the number of Adam `steps`; the learning `rate` of the maps (canvas units) and the
    `weight_rate` of the log-weights, which both fall by the factor `decay`; the upper limits of the `largest` and the
    `smaller` singular value of each map; the strength of the `prior` that pulls weights towards |det| + 0.01; maps that
    displace the measure by less than `identity_radius` (rms, canvas units) are pushed off with `identity_weight`;
    `tied` weights follow |det| + 0.01 exactly; `beta_1`, `beta_2` and `epsilon` are Adam's (Kingma and Ba 2015). Raises
    `InputError` unless steps is an integer from 0 to 1 000 000, the radius is at least 1e-6, epsilon at least 1e-12,
    both betas are below 1, and the others are finite and at least 0."""

    steps: int
    rate: float = 0.01
    weight_rate: float = 0.05
    decay: float = 0.05
    largest: float = 0.995
    smaller: float = 1.0
    prior: float = 0.01
    identity_radius: float = 0.1
    identity_weight: float = 0.3
    tied: bool = False
    beta_1: float = BETA_1
    beta_2: float = BETA_2
    epsilon: float = EPSILON

    def __post_init__(self) -> None:
        check_count("steps", self.steps, 0, MAX_STEPS)
        check_number("identity_radius", self.identity_radius, f"a finite number from {LEAST_RADIUS} on", LEAST_RADIUS)
        check_number("epsilon", self.epsilon, f"a finite number from {LEAST} on", LEAST)
        for name in ("beta_1", "beta_2"):
            check_number(name, getattr(self, name), "at least 0 and below 1", 0, BELOW_ONE)
        for name in ("rate", "weight_rate", "decay", "largest", "smaller", "prior", "identity_weight"):
            check_number(name, getattr(self, name), "a finite number of at least 0", 0)
        if not isinstance(self.tied, bool):
            raise InputError(f"tied must be True or False, got {shown(self.tied)}")
        object.__setattr__(self, "steps", int(self.steps))  # kernels are compiled for one type of each
        for name in vars(self).keys() - {"steps", "tied"}:
            object.__setattr__(self, name, float(getattr(self, name)))


Settings = namedtuple("Settings", [field.name for field in fields(Descent)])  # a `Descent` as a kernel argument


class Target(NamedTuple):
    """The measure that a descent aims at: samples (K,3) of x, y, mass; the square roots of its bins plus `floor`, all
    `grids` grids in a row, the finest of `size` cells a side; its mean (2,) and covariance (2,2); known (G²,): how
    much of the mass in a finest cell is compared, from 0 to 1, or empty if all is."""

    samples: Tensor
    roots: Tensor
    mean: Tensor
    covariance: Tensor
    size: int
    grids: int
    floor: float
    known: Tensor


def pushforward(maps: Tensor, weights: Tensor, samples: Tensor, size: int) -> Tensor:
    """sum_i w_i f_i#mu in bilinear bins: maps (B,N,6), weights (B,N), samples (K,3) of x, y, mass -> (B,G,G)."""
    maps = torch.where(weights[..., None] > 0, maps, 0)  # whatever the numbers of an absent map are
    corners, shares = _bins(maps, samples.detach(), size)
    mass = (weights.clamp_min(0)[..., None] * samples[:, 2])[..., None] * shares  # (B,N,K,4)
    bins = torch.zeros(len(maps), size * size, dtype=maps.dtype, device=maps.device)
    return bins.scatter_add(1, corners.flatten(1), mass.flatten(1)).view(-1, size, size)


def collage_error(bins: Tensor, roots: Tensor, grids: int, floor: float) -> Tensor:
    """The squared Hellinger distance (B,) of bins (B,G,G) from a measure, averaged over `grids` grids, each with half
    the side of the one before; roots: the square roots of the measure's bins plus `floor`, all grids in a row."""
    halved = [bins]
    for _ in range(grids - 1):
        halved.append(torch.nn.functional.avg_pool2d(halved[-1][:, None], 2)[:, 0] * 4)
    flat = torch.cat([grid.flatten(1) for grid in halved], 1)
    return ((flat + floor).sqrt() - roots).square().sum(1) / grids


def descend(maps: Tensor, weights: Tensor, target: Target, backgrounds: Tensor, chosen: Tensor, how: Descent
            ) -> tuple[Tensor, Tensor, Tensor]:
    """Adam on maps (B,N,6) and the logarithms of weights (B,N) to lower the collage error of background[chosen] +
    pushforward. A weight of zero means that there is no map. Return the new maps and weights, and their errors (B,)."""
    present = weights > 0
    total = weights.sum(1, keepdim=True)
    background = backgrounds[chosen].view(-1, target.size, target.size)
    maps = maps.detach().clone()
    logs = weights.clamp_min(1e-12).log()
    moments = [torch.zeros_like(maps), torch.zeros_like(maps), torch.zeros_like(logs), torch.zeros_like(logs)]

    def shares(m: Tensor) -> Tensor:
        volume = torch.where(present, (m[..., 0] * m[..., 3] - m[..., 1] * m[..., 2]).abs() + PROBABILITY_FLOOR, 0)
        return volume / volume.sum(1, keepdim=True)

    def weigh(m: Tensor, logs: Tensor) -> Tensor:
        return total * shares(m) if how.tied else torch.where(present, logs.exp(), 0)

    def errors(m: Tensor, w: Tensor) -> Tensor:
        bins = background + pushforward(m, w, target.samples, target.size)
        if len(target.known):
            bins = bins * target.known.view(target.size, -1)
        return collage_error(bins, target.roots, target.grids, target.floor)

    for k in range(1, how.steps + 1):
        with torch.enable_grad():
            m, v = maps.requires_grad_(), logs.detach().requires_grad_()
            w = weigh(m, v)
            near = 1 - displacement_squared(m, target.mean, target.covariance) / how.identity_radius**2
            loss = errors(m, w).sum() + (how.identity_weight * w.detach() * near.clamp_min(0).square()).sum()
            by_map, by_log = torch.autograd.grad(loss, (m, v), allow_unused=True, materialize_grads=True)
        w = w.detach()
        if not how.tied:
            pull = torch.where(present, (w.clamp_min(1e-30) / (total * shares(maps).detach())).log(), 0)
            by_log = by_log + how.prior * w * pull
        falling = how.decay ** (k / how.steps)
        maps = (maps - how.rate * falling * _adam(moments[0], moments[1], by_map, k, how)).detach()
        logs = (logs - how.weight_rate * falling * _adam(moments[2], moments[3], by_log, k, how)).detach()
        maps = torch.where(present[..., None], contract(maps, how.largest, how.smaller), maps)
    weights = weigh(maps, logs)
    return maps, weights, errors(maps, weights)


def contract(maps: Tensor, largest: float, smaller: float = 1.0) -> Tensor:
    """The maps (…,6) with singular values clipped at `largest`, and the smaller ones at `smaller`, by the closed form
    of the 2 × 2 decomposition."""
    a, b, c, d = maps[..., :4].unbind(-1)
    e, f, g, h = (a + d) / 2, (a - d) / 2, (c + b) / 2, (c - b) / 2
    q, r = torch.hypot(e, h), torch.hypot(f, g)
    smaller = min(smaller, largest)
    s1, s2 = (q + r).clamp_max(largest), (q - r).clamp(-smaller, smaller)
    qs, rs = (s1 + s2) / 2 / q.clamp_min(1e-12), (s1 - s2) / 2 / r.clamp_min(1e-12)
    clipped = torch.stack([e * qs + f * rs, g * rs - h * qs, g * rs + h * qs, e * qs - f * rs], -1)
    outside = (q + r > largest) | ((q - r).abs() > smaller)
    return torch.cat([torch.where(outside[..., None], clipped, maps[..., :4]), maps[..., 4:]], -1)


def _bins(maps: Tensor, samples: Tensor, size: int) -> tuple[Tensor, Tensor]:
    """The four bins (B,N,K,4) that share each mapped sample, and their shares. A sample off the canvas falls into its
    edge, with the gradient that it would have there."""
    x, y = samples[:, 0], samples[:, 1]
    m = maps[..., None]
    u = (m[..., 0, :] * x + m[..., 1, :] * y + m[..., 4, :] + 1) * (0.5 * size) - 0.5
    v = (1 - (m[..., 2, :] * x + m[..., 3, :] * y + m[..., 5, :])) * (0.5 * size) - 0.5
    u = u + (u.clamp(0, size - EDGE) - u).detach()
    v = v + (v.clamp(0, size - EDGE) - v).detach()
    column, row = u.detach().floor(), v.detach().floor()
    fu, fv = u - column, v - row
    first = (row * size + column).nan_to_num(0).long()
    corners = torch.stack([first, first + 1, first + size, first + size + 1], -1)
    return corners, torch.stack([(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv], -1)


def displacement_squared(maps: Tensor, mean: Tensor, covariance: Tensor) -> Tensor:
    """The mean of |f(x) - x|² over a measure of this mean (2,) and covariance (2,2): (…,6) -> (…)."""
    linear = maps[..., :4].unflatten(-1, (2, 2)) - torch.eye(2, dtype=maps.dtype, device=maps.device)
    shift = linear @ mean + maps[..., 4:]
    return ((linear @ covariance) * linear).sum((-2, -1)) + shift.square().sum(-1)


def _adam(first: Tensor, second: Tensor, gradient: Tensor, step: int, how: Descent) -> Tensor:
    first.mul_(how.beta_1).add_(gradient, alpha=1 - how.beta_1)
    second.mul_(how.beta_2).addcmul_(gradient, gradient, value=1 - how.beta_2)
    return first / (1 - how.beta_1**step) / ((second / (1 - how.beta_2**step)).sqrt() + how.epsilon)
