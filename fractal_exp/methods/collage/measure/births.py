"""New maps where a set of maps leaves the measure unexplained."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ....ifs import affine
from ....ifs.canvas import pixel_to_canvas
from ....ops.collage import BinnedMeasure, Descent, collage_error, descend, pushforward
from ....runtime.params import Interval
from ..bins import halve
from ..params import BirthParams

BLOBS = 1 / 3                  # share of the candidates that take the shape of the uncovered blob; others are random
VOLUME = 1.1                   # expected sum of |det| + 0.01 of a whole set; a new map's share is its first weight
LEAST_WEIGHT = 1e-6            # minimum of the first weight
LARGE = 0.4, 0.97              # range of the larger singular value of large maps at birth
MEDIUM = 0.1, 0.95             # the same of other maps in stage 1, and of the random sets of a restart
SMALL = 0.03, 0.7              # the same of other maps in stage 2
LEAST_RATIO = 0.05             # minimum ratio of the singular values of a random map, also in a restart
ANCHORED = 0.5                 # probability that a random map sends a random point to its place, instead of the mean
BLOB_RADIUS = 0.5              # standard deviation of the Gaussian window of a blob, relative to a random size
BLOB_LEAST_RADIUS = 1.0        # its minimum, cells
BLOB_GRID = 64                 # cells per side of the grid on which blobs are measured
BLOB_LEAST_WIDTH = 0.15        # standard deviation, cells, whose square is added to a blob's covariance
BLOB_STEPS = 3                 # of mean shift (Fukunaga and Hostetler 1975), which finds the centre of a blob
LEAST_WIDTH = 1e-3   # canvas units, whose square is added to the covariance of the image of a map to reorient
TURNED = 0.97        # upper limit of the singular values of a reoriented map
# Descents of candidates on a coarse and a fine grid, and how many are left after each
HEATS = (Descent(40, rate=0.04, prior=0.0), 4), (Descent(15, rate=0.01, prior=0.0), 4)
LEAST_PART = 0.3   # share of a measure that lies in a part of it at least
REGULAR = 1e-8   # canvas units², added to the covariance of a measure: without it, a shape on a line has no inverse


def births(grids: Sequence[BinnedMeasure], backgrounds: Tensor, sizes: list[Interval], count: int, total: float,
           limits: tuple[float, float], params: BirthParams, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """For each background (P,G,G), four maps (P,4,6) born where mass is missing, and their weights (P,4), best first.

    A map is anchored at a cell drawn from the missing mass. Its matrix is random in the range `sizes` (one for each
    background), or gives the image of the measure the mean and covariance of the missing blob around the cell. `count`
    such candidates race. grids: the measure on a fine and a coarse one; total: sum of all maps' weights; limits: of the
    larger and the smaller singular value.
    """
    fine, blobs = grids[0], round(count * BLOBS)
    lacking = (fine.bins - backgrounds).clamp_min(0) * (1 if fine.known is None else fine.known)
    wanted = [_wanted(each, fine) if params.residual else fine.bins for each in lacking]
    born = torch.stack([candidates(wanted[p], lacking[p], fine, sizes[p], count, blobs, params, generator)
                        for p in range(len(backgrounds))])
    weights = torch.minimum(total / VOLUME * affine.volumes(born), lacking.sum((1, 2))[:, None])
    return raced(born, weights.clamp_min(LEAST_WEIGHT), grids, HEATS, backgrounds, limits)


def raced(maps: Tensor, weights: Tensor, grids: Sequence[BinnedMeasure], heats: Sequence[tuple[Descent, int]],
          backgrounds: Tensor, limits: tuple[float, float]) -> tuple[Tensor, Tensor]:
    """The winners of a race of candidates, best first. Each of the maps (P,count,6) of weights (P,count) descends alone
    beside its background (P,G,G), on the last of the grids first. heats, limits: see `HEATS` and `births`."""
    sets = torch.arange(len(maps), device=maps.device)
    for measure, (how, left) in zip(reversed(grids), heats, strict=True):
        count = maps.shape[1]
        moved, masses, errors = descend(
            maps.reshape(-1, 1, 6), weights.reshape(-1, 1), measure, replace(how, largest=limits[0], smaller=limits[1]),
            backgrounds=halve(backgrounds, measure.size), chosen=sets.repeat_interleave(count))
        best = errors.view(-1, count).argsort(1)[:, :left]
        maps = moved.view(-1, count, 6)[sets[:, None], best]
        weights = masses.view(-1, count)[sets[:, None], best]
    return maps, weights


def _wanted(lacking: Tensor, measure: BinnedMeasure) -> Tensor:
    """Where maps are wanted, (G,G): by missing mass, and as much by what it costs in the collage error. Thin tips weigh
    little but are seen well."""
    floor = measure.floor
    cost = ((measure.bins + floor).sqrt() - (measure.bins - lacking + floor).clamp_min(0).sqrt()).square()
    return lacking / lacking.sum().clamp_min(1e-12) + cost / cost.sum().clamp_min(1e-12) + 1e-12


def candidates(wanted: Tensor, lacking: Tensor, measure: BinnedMeasure, sizes: Interval, count: int, blobs: int,
               params: BirthParams, generator: torch.Generator) -> Tensor:
    """Maps (count,6) at places drawn from `wanted` (G,G). The larger singular values are in the range `sizes`. The
    first `blobs` maps take the shape of the blob of `lacking` (H,H) there; the others are random."""
    size, device = wanted.shape[0], wanted.device
    cell = torch.multinomial(wanted.flatten().cpu(), count, replacement=True, generator=generator)
    jitter = torch.rand(2, count, generator=generator)
    place = pixel_to_canvas(torch.stack([cell // size + jitter[1], cell % size + jitter[0]], 1), size)
    matrices = affine.random_matrices(count, *sizes, LEAST_RATIO, generator, reflections=params.reflections)
    anchor = measure.mean.cpu().expand(count, 2).clone()
    elsewhere = torch.multinomial(measure.samples[:, 2].cpu(), count, replacement=True, generator=generator)
    swap = torch.rand(count, generator=generator) < ANCHORED
    anchor[swap] = measure.samples[elsewhere[swap], :2].cpu()
    random = affine.sending(matrices, anchor, place)
    random[:blobs] = _blobs(lacking.cpu(), place[:blobs], measure, sizes, params, generator)
    return random.to(device)


def reoriented(old: Tensor, measure: BinnedMeasure, count: int, generator: torch.Generator, *,
               reflections: bool = True) -> Tensor:
    """Random maps (count,6). They give the measure the same mean and covariance as the map `old`
    (6,), rotated and, if wanted, mirrored at random. A search at low resolution cannot tell these maps apart."""
    linear, covariance = old[:4].view(2, 2).cpu().double(), measure.covariance.cpu().double()
    image = linear @ covariance @ linear.T + LEAST_WIDTH**2 * torch.eye(2)
    center = measure.mean.cpu().double()
    mean = linear @ center + old[4:].cpu().double()
    source = torch.linalg.cholesky(covariance + REGULAR * torch.eye(2))
    turn = affine.rotations(count, generator, reflections=reflections).double()
    matrices = torch.linalg.cholesky(image) @ turn @ torch.linalg.inv(source)
    matrices = matrices * (TURNED / torch.linalg.matrix_norm(matrices, 2)[:, None, None]).clamp_max(1)
    return affine.sending(matrices, center, mean.expand(count, 2)).to(old)


def extents(one: Tensor, measure: BinnedMeasure) -> tuple[float, float]:
    """Width and length of a map's (6,) image of the measure, both as standard deviations, canvas units."""
    linear = one[:4].view(2, 2).double()
    spread = torch.linalg.eigvalsh(linear @ measure.covariance.double() @ linear.T)
    return tuple(spread.clamp_min(0).sqrt().tolist())


def thinness(one: Tensor, measure: BinnedMeasure) -> float:
    """Width over length of a map's (6,) image of the measure."""
    width, length = extents(one, measure)
    return width / max(length, 1e-6)


def narrowed(maps: Tensor, measure: BinnedMeasure, ratio: float) -> Tensor:
    """Maps (n,6) whose images of the measure are `ratio` times as wide, but as long and in the same place. On a grid,
    all images narrower than a cell look alike, and the thinnest are hardest to see."""
    return _reshaped(maps, measure, torch.tensor([1.0, ratio]))


def mirrored(old: Tensor, measure: BinnedMeasure) -> Tensor:
    """The map `old` (6,), followed by a reflection in either axis of its image or in both: (3,6)."""
    return torch.cat([_reshaped(old[None], measure, torch.tensor(signs)) for signs in ((1.0, -1), (-1, 1), (-1, -1))])


def _reshaped(maps: Tensor, measure: BinnedMeasure, factors: Tensor) -> Tensor:
    """Maps (n,6), followed by a scaling of their images of the measure along the longer and the shorter axis."""
    linear, center = maps[:, :4].unflatten(1, (2, 2)).double(), measure.mean.double()
    source = torch.linalg.cholesky(measure.covariance.double() + REGULAR * torch.eye(2).to(linear))
    u, s, v = torch.linalg.svd(linear @ source)
    matrices = (u * (s * factors.to(s))[:, None]) @ v @ torch.linalg.inv(source)
    mean = (linear @ center) + maps[:, 4:]
    return affine.sending(matrices, center.expand_as(mean), mean).to(maps)


def visible_weights(maps: Tensor, weights: Tensor, measure: BinnedMeasure, background: Tensor,
                    tried: tuple[float, ...]) -> Tensor:
    """Weights (n,) times those of the shares `tried` that fit best beside the background (1,G,G), for each of the maps
    (n,6) alone. An image thinner than a subpixel shows hardly any of its weight."""
    images = pushforward(maps[:, None].contiguous(), torch.ones_like(maps[:, :1]), measure.samples, measure.size)
    shares = weights.new_tensor(tried)
    errors = torch.stack([collage_error(background + (share * weights)[:, None, None] * images, measure)
                          for share in shares])
    return weights * shares[errors.argmin(0)]


def _blobs(lacking: Tensor, place: Tensor, measure: BinnedMeasure, sizes: Interval, params: BirthParams,
           generator: torch.Generator) -> Tensor:
    """Maps (n,6) that give the measure the mean and covariance of the missing mass around each place (n,2)."""
    grid = halve(lacking, min(BLOB_GRID, lacking.shape[0])).double()
    size, count = grid.shape[0], len(place)
    cell = 2 / size
    points, mass = pixel_to_canvas((grid > 0).nonzero().double() + 0.5, size), grid[grid > 0]
    low, high = (torch.tensor(s * BLOB_RADIUS, dtype=torch.float64).log() for s in sizes)
    radius = (low + (high - low) * torch.rand(count, 1, generator=generator, dtype=torch.float64)).exp()
    radius = radius.clamp_min(BLOB_LEAST_RADIUS * cell)
    mean = place.double()
    for _ in range(BLOB_STEPS):  # mean shift
        window = mass * (-0.5 * torch.cdist(mean, points).square() / radius**2).exp() + 1e-30
        window = window / window.sum(1, keepdim=True)
        mean = window @ points
    off = points - mean[:, None]
    least = torch.eye(2, dtype=torch.float64) * (BLOB_LEAST_WIDTH * cell) ** 2
    covariance = (off * window[..., None]).transpose(1, 2) @ off + least
    center, spread = _parts(measure, count, generator) if measure.known is not None else (
        measure.mean.cpu().double(), measure.covariance.cpu().double())
    source = torch.linalg.cholesky(spread + REGULAR * torch.eye(2, dtype=torch.float64))
    turn = affine.rotations(count, generator, reflections=params.reflections).double()
    matrices = torch.linalg.cholesky(covariance) @ turn @ torch.linalg.inv(source)
    return affine.sending(matrices, center, mean).float()


def _parts(measure: BinnedMeasure, count: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """Mean (n,2) and covariance (n,2,2) of parts of a measure: of what lies on one side of a random line. Where the
    edge of a picture cuts a copy off, what is seen of it is the image of such a part. Every other part is all."""
    points, mass = measure.samples[:, :2].cpu().double(), measure.samples[:, 2].cpu().double()
    angle = 2 * torch.pi * torch.rand(count, 1, generator=generator, dtype=torch.float64)
    share = LEAST_PART + (1 - LEAST_PART) * torch.rand(count, 1, generator=generator, dtype=torch.float64)
    share[::2] = 1.0
    along = angle.cos() * points[:, 0] + angle.sin() * points[:, 1]
    order = along.argsort(1)
    below = mass[order].cumsum(1) <= share * mass.sum()
    weight = torch.zeros_like(along).scatter_(1, order, below.double()) * mass
    weight = weight / weight.sum(1, keepdim=True).clamp_min(1e-12)
    mean = weight @ points
    off = points - mean[:, None]
    return mean, (off * weight[..., None]).transpose(1, 2) @ off
