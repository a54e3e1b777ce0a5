"""New maps where a set of maps leaves the measure unexplained."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from ...ops.collage import BinnedMeasure, Descent, collage_error, descend, pushforward
from . import maps as affine
from .measure import halve

LARGE, MEDIUM, SMALL = (0.4, 0.97), (0.1, 0.95), (0.03, 0.7)   # ranges of the larger singular value at birth
COARSE = Descent(steps=40, rate=0.04, prior=0.0, largest=0.98)
FINE = Descent(steps=15, rate=0.01, prior=0.0, largest=0.98)
BLOB_GRID = 64
SHARES = (1, 0.5, 0.25, 0.1, 0.04, 0.015, 0.006)   # of the weight that a map's volume asks for


def births(coarse: BinnedMeasure, fine: BinnedMeasure, backgrounds: Tensor, scale: float, sizes: list[tuple], *,
           count: int, kept: int, smaller: float, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """For each background (P,G,G) on the fine grid, the best `kept` of `count` maps born where it lacks mass: maps
    (P,kept,6) and weights (P,kept), best first.

    A map is anchored at a cell drawn from what is lacking, its matrix at random in the range of `sizes` (P of them),
    or such that the whole measure takes the place and the covariance of the lacking blob around the cell. Each is then
    moved alone, first on the coarse grid, the best on the fine one. scale: the weight of a map of
    determinant 1; smaller: see `Descent`.
    """
    sets, device = len(backgrounds), backgrounds.device
    lacking = (fine.bins - backgrounds).clamp_min(0)
    born = torch.stack([candidates(_wanted(lacking[p], fine), lacking[p], fine, sizes[p], count, count // 3, generator)
                        for p in range(sets)])
    weights = torch.minimum(scale * affine.volumes(born), lacking.sum((1, 2))[:, None]).clamp_min(1e-6)
    owner = torch.arange(sets, device=device).repeat_interleave(count)
    moved, masses, errors = descend(born.flatten(0, 1)[:, None], weights.flatten()[:, None], coarse,
                                    replace(COARSE, smaller=smaller),
                                    backgrounds=halve(backgrounds, coarse.size), chosen=owner)
    best = errors.view(sets, count).argsort(1)[:, :kept]
    take = (best + torch.arange(sets, device=device)[:, None] * count).flatten()
    moved, masses, errors = descend(moved[take], masses[take], fine, replace(FINE, smaller=smaller),
                                    backgrounds=backgrounds, chosen=owner[take])
    order = errors.view(sets, kept).argsort(1)
    rows = torch.arange(sets, device=device)[:, None]
    return moved.view(sets, kept, 6)[rows, order], masses.view(sets, kept)[rows, order]


def _wanted(lacking: Tensor, measure: BinnedMeasure) -> Tensor:
    """Where maps are wanted, (G,G): half by mass and half by what it costs, as thin tips weigh little and are seen
    well."""
    cost = ((measure.bins + 1e-5).sqrt() - (measure.bins - lacking + 1e-5).clamp_min(0).sqrt()).square()
    return lacking / lacking.sum().clamp_min(1e-12) + cost / cost.sum().clamp_min(1e-12) + 1e-12


def candidates(wanted: Tensor, lacking: Tensor, measure: BinnedMeasure, sizes: tuple[float, float], count: int,
               blobs: int, generator: torch.Generator) -> Tensor:
    """Maps (count,6) at places drawn from `wanted` (G,G), their larger singular values in the range `sizes`; the first
    `blobs` take the shape of the blob of `lacking` (H,H) there, the others are random."""
    size, device = wanted.shape[0], wanted.device
    cell = torch.multinomial(wanted.flatten().cpu(), count, replacement=True, generator=generator)
    jitter = torch.rand(2, count, generator=generator)
    place = torch.stack([2 * (cell % size + jitter[0]) / size - 1, 1 - 2 * (cell // size + jitter[1]) / size], 1)
    matrices = affine.random_matrices(count, *sizes, generator)
    anchor = measure.mean.cpu().expand(count, 2).clone()
    elsewhere = torch.multinomial(measure.samples[:, 2].cpu(), count, replacement=True, generator=generator)
    swap = torch.rand(count, generator=generator) < 0.5
    anchor[swap] = measure.samples[elsewhere[swap], :2].cpu()
    random = affine.sending(matrices, anchor, place)
    random[:blobs] = _blobs(lacking.cpu(), place[:blobs], measure, sizes, generator)
    return random.to(device)


def turned(old: Tensor, measure: BinnedMeasure, count: int, generator: torch.Generator) -> Tensor:
    """Maps (count,6) that give the measure the mean and covariance that the map `old` (6,) gives it, turned and
    mirrored at random: what a search at low resolution cannot tell apart."""
    linear, covariance = old[:4].view(2, 2).cpu().double(), measure.covariance.cpu().double()
    image = linear @ covariance @ linear.T + 1e-6 * torch.eye(2)
    center = measure.mean.cpu().double()
    mean = linear @ center + old[4:].cpu().double()
    source = torch.linalg.cholesky(covariance + 1e-8 * torch.eye(2))
    matrices = torch.linalg.cholesky(image) @ affine.rotations(count, generator).double() @ torch.linalg.inv(source)
    largest = torch.linalg.matrix_norm(matrices, 2)[:, None, None]
    matrices = matrices * (LARGE[1] / largest).clamp_max(1)
    return affine.sending(matrices, center, mean.expand(count, 2)).to(old)


def flattened(maps: Tensor, measure: BinnedMeasure, ratio: float) -> Tensor:
    """Maps (n,6) that give the measure an image so many times as wide, as long and in the same place. On a grid all
    images narrower than a cell are alike, and the thinnest are seen least."""
    return _reshaped(maps, measure, torch.tensor([1.0, ratio]))


def mirrored(old: Tensor, measure: BinnedMeasure) -> Tensor:
    """The map `old` (6,) followed by each of the three reflections in the axes of its image, (3,6)."""
    return torch.cat([_reshaped(old[None], measure, torch.tensor(signs)) for signs in ((1.0, -1), (-1, 1), (-1, -1))])


def _reshaped(maps: Tensor, measure: BinnedMeasure, factors: Tensor) -> Tensor:
    """Maps (n,6) followed by a scaling of their images of the measure along the longer and the shorter axis."""
    linear, center = maps[:, :4].unflatten(1, (2, 2)).double(), measure.mean.double()
    source = torch.linalg.cholesky(measure.covariance.double() + 1e-8 * torch.eye(2).to(linear))
    u, s, v = torch.linalg.svd(linear @ source)
    matrices = (u * (s * factors.to(s))[:, None]) @ v @ torch.linalg.inv(source)
    mean = (linear @ center) + maps[:, 4:]
    return affine.sending(matrices, center.expand_as(mean), mean).to(maps)


def visible_weights(maps: Tensor, weights: Tensor, measure: BinnedMeasure, background: Tensor) -> Tensor:
    """The part of the weights (n,) that fits best beside the background (1,G,G), for each of the maps (n,6) alone: of
    an image thinner than a subpixel hardly anything is seen."""
    images = pushforward(maps[:, None].contiguous(), torch.ones_like(maps[:, :1]), measure.samples, measure.size)
    shares = weights.new_tensor(SHARES)
    errors = torch.stack([collage_error(background + (share * weights)[:, None, None] * images, measure)
                          for share in shares])
    return weights * shares[errors.argmin(0)]


def _blobs(lacking: Tensor, place: Tensor, measure: BinnedMeasure, sizes: tuple[float, float],
           generator: torch.Generator) -> Tensor:
    """Maps (n,6) that give the measure the mean and covariance of what is lacking around each place (n,2)."""
    grid = halve(lacking, min(BLOB_GRID, lacking.shape[0])).double()
    size, count = grid.shape[0], len(place)
    axis = (2 * torch.arange(size, dtype=torch.float64) + 1) / size - 1
    points = torch.stack([axis.expand(size, size), -axis[:, None].expand(size, size)], -1).view(-1, 2)
    lit = grid.flatten() > 0
    points, mass = points[lit], grid.flatten()[lit]
    low, high = (torch.tensor(s * 0.5, dtype=torch.float64).log() for s in sizes)
    radius = (low + (high - low) * torch.rand(count, 1, generator=generator, dtype=torch.float64)).exp()
    radius = radius.clamp_min(2 / size)
    mean = place.double()
    for _ in range(3):  # mean shift
        window = mass * (-0.5 * torch.cdist(mean, points).square() / radius**2).exp() + 1e-30
        window = window / window.sum(1, keepdim=True)
        mean = window @ points
    off = points - mean[:, None]
    covariance = (off * window[..., None]).transpose(1, 2) @ off + torch.eye(2, dtype=torch.float64) * (0.3 / size)**2
    source = torch.linalg.cholesky(measure.covariance.cpu().double() + 1e-8 * torch.eye(2, dtype=torch.float64))
    turn = affine.rotations(count, generator).double()
    matrices = torch.linalg.cholesky(covariance) @ turn @ torch.linalg.inv(source)
    return affine.sending(matrices, measure.mean.cpu().double(), mean).float()
