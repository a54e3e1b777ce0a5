"""The operations of collage search: push a measure through maps, and move maps until they tile the measure.

By the collage theorem (Barnsley 1985), if the maps of a code send a measure mu nearly to itself, sum_i w_i f_i#mu ~ mu,
then its attractor's measure is nearly mu. This needs no chaos game, so a step of a batch of codes takes microseconds.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from types import ModuleType

import torch
from torch import Tensor

from ... import ops
from ...errors import InputError
from ...runtime.checks import check_alike, check_count, check_dense, check_memory, check_number, check_tensor, shown
from .. import backends
from ..chaos import cumulative_thresholds
from . import reference
from .reference import Descent, Target

LARGEST = 32_768  # maximum cells per side: a cell's index is kept in 32 bits
LARGEST_COUNT = 2**31 - 1  # maximum number of trajectories, and of their points

__all__ = ["BinnedMeasure", "Descent", "collage_error", "descend", "orbit_bins", "pushforward"]


@dataclass(frozen=True)
class BinnedMeasure:
    """A measure of mass 1 on the canvas [-1,1]², as an argument of the collage operations.

    samples (K,3): x, y, mass; bins (G,G): the same masses, shared bilinearly on a grid of G cells per side, row 0 at
    the top; grids: how many grids with sides G, G/2, G/4 … are compared; floor: added to a bin's mass under the square
    root of the collage error, so that fainter masses hardly count; known (G,G): how much of a cell's mass is compared,
    from 0 to 1; None: all of it in all cells. The mass is 1 in what is known; samples beyond come on top.
    float32, on one device. Raises `InputError` on other shapes, tensors that differ in dtype or device, a share that is
    not in [0,1], a side that cannot be halved often enough, or a floor below 1e-12.
    """

    samples: Tensor
    bins: Tensor
    grids: int = 3
    floor: float = reference.FLOOR
    known: Tensor | None = None
    mean: Tensor = field(init=False)        # (2,)
    covariance: Tensor = field(init=False)  # (2,2)
    roots: Tensor = field(init=False)       # of all grids, one after another

    def __post_init__(self) -> None:
        check_tensor("samples", self.samples)
        check_tensor("bins", self.bins)
        check_alike("bins", self.bins, "samples", self.samples)
        check_count("grids", self.grids)
        check_number("floor", self.floor, f"a finite number from {reference.LEAST} on", reference.LEAST)
        _check_samples(self.samples)
        size = self.size
        if self.bins.shape != (size, size) or self.grids > size.bit_length() or size % 2 ** (self.grids - 1):
            raise InputError(f"the bins must be square with a side that can be halved {shown(self.grids - 1)} times, "
                             f"got {tuple(self.bins.shape)}")
        _check_size(size)
        points, mass = self.samples[:, :2], self.samples[:, 2:]
        mean = (points * mass).sum(0)
        if self.known is not None:
            check_alike("known", self.known, "bins", self.bins)
            if self.known.shape != self.bins.shape:
                raise InputError(f"known must have the shape of the bins, {tuple(self.bins.shape)}, got "
                                 f"{tuple(self.known.shape)}")
            if not bool(((self.known >= 0) & (self.known <= 1)).all()):
                raise InputError("known must hold shares from 0 to 1, got others")
            mass = mass / mass.sum()
            mean = (points * mass).sum(0)
        off = points - mean
        object.__setattr__(self, "mean", mean)
        object.__setattr__(self, "covariance", (off * mass).T @ off)
        halved = [self.bins if self.known is None else self.bins * self.known]
        for _ in range(self.grids - 1):
            halved.append(torch.nn.functional.avg_pool2d(halved[-1][None, None], 2)[0, 0] * 4)
        roots = torch.cat([(grid + self.floor).sqrt().flatten() for grid in halved])
        object.__setattr__(self, "roots", roots)

    @property
    def size(self) -> int:
        """G, the cells per side."""
        return self.bins.shape[0]


def _check_size(size: int) -> None:
    """Raise `InputError` unless a grid may have `size` cells per side. There must be at least two to share a sample."""
    check_count("size", size, 2, LARGEST)


def pushforward(maps: Tensor, weights: Tensor, samples: Tensor, size: int, *, backend: str = "auto") -> Tensor:
    """The measures sum_i w_i f_i#mu in bilinear bins: (B,N,6), (B,N) and samples (K,3) of x, y, mass -> (B,G,G).

    A map is a row a b c d e f, (x, y) -> (a x + b y + e, c x + d y + f); a map without a positive weight is absent.
    Mass off the canvas counts in its edge cells. Numbers that are not finite spoil only their own code. Differentiable
    by maps, weights and the samples' masses, whose places have the gradient 0; on a GPU, the torch backend computes
    what needs gradients. Raises `InputError` on other shapes, tensors that differ in dtype or device, a size outside 2
    … 32768, or one that takes more memory than there is.
    """
    _check(maps, weights)
    check_tensor("samples", samples)
    check_alike("samples", samples, "maps", maps)
    _check_samples(samples)
    _check_size(size)
    check_memory(f"{len(maps)} grids of {size}² cells", 4 * len(maps) * size**2, maps.device, "lower the size")
    is_followed = torch.is_grad_enabled() and any(each.requires_grad for each in (maps, weights, samples))
    if maps.is_cuda and backend == "auto" and is_followed:
        backend = "torch"
    return _backend(backend, maps).pushforward(maps, weights, samples, int(size))


def orbit_bins(maps: Tensor, probabilities: Tensor, size: int, *, trajectories: int, length: int, warmup: int,
               seed: int, backend: str = "auto") -> Tensor:
    """The measures of codes' orbits in bilinear bins: maps (B,N,6), common probabilities (N,) -> (B,G,G).

    The points are those of `ops.chaos_game`, of equal mass, with the same random numbers for all codes. The CPU backend
    does not store them, and gives each thread its own codes. Raises `InputError` on other shapes, a size outside
    2 … 32768 or one that takes more memory than there is, and on whatever `ops.chaos_game` refuses.
    """
    check_tensor("maps", maps)
    if maps.ndim != 3 or maps.shape[-1] != 6:
        raise InputError(f"maps must have shape (B, N, 6), got {tuple(maps.shape)}")
    for name, value in (("trajectories", trajectories), ("length", length)):
        check_count(name, value, most=LARGEST_COUNT)
    check_count("warmup", warmup, 0, length - 1)
    check_count("seed", seed, -2**63, 2**63 - 1)
    _check_size(size)
    check_memory(f"{len(maps)} grids of {size}² cells", 4 * len(maps) * size**2, maps.device, "lower the size")
    if backends.choose(backend, maps) == "cpu":
        check_memory("the maps that all trajectories take", 2 * trajectories * length, maps.device,
                     "lower trajectories or length")
        thresholds = cumulative_thresholds(probabilities, (), maps.shape[1], maps.device)[0]
        return _backend("cpu", maps).orbit_bins(maps, thresholds, seed, size, trajectories, length, warmup)
    identity, bins = maps.new_tensor([[[1.0, 0, 0, 1, 0, 0]]]), []
    for each in maps:  # one after another, to save memory
        points = ops.chaos_game(each[:, :4].unflatten(-1, (2, 2)), each[:, 4:], trajectories=trajectories,
                                length=length, warmup=warmup, probabilities=probabilities, seed=seed, backend=backend)
        samples = torch.cat([points, torch.full_like(points[:, :1], 1 / len(points))], -1)
        bins.append(pushforward(identity, maps.new_ones(1, 1), samples, size, backend=backend)[0])
    return torch.stack(bins)


def collage_error(bins: Tensor, measure: BinnedMeasure) -> Tensor:
    """The distance (B,) of bins (B,G,G) from the measure: the squared Hellinger distance sum (sqrt(q) - sqrt(m))²,
    averaged over the measure's grids. It is 0 if they agree; the square root makes counting noise equal everywhere.
    Raises `InputError` if shape, dtype or device of the bins differ from the measure's."""
    _check_measure(measure)
    check_dense("bins", bins)
    if bins.ndim != 3 or bins.shape[1:] != measure.bins.shape:
        raise InputError(f"bins must have shape (B, {measure.size}, {measure.size}), got {tuple(bins.shape)}")
    check_alike("bins", bins, "measure.bins", measure.bins)
    bins = bins if measure.known is None else bins * measure.known
    return reference.collage_error(bins, measure.roots, measure.grids, measure.floor)


def descend(maps: Tensor, weights: Tensor, measure: BinnedMeasure, how: Descent, *, backgrounds: Tensor | None = None,
            chosen: Tensor | None = None, backend: str = "auto") -> tuple[Tensor, Tensor, Tensor]:
    """Move maps (B,N,6) and weights (B,N) towards lower collage error. Return the new ones and their errors (B,).

    Every code of the batch descends alone, by Adam with the settings `how`; numbers that are not finite spoil only
    their own code. backgrounds (C,G,G): measures that count as explained from the start; chosen (B,) int64: the index
    of each code's background, None: the first. Raises `InputError` on other shapes, tensors that differ in dtype or
    device, or an index out of range. On a GPU indices are not checked, because that would wait for the device.
    """
    _check(maps, weights)
    _check_measure(measure)
    if not isinstance(how, Descent):
        raise InputError(f"how must be a Descent, got {shown(how)}")
    check_alike("measure.bins", measure.bins, "maps", maps)
    if backgrounds is None:
        backgrounds = torch.zeros(1, measure.size, measure.size, dtype=maps.dtype, device=maps.device)
    if chosen is None:
        chosen = torch.zeros(len(maps), dtype=torch.int64, device=maps.device)
    check_tensor("backgrounds", backgrounds)
    check_dense("chosen", chosen)
    check_alike("backgrounds", backgrounds, "maps", maps)
    if backgrounds.ndim != 3 or backgrounds.shape[1:] != measure.bins.shape or chosen.shape != (len(maps),):
        raise InputError(f"backgrounds must have shape (C, {measure.size}, {measure.size}) and chosen ({len(maps)},), "
                         f"got {tuple(backgrounds.shape)} and {tuple(chosen.shape)}")
    _check_chosen(chosen, len(backgrounds), maps)
    target = Target(measure.samples, measure.roots, measure.mean, measure.covariance, measure.size,
                    int(measure.grids), float(measure.floor),
                    measure.samples.new_empty(0) if measure.known is None else measure.known.flatten())
    return _backend(backend, maps).descend(maps, weights, target, backgrounds.flatten(1), chosen, how)


def _backend(name: str, tensor: Tensor) -> ModuleType:
    return backends.load(__name__, backends.choose(name, tensor))


def _check(maps: Tensor, weights: Tensor) -> None:
    check_dense("maps", maps)
    check_dense("weights", weights)
    if maps.ndim != 3 or maps.shape[-1] != 6 or weights.shape != maps.shape[:2]:
        raise InputError(f"maps must have shape (B, N, 6) and weights (B, N), got {tuple(maps.shape)} and "
                         f"{tuple(weights.shape)}")
    check_alike("weights", weights, "maps", maps)


def _check_samples(samples: Tensor) -> None:
    if samples.ndim != 2 or samples.shape[1] != 3:
        raise InputError(f"samples must have shape (K, 3) with K >= 1, got {tuple(samples.shape)}")


def _check_measure(measure: BinnedMeasure) -> None:
    if not isinstance(measure, BinnedMeasure):
        raise InputError(f"measure must be a BinnedMeasure, got {shown(measure)}")


def _check_chosen(chosen: Tensor, count: int, maps: Tensor) -> None:
    if chosen.dtype != torch.int64 or chosen.device != maps.device:
        raise InputError(f"chosen must be int64 on {maps.device}, got {chosen.dtype} on {chosen.device}; convert it "
                         f"with chosen.long().to(maps.device)")
    if chosen.device.type == "cpu" and len(chosen) and not 0 <= int(chosen.min()) <= int(chosen.max()) < count:
        raise InputError(f"chosen must hold numbers from 0 to {count - 1}, one of the {count} backgrounds for each "
                         f"code, got {int(chosen.min())} to {int(chosen.max())}")
