"""The differentiable forward model: parameters -> maps -> points -> image (Sections 4.1 and 4.2 of the paper)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from copy import copy
from dataclasses import dataclass

import torch
from torch import Tensor

from ... import ops
from ...errors import InputError
from ...ifs.attractor import FRAME_SIDE
from ...ifs.code import IFS, sampling_probabilities
from ...ops import backends
from .rendering import Rendering

Parameters = Mapping[str, Tensor]  # raw, freely optimisable tensors by name, each (…,N,…)

LARGEST_OFFSET = 0.9  # of a code that a fit begins with: tanh never reaches 1
PROBABILITIES: Mapping[str, Callable[[Tensor], Tensor | None]] = {
    "uniform": lambda linear: None, "area": sampling_probabilities}
SMALLEST_SIDE = 1e-4  # an attractor below this is a point: normalising it would divide by zero


@dataclass(frozen=True)
class Maps:
    """N affine maps: linear (…,N,2,2), offset (…,N,2) and the singular values (…,N,2) of the matrices."""

    linear: Tensor
    offset: Tensor
    singular: Tensor


class Parameterization(ABC):
    """How raw parameters become affine maps. Stateless; a leading batch of codes is allowed throughout."""

    waits = False  # whether decoding waits for a GPU
    takes_codes = True  # whether `encode` can take up any code

    @abstractmethod
    def initial(self, maps: int, generator: torch.Generator) -> dict[str, Tensor]:
        """Random raw parameters of N = `maps` maps, float32 on the CPU."""

    @abstractmethod
    def encode(self, linear: Tensor, offset: Tensor) -> dict[str, Tensor]:
        """Raw parameters of maps (N,2,2), (N,2) with offsets inside (-1, 1)."""

    @abstractmethod
    def decode(self, raw: Parameters) -> Maps:
        """The maps, differentiable in every raw tensor."""

    def project(self, raw: Parameters) -> dict[str, Tensor]:
        """The raw parameters put back onto their manifold, after a step or a perturbation."""
        return dict(raw)


class SVD(Parameterization):
    """M = U diag(sigmoid(singular)) V^T, b = tanh(offset): contractive by construction (Section 4.1).

    U and V are kept as four free entries each and projected back to orthonormal matrices by Gram-Schmidt, which
    keeps the sign of their determinants, so both orientations of M are within reach. Initial values: singular from
    U[0,1], offset from U[-1,1], U and V of uniform angle, a rotation or a reflection with equal chance.
    """

    def initial(self, maps: int, generator: torch.Generator) -> dict[str, Tensor]:
        return {
            "singular": torch.rand(maps, 2, generator=generator),
            "u": _random_orthonormal(maps, generator),
            "v": _random_orthonormal(maps, generator),
            "offset": 2 * torch.rand(maps, 2, generator=generator) - 1,
        }

    def encode(self, linear: Tensor, offset: Tensor) -> dict[str, Tensor]:
        u, singular, vt = torch.linalg.svd(linear)
        return {"singular": singular.clamp(1e-4, 1 - 1e-4).logit(), "u": u, "v": vt.mT.contiguous(),
                "offset": offset.atanh()}

    def decode(self, raw: Parameters) -> Maps:
        singular = torch.sigmoid(raw["singular"])
        linear = (raw["u"] * singular[..., None, :]) @ raw["v"].mT
        return Maps(linear, torch.tanh(raw["offset"]), singular)

    def project(self, raw: Parameters) -> dict[str, Tensor]:
        return {**raw, "u": gram_schmidt(raw["u"]), "v": gram_schmidt(raw["v"])}


class Naive(Parameterization):
    """The matrix entries themselves, b = tanh(offset); contractivity is left to the regulariser (Section 5.3).

    Initial matrices are those of `SVD`, so that the two start from the same distribution.
    """

    waits = True  # as every singular value decomposition does

    def initial(self, maps: int, generator: torch.Generator) -> dict[str, Tensor]:
        raw = SVD().initial(maps, generator)
        return {"linear": SVD().decode(raw).linear, "offset": raw["offset"]}

    def encode(self, linear: Tensor, offset: Tensor) -> dict[str, Tensor]:
        return {"linear": linear.clone(), "offset": offset.atanh()}

    def decode(self, raw: Parameters) -> Maps:
        return Maps(raw["linear"], torch.tanh(raw["offset"]), torch.linalg.svdvals(raw["linear"]))


def gram_schmidt(matrix: Tensor) -> Tensor:
    """Orthonormal columns from the columns of (…,2,2), the first kept in direction; the determinant keeps its sign."""
    first, second = matrix.unbind(-1)
    first = first / first.norm(dim=-1, keepdim=True).clamp_min(1e-12)
    normal = torch.stack([-first[..., 1], first[..., 0]], -1)
    side = (normal * second).sum(-1, keepdim=True)
    return torch.stack([first, torch.where(side < 0, -normal, normal)], -1)


def _random_orthonormal(count: int, generator: torch.Generator) -> Tensor:
    angle = 2 * torch.pi * torch.rand(count, generator=generator)
    flip = 1 - 2 * torch.randint(0, 2, (count,), generator=generator)
    cos, sin = angle.cos(), angle.sin()
    return torch.stack([torch.stack([cos, -sin * flip], -1), torch.stack([sin, cos * flip], -1)], -2)


def frame(points: Tensor) -> tuple[Tensor, Tensor]:
    """Scale (…,1) and shift (…,2) that centre points (…,P,2) with their longer side spanning 1.5 (Section 4.1).

    They may come in rows of K, x and y in turns, (…,P/K,2K): PyTorch goes through long rows many times as fast. The
    gradient flows through the extreme points. An attractor that has shrunk to a point is centred, not blown up.
    """
    low, high = points.amin(-2).unflatten(-1, (-1, 2)).amin(-2), points.amax(-2).unflatten(-1, (-1, 2)).amax(-2)
    side = (high - low).amax(-1, keepdim=True)
    scale = FRAME_SIDE / side.clamp_min(SMALLEST_SIDE)
    return scale, -scale * (low + high) / 2


class ForwardModel:
    """Point generator and splatter: raw parameters to an image of their attractor, normalised to the frame.

    maps: N; trajectories × length points are drawn, the first `warmup` of each trajectory dropped (b, l and m of the
    paper: 2000, 250, 10), from starts uniform on [-start_range, start_range]². probabilities: of the maps, "uniform"
    (1/N, the paper's) or "area" (|det| + .01, as targets are drawn; without a gradient). The image has `resolution`²
    pixels, splatted at `supersample` times that with Gaussians of `sigma_px` supersampled pixels (Section 4.2; without
    multisampling: 1 and 1).
    backend: auto, cpu, cuda or torch, see `fractal_exp.ops`. Raises `InputError` on any value out of range.
    """

    def __init__(self, parameterization: Parameterization, *, resolution: int = 256, maps: int = 10,
                 trajectories: int = 2000, length: int = 250, warmup: int = 10, supersample: int = 5,
                 sigma_px: float = 2.5, start_range: float = 1.0, probabilities: str = "uniform",
                 backend: str = "auto"):
        if maps < 1:
            raise InputError(f"the number of maps N must be at least 1, got {maps}")
        if not 0 <= warmup < length:
            raise InputError(f"warmup must be in [0, length), got warmup={warmup} and length={length}")
        if trajectories < 1 or resolution < 16 or supersample < 1 or not sigma_px > 0:
            raise InputError("expected trajectories >= 1, resolution >= 16, supersample >= 1 and sigma_px > 0, got "
                             f"{trajectories}, {resolution}, {supersample} and {sigma_px}")
        if not start_range > 0 or probabilities not in PROBABILITIES:
            raise InputError(f"expected start_range > 0 and probabilities {' or '.join(PROBABILITIES)}, got "
                             f"{start_range} and {probabilities!r}")
        backends.check_name(backend)
        self.parameterization = parameterization
        self.resolution, self.maps, self.backend = resolution, maps, backend
        self.trajectories, self.length, self.warmup = trajectories, length, warmup
        self.supersample, self.sigma_px = supersample, sigma_px
        self.start_range, self.probabilities = start_range, probabilities

    def __call__(self, raw: Parameters, seed: int | Tensor) -> Rendering:
        """Image (…,R,R) of the attractor with fresh start points and map indices drawn from `seed`, an int or an int64
        tensor (…)."""
        maps = self.parameterization.decode(raw)
        points = self.framed(self.play(maps, seed))
        return Rendering(image=self.splat(points), points=points, singular=maps.singular, offset=maps.offset)

    def waits(self, like: Tensor) -> bool:
        """Whether drawing from tensors `like` this one on a GPU waits for it, so that no CUDA graph can record it."""
        return (self.parameterization.waits or self.probabilities != "uniform"
                or backends.choose(self.backend, like) == "torch")

    def with_splats(self, factor: float) -> ForwardModel:
        """This model with splats so many times as wide."""
        other = copy(self)
        other.sigma_px = self.sigma_px * factor
        return other

    @torch.no_grad()
    def match(self, target: Tensor, seed: int, draws: int = 4) -> Tensor:
        """The target image (R,R) as this model would draw it: as many points, scattered over its light, splatted alike.

        The splats dilate what they draw. Held against an image that was not dilated, maps shrink to make up for it, and
        on thin shapes to nothing; held against this one, the right maps are the best. Mean of `draws` scatterings.
        """
        count = self.trajectories * (self.length - self.warmup)
        random = torch.Generator().manual_seed(seed)
        pixel = torch.multinomial(target.flatten().cpu(), draws * count, replacement=True, generator=random)
        column_row = torch.stack([pixel % self.resolution, pixel // self.resolution], -1)
        inside = column_row + torch.rand(len(pixel), 2, generator=random)
        points = (2 * inside / self.resolution - 1) * torch.tensor([1.0, -1.0])
        return self.splat(points.view(draws, count, 2).to(target.device)).mean(0)

    @torch.no_grad()
    def is_contractive(self, raw: Parameters) -> Tensor:
        """Whether all singular values are below 1, so that there is an attractor: bool (…,)."""
        return (self.parameterization.decode(raw).singular < 1).all(-1).all(-1)

    def encode(self, code: IFS) -> dict[str, Tensor]:
        """Raw parameters whose maps are those of the code, scaled where an offset is too large for the model; its
        images are normalised to the frame, so that the scale has no say."""
        scale = min(1.0, LARGEST_OFFSET / max(float(code.offset.abs().max()), 1e-6))
        code = code.similar(scale, (0.0, 0.0))
        return self.parameterization.encode(code.linear, code.offset)

    @torch.no_grad()
    def code(self, raw: Parameters, seed: int = 0) -> IFS:
        """The code of one set of raw parameters, in the frame of the images that the model draws."""
        maps = self.parameterization.decode(raw)
        scale, shift = frame(self.play(maps, seed))
        return IFS(maps.linear.cpu(), maps.offset.cpu()).similar(float(scale) / self.start_range, tuple(shift.tolist()))

    def play(self, maps: Maps, seed: int | Tensor) -> Tensor:
        """Points (…,P,2) of the attractor, in units of `start_range`, as the game starts in [-1,1]²; the frame of an
        image knows no unit."""
        return ops.chaos_game(maps.linear, maps.offset / self.start_range, trajectories=self.trajectories,
                              length=self.length, warmup=self.warmup, seed=seed, backend=self.backend,
                              probabilities=PROBABILITIES[self.probabilities](maps.linear.detach()))

    def framed(self, points: Tensor) -> Tensor:
        """Points (…,P,2) brought into the frame, by rows of one trajectory each."""
        rows = points.unflatten(-2, (self.trajectories, -1)).flatten(-2)
        scale, shift = frame(rows)
        shifts = shift.repeat(*[1] * (shift.ndim - 1), rows.shape[-1] // 2)
        return (rows * scale[..., None, :] + shifts[..., None, :]).view_as(points)

    def splat(self, points: Tensor) -> Tensor:
        """The image (…,R,R) of points (…,P,2) of the canvas."""
        return ops.splat(points, self.resolution, sigma_px=self.sigma_px, supersample=self.supersample,
                         backend=self.backend)
