"""The terms of the objective and their weighted sum: pure functions, each with a thin module around it.

A term is built from its hyperparameters, takes the target once (`prepare`, which caches what depends on the target
alone) and then maps a `Rendering` to one value per image, (…,) for images (…,R,R).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from operator import add
from typing import Self, cast

import torch
from torch import Tensor, nn

from ...errors import InputError
from ...perceptual import distances as perceptual
from .rendering import Rendering
from .ssim import local_statistics, ssim

SMALLEST_CONTRAST = 1 / 255  # below one grey level, stretching would only blow up noise


class Term(nn.Module):
    """One term of the objective: `prepare(target)`, then `term(rendering) -> (…,)`.

    The target (R,R), or a batch (…,R,R) that broadcasts against the images, must have the device and dtype of the
    images to come.
    """

    target: Tensor | None = None

    def prepare(self, target: Tensor) -> Self:
        """Cache what depends on the target alone, and return self; a new target replaces the old one."""
        self.target = target
        return self

    @property
    def prepared(self) -> Tensor:
        """The target. Raises `InputError` before `prepare`."""
        if self.target is None:
            raise InputError("the term has no target yet: call prepare(target) first")
        return self.target

    def forward(self, rendering: Rendering) -> Tensor:
        raise NotImplementedError


def mse(image: Tensor, target: Tensor) -> Tensor:
    """Mean squared error per pixel (…,) of images (…,R,R)."""
    _check_pair(image, target)
    return (image - target).square().mean((-2, -1))


def mip_mse(image: Tensor, target: Tensor, *, stretch: bool = False, levels: int | None = None,
            summed: bool = False, target_pyramid: Sequence[Tensor] | None = None) -> Tensor:
    """Mean over mip levels of the mean squared error per pixel (…,) of images (…,R,R), or their sum (equation 5 of the
    paper).

    Levels are 2×2 means, from R down to 2, or the first `levels` of them. `stretch`, as in the paper's program: from
    the second level on each image is stretched to [0,1] before the error is taken and before the next level; an image
    with less than one grey level (1/255) of contrast is left as it is. target_pyramid: with `stretch`, the target's
    `mip_pyramid`, if it is known. Raises `InputError` if R cannot be halved so often.
    """
    _check_pair(image, target)
    count = _mip_levels(image.shape, levels)
    if stretch:
        of_target = mip_pyramid(target, count, stretch=True) if target_pyramid is None else target_pyramid
        differences = [a - b for a, b in zip(mip_pyramid(image, count, stretch=True), of_target, strict=True)]
    else:  # taking means is linear: one pyramid of the difference is enough
        differences = mip_pyramid(image - target, count)
    total = reduce(add, (each.square().mean((-2, -1)) for each in differences))
    return total if summed else total / count


def mip_pyramid(image: Tensor, levels: int, *, stretch: bool = False) -> list[Tensor]:
    """The image (…,R,R) and its repeated 2×2 means, `levels` in all; see `mip_mse` for `stretch`."""
    pyramid = [image]
    for _ in range(levels - 1):
        half = pyramid[-1].unflatten(-2, (-1, 2)).mean(-2).unflatten(-1, (-1, 2)).mean(-1)
        pyramid.append(_stretched(half) if stretch else half)
    return pyramid


def moments(image: Tensor) -> Tensor:
    """Mean, variance, skewness and kurtosis of an image's marginals along x, then along y: (…,R,R) -> (…,8).

    The image is taken as a density on the canvas [-1,1]². Two guards keep values and gradients finite: an image with
    less light than one white pixel gets the rest spread evenly over the canvas (black counts as uniform), and the
    standard deviation that skewness and kurtosis divide by counts as at least one pixel.
    """
    mass = image.sum((-2, -1))[..., None]
    missing = (1 - mass).clamp_min(0) / image.shape[-1]
    along_x, along_y = ((image.sum(dim) + missing) / mass.clamp_min(1) for dim in (-2, -1))
    return torch.cat([_marginal_moments(along_x), _marginal_moments(along_y.flip(-1))], -1)


def regularizer(singular: Tensor, offset: Tensor, *, condition_weight: float = 10.0) -> Tensor:
    """sum_i s_i1² + s_i2² + |b_i|² + condition_weight ((s_i1 + 1)/(s_i2 + 1) - 1)² (equation 6 of the paper).

    singular (…,N,2), in any order (s_i1 is the larger), and offset (…,N,2) -> (…,). The first three summands keep the
    parameters out of saturation, the last is a stable stand-in for the condition number and keeps maps from turning
    into streaks.
    """
    per_map = (singular.square().sum(-1) + offset.square().sum(-1)
               + condition_weight * (condition(singular) - 1).square())
    return per_map.sum(-1)


def condition(singular: Tensor) -> Tensor:
    """(s_i1 + 1)/(s_i2 + 1) of singular values (…,N,2) in any order: (…,N), from 1 to 2."""
    return (singular.amax(-1) + 1) / (singular.amin(-1) + 1)


class MipMSE(Term):
    """`mip_mse` against the target. Raises `InputError` on levels < 1, and in `prepare` on a resolution that cannot be
    halved so often."""

    def __init__(self, stretch: bool = False, levels: int | None = None, summed: bool = False):
        super().__init__()
        if levels is not None and levels < 1:
            raise InputError(f"the number of mip levels must be at least 1 (or none for all down to 2×2), got {levels}")
        self.stretch, self.levels, self.summed = stretch, levels, summed

    def prepare(self, target: Tensor) -> Self:
        count = _mip_levels(target.shape, self.levels)
        self.pyramid = mip_pyramid(target, count, stretch=True) if self.stretch else None
        return super().prepare(target)

    def forward(self, rendering: Rendering) -> Tensor:
        return mip_mse(rendering.image, self.prepared, stretch=self.stretch, levels=self.levels, summed=self.summed,
                       target_pyramid=self.pyramid)


class DSSIM(Term):
    """1 - SSIM (see `ssim.ssim`): in [0,2], 0 for the target itself, whose window statistics are computed once. Raises
    `InputError` on images below 11 px a side."""

    def prepare(self, target: Tensor) -> Self:
        self.statistics = local_statistics(target)
        return super().prepare(target)

    def forward(self, rendering: Rendering) -> Tensor:
        _check_pair(rendering.image, self.prepared)
        return 1 - ssim(rendering.image, self.prepared, self.statistics)


class PerceptualTerm(Term):
    """The perceptual distance `kind` to the target, whose features are computed once; see `perceptual.load` for the
    arguments and for what is raised, all of it on construction."""

    def __init__(self, kind: str = "lpips_alex", weights: str | None = None, input_range: str = "correct"):
        super().__init__()
        self.distance = perceptual.load(kind, weights, input_range)

    @property
    def name(self) -> str:
        """The name under which this distance stands in tags and tables."""
        return self.distance.name

    @torch.no_grad()
    def prepare(self, target: Tensor) -> Self:
        self.distance.to(target)
        self.target_features = self.distance.features(target)
        return super().prepare(target)

    def forward(self, rendering: Rendering) -> Tensor:
        _check_pair(rendering.image, self.prepared)
        return self.distance.compare(self.distance.features(rendering.image), self.target_features)


def perceptual_term(kind: str = "lpips_alex", weights: str | None = None,
                    input_range: str = "correct") -> PerceptualTerm | None:
    """`PerceptualTerm` by configuration: kind "none" leaves the term out of a `WeightedSum`."""
    return None if kind == "none" else PerceptualTerm(kind, weights, input_range)


class Regularizer(Term):
    """`regularizer` of the maps; it knows no target."""

    def __init__(self, condition_weight: float = 10.0):
        super().__init__()
        self.condition_weight = condition_weight

    def forward(self, rendering: Rendering) -> Tensor:
        return regularizer(rendering.singular, rendering.offset, condition_weight=self.condition_weight)


class Moments(Term):
    """Sum of the squared differences between the `moments` of image and target: the classical objective that replaces
    all others in the paper's ablation (Vrscay and Roehrig 1989, Rinaldo and Zakhor 1994)."""

    def prepare(self, target: Tensor) -> Self:
        self.target_moments = moments(target)
        return super().prepare(target)

    def forward(self, rendering: Rendering) -> Tensor:
        _check_pair(rendering.image, self.prepared)
        return (moments(rendering.image) - self.target_moments).square().sum(-1)


class WeightedSum(nn.Module):
    """The objective: named terms and their weights (equation 4 of the paper).

    terms: name -> term, None for a term that is left out. weights: name -> weight, at least 0, for every name in
    `terms`; a term of weight 0 is left out as well, neither computed nor reported. Raises `InputError` on a name that
    only one of the two has, on a weight that is negative or not finite, and if no term is left.
    """

    def __init__(self, weights: Mapping[str, float], terms: Mapping[str, Term | None]):
        super().__init__()
        if set(weights) != set(terms):
            odd = sorted(set(weights) ^ set(terms))[0]
            raise InputError(f"every term needs a weight and every weight a term: {odd!r} has only "
                             f"{'a weight' if odd in weights else 'a term'} (terms: {', '.join(terms)})")
        for name, weight in weights.items():
            if not (math.isfinite(weight) and weight >= 0):
                raise InputError(f"the weight of the term {name!r} must be a finite number of at least 0, got {weight}")
        kept = {name: term for name, term in terms.items() if term is not None and weights[name] > 0}
        if not kept:
            raise InputError("the objective has no term left: give at least one of "
                             f"{', '.join(terms) or 'its terms'} a weight above 0")
        self.terms = nn.ModuleDict(kept)
        self.weights = {name: float(weights[name]) for name in kept}

    def prepare(self, target: Tensor) -> Self:
        """Prepare every term for the target (…,R,R), in [0,1], and return self."""
        for term in cast("Iterable[Term]", self.terms.values()):
            term.prepare(target)
        return self

    def forward(self, rendering: Rendering) -> tuple[Tensor, dict[str, Tensor]]:
        """The weighted sum (…,) and every term's own, unweighted value (…,), by name and in the order of `terms`."""
        values = {name: term(rendering) for name, term in self.terms.items()}
        return reduce(add, (self.weights[name] * value for name, value in values.items())), values


def _check_pair(image: Tensor, target: Tensor) -> None:
    if image.ndim < 2 or image.shape[-2:] != target.shape[-2:]:
        raise InputError(f"image and target must both be (…,R,R) of one size, got {tuple(image.shape)} and "
                         f"{tuple(target.shape)}")


def _mip_levels(shape: torch.Size, levels: int | None) -> int:
    """The number of levels, after checking that the side can be halved so often."""
    side = math.gcd(*shape[-2:])
    power = side & -side  # the largest power of two that divides the side
    if levels is None and (power < 2 or shape[-2:] != (power, power)):
        raise InputError(f"mip levels down to 2×2 need a resolution that is a power of two, got {tuple(shape[-2:])}; "
                         f"take another resolution or set levels (at most {power.bit_length()} here)")
    if levels is not None and levels > power.bit_length():
        raise InputError(f"{levels} mip levels need a resolution that can be halved {levels - 1} times, got "
                         f"{tuple(shape[-2:])}; set levels to at most {power.bit_length()}")
    return power.bit_length() - 1 if levels is None else levels


def _stretched(image: Tensor) -> Tensor:
    low, high = image.amin((-2, -1), keepdim=True), image.amax((-2, -1), keepdim=True)
    span = high - low
    flat = span < SMALLEST_CONTRAST
    return (image - torch.where(flat, 0, low)) / torch.where(flat, 1, span)


def _marginal_moments(density: Tensor) -> Tensor:
    """Mean, variance, skewness and kurtosis (…,4) of densities (…,R) over pixels, in canvas units."""
    pixels = density.shape[-1]
    x = (2 * torch.arange(pixels, device=density.device, dtype=density.dtype) + 1) / pixels - 1
    mean = (density * x).sum(-1, keepdim=True)
    centred = x - mean
    second, third, fourth = ((density * centred**k).sum(-1) for k in (2, 3, 4))
    variance = second.clamp_min((2 / pixels) ** 2)
    return torch.stack([mean[..., 0], second, third / variance**1.5, fourth / variance**2], -1)
