"""The maps of Learning Fractals: seven kinds of numbers a map, and the canvas that they draw on.

A map sends a row vector x to x W + b with W = (R(theta1) diag(sigmoid s) R(theta2) diag(sign d))ᵀ. Its first
coordinate runs down the rows of the image, its second one along the columns; the image covers [-5,5]².
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from ...ifs.affine import rotation
from ...ifs.code import IFS

HALF_CANVAS = 5.0
MATRIX = ("theta1", "theta2", "s", "d")  # what W is made of
LARGEST = 0.9999                         # singular value of a returned code: in float32 a sigmoid reaches 1


class StraightThroughSign(torch.autograd.Function):
    """sign(d), +1 for 0; its gradient is handed on as it is (Bengio et al. 2013)."""

    @staticmethod
    def forward(ctx: Any, d: Tensor) -> Tensor:
        return torch.where(d < 0, -1.0, 1.0).to(d)

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> Tensor:
        return grad


def initial(maps: int, random: torch.Generator) -> dict[str, Tensor]:
    """Random numbers of N maps: theta1, theta2 (N,) ~ U(-pi, pi), s (N,2) ~ U(0,1), d (N,2) = 0.005, b (N,2) ~
    U(-1,1)."""
    return {
        "theta1": math.pi * (2 * torch.rand(maps, generator=random) - 1),
        "theta2": math.pi * (2 * torch.rand(maps, generator=random) - 1),
        "s": torch.rand(maps, 2, generator=random),
        "d": torch.full((maps, 2), 0.005),
        "b": 2 * torch.rand(maps, 2, generator=random) - 1,
    }


def matrices(raw: Mapping[str, Tensor]) -> Tensor:
    """Wᵀ (N,2,2) of every map: what multiplies a column vector."""
    turned = rotation(raw["theta1"]) * torch.sigmoid(raw["s"])[:, None, :]
    signs: Tensor = StraightThroughSign.apply(raw["d"])  # pyright: ignore[reportAssignmentType]
    return turned @ (rotation(raw["theta2"]) * signs[:, None, :])


def fixed_point(linear: Tensor, offset: Tensor) -> Tensor:
    """x = M x + b, (2,), of a matrix (2,2) and an offset (2,), differentiable."""
    return torch.linalg.solve(torch.eye(2).to(linear) - linear, offset)


def to_pixels(points: Tensor, side: int) -> Tensor:
    """Points (…,2) of [-5,5]² as (row, column) of an image with `side` pixels a side, held at its border."""
    return ((points + HALF_CANVAS) * ((side - 1) / (2 * HALF_CANVAS))).clamp(0, side - 1)


def probabilities(linear: Tensor) -> Tensor:
    """|det M| over their sum (N,), uniform where all of them vanish."""
    size = torch.linalg.det(linear.detach().double()).abs() + 1e-12
    return (size / size.sum()).to(linear.dtype)


def code(raw: Mapping[str, Tensor], side: int) -> IFS:
    """The code in this package's frame: the canvas [-1,1]², x to the right, y up, as the same pixels show it."""
    with torch.no_grad():
        linear = matrices({**raw, "s": raw["s"].clamp_max(math.log(LARGEST / (1 - LARGEST)))}).cpu().double()
    scale = (side - 1) / (HALF_CANVAS * side)  # a step of one unit, as the image shows it
    turn = torch.tensor([[0.0, 1.0], [-1.0, 0.0]], dtype=torch.float64)
    return IFS(turn @ linear @ turn.mT, scale * (raw["b"].detach().cpu().double() @ turn.mT))
