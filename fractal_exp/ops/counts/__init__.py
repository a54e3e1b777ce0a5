"""How many points lie in each pixel of the canvas."""

from __future__ import annotations

from torch import Tensor

from ...errors import InputError
from ...runtime.checks import check_count, check_memory, check_tensor, shown
from .. import backends

LARGEST = 32_768  # maximum pixels per side


def point_counts(points: Tensor, side: int, *, backend: str = "auto") -> Tensor:
    """The numbers (R,R), int64, of points (P,2) of the canvas in the pixels of an image of `side` pixels a side, row 0
    at the top. Points off the canvas are left out. Raises `InputError` on another shape, or a side outside 1 … 32768
    or one that takes more memory than there is."""
    check_tensor("points", points)
    if points.ndim != 2 or points.shape[1] != 2:
        raise InputError(f"points must have shape (P, 2), got {tuple(points.shape)}")
    check_count("side", side, 1, LARGEST)
    check_memory(f"counts of {shown(side)}² pixels", 8 * side**2, points.device, "lower the side")
    return backends.load(__name__, backends.choose(backend, points)).point_counts(points.detach(), int(side))
