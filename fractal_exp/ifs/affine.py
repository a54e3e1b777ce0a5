"""Algebra of affine maps (x, y) -> (a x + b y + e, c x + d y + f), stored as rows a b c d e f of tensors (…,6)."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from .code import IFS, PROBABILITY_FLOOR

# Tolerances of rounding.
SINGULAR = 1e-6    # a determinant below this counts as zero: the inverse would be noise
IMAGINARY = 1e-6   # imaginary parts of a matrix up to this count as zero
ALREADY = 1e-5     # weights whose sum is this near to 1 count as normalised


def from_code(code: IFS) -> Tensor:
    """The maps (N,6) of a code."""
    return torch.cat([code.linear.flatten(1), code.offset], 1)


def to_code(maps: Tensor, weights: Tensor | None = None) -> IFS:
    """The code of maps (N,6), with probabilities proportional to `weights`, or to |det| + 0.01 without weights."""
    probabilities = None if weights is None else normalized(weights)
    return IFS(maps[:, :4].unflatten(1, (2, 2)), maps[:, 4:], probabilities)


def normalized(weights: Tensor) -> Tensor:
    """Weights (N,) over their sum. Weights that are already normalised stay bit for bit the same."""
    total = weights.sum()
    return weights if abs(float(total) - 1) < ALREADY else weights / total


def volumes(maps: Tensor) -> Tensor:
    """|det| + 0.01, (…). Tied probabilities are proportional to it."""
    return (maps[..., 0] * maps[..., 3] - maps[..., 1] * maps[..., 2]).abs() + PROBABILITY_FLOOR


def largest_singular(maps: Tensor) -> Tensor:
    """The larger singular value (…) of each matrix."""
    a, b, c, d = maps[..., :4].unbind(-1)
    return torch.hypot((a + d) / 2, (c - b) / 2) + torch.hypot((a - d) / 2, (c + b) / 2)


def smaller_singular(maps: Tensor) -> Tensor:
    """The smaller singular value (…) of each matrix."""
    a, b, c, d = maps[..., :4].unbind(-1)
    return (torch.hypot((a + d) / 2, (c - b) / 2) - torch.hypot((a - d) / 2, (c + b) / 2)).abs()


def shrunk(maps: Tensor, most: float) -> Tensor:
    """Maps (…,6), each matrix whose larger singular value is above `most` shrunk to that as a whole."""
    scale = (most / largest_singular(maps).clamp_min(1e-12)).clamp_max(1)
    return torch.cat([maps[..., :4] * scale[..., None], maps[..., 4:]], -1)


def rotation(angle: Tensor) -> Tensor:
    """Matrices (…,2,2) of angles (…), differentiable."""
    cos, sin = angle.cos(), angle.sin()
    return torch.stack([torch.stack([cos, -sin], -1), torch.stack([sin, cos], -1)], -2)


def rotations(count: int, generator: torch.Generator, *, reflections: bool = True) -> Tensor:
    """Orthogonal matrices (count,2,2), uniform: half of them are reflections, or none unless `reflections`."""
    angle = torch.rand(count, generator=generator) * 2 * math.pi
    flip = (torch.rand(count, generator=generator) < (0.5 if reflections else 0)) * -2.0 + 1
    cos, sin = angle.cos(), angle.sin()
    return torch.stack([cos, -sin * flip, sin, cos * flip], -1).view(-1, 2, 2)


def random_matrices(count: int, smallest: float, largest: float, ratio: float, generator: torch.Generator, *,
                    reflections: bool = True) -> Tensor:
    """Matrices (count,2,2) = U diag(s1, s2) V: s1 log-uniform in [smallest, largest], s2/s1 uniform in [ratio, 1]."""
    s1 = (torch.rand(count, generator=generator) * math.log(largest / smallest)).exp() * smallest
    s2 = s1 * (ratio + (1 - ratio) * torch.rand(count, generator=generator))
    first = rotations(count, generator, reflections=reflections) * torch.stack([s1, s2], -1)[:, None]
    return first @ rotations(count, generator, reflections=reflections)


def images(maps: Tensor, points: Tensor) -> Tensor:
    """Where maps (n,6) send points (P,2): (n,P,2)."""
    return points @ maps[:, :4].unflatten(1, (2, 2)).transpose(1, 2) + maps[:, None, 4:]


def sending(matrices: Tensor, source: Tensor, image: Tensor) -> Tensor:
    """Maps (…,6) of these matrices (…,2,2) that send the point source (…,2) to image (…,2)."""
    offset = image - (matrices @ source[..., None])[..., 0]
    return torch.cat([matrices.flatten(-2), offset], -1)


def root(one: Tensor, order: int) -> Tensor | None:
    """The map (6,) whose `order`-fold composition is this one (6,): the principal root of its matrix M, about its fixed
    point. None if it is not real or not contractive, or if both eigenvalues are 0.

    A function f of a 2 x 2 matrix of eigenvalues a and b is f[a,b] M + (f(a) - f[a,b] a) I, with the divided difference
    f[a,b] (Higham 2008, Functions of Matrices, section 1.2). For roots r and s of a and b it is 1 / sum r^k s^(n-1-k),
    which also holds where a = b.
    """
    matrix, unit = one[:4].view(2, 2).cpu().double(), torch.eye(2, dtype=torch.float64)
    a, _ = values = torch.linalg.eigvals(matrix)
    r, s = values ** (1 / order)
    slope = 1 / sum(r**k * s**(order - 1 - k) for k in range(order))
    found = slope * matrix + (r - slope * a) * unit
    if not bool(found.isfinite().all()) or float(found.imag.abs().max()) > IMAGINARY:
        return None
    fixed, failed = torch.linalg.solve_ex(unit - matrix, one[4:].cpu().double())
    if failed:
        return None
    real = sending(found.real, fixed, fixed).to(one)
    return real if float(largest_singular(real)) < 1 else None


def preceded(one: Tensor, others: Tensor) -> Tensor:
    """Contractive maps g (k,6) such that one∘g is one of `others` (n,6). Empty if `one` (6,) is singular."""
    if float(volumes(one)) - PROBABILITY_FLOOR < SINGULAR:
        return others[:0]
    inverse = torch.linalg.inv(one[:4].view(2, 2).double())
    linear = inverse @ others[:, :4].unflatten(1, (2, 2)).double()
    offset = (others[:, 4:].double() - one[4:].double()) @ inverse.T
    found = torch.cat([linear.flatten(1), offset], 1).to(others)
    return found[largest_singular(found) < 1]


def compositions(first: Tensor, then: Tensor) -> Tensor:
    """All compositions (nm,6) of maps (n,6) after maps (m,6)."""
    a, b = first[:, None, :4].unflatten(-1, (2, 2)), then[None, :, :4].unflatten(-1, (2, 2))
    offset = (a @ then[None, :, 4:, None])[..., 0] + first[:, None, 4:]
    return torch.cat([(a @ b).flatten(-2), offset], -1).flatten(0, 1)


def composed(one: Tensor, inner: Tensor) -> Tensor:
    """The map (6,) one∘inner: first `inner` (6,), then `one` (6,)."""
    matrix = one[:4].view(2, 2)
    return torch.cat([(matrix @ inner[:4].view(2, 2)).flatten(), matrix @ inner[4:] + one[4:]])


def inverse(one: Tensor) -> Tensor | None:
    """The inverse (6,) of a map (6,), or None if it is singular."""
    if float(volumes(one)) - PROBABILITY_FLOOR < SINGULAR:
        return None
    matrix = torch.linalg.inv(one[:4].view(2, 2).double())
    return torch.cat([matrix.flatten(), -matrix @ one[4:].double()]).to(one)
