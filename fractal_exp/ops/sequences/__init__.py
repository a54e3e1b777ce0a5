"""The operations of Learning Fractals (Tu et al., AAAI 2023): sequences of points of one code, and the squared error of
the small Gaussians that each sequence draws. Both are differentiable."""

from __future__ import annotations

from torch import Tensor

from ...errors import InputError
from ...runtime.checks import check_alike, check_count, check_memory, check_tensor
from .. import backends
from ..chaos import _check_code, _seeds, cumulative_thresholds


def sequence(
    linear: Tensor,                        # (N, 2, 2)
    offset: Tensor,                        # (N, 2)
    start: Tensor,                         # (2,)
    *,
    sequences: int = 50,
    length: int = 300,
    probabilities: Tensor | None = None,   # (N,)
    seed: int = 0,
    backend: str = "auto",
) -> Tensor:                               # (sequences, length, 2)
    """Chaos games of one code from a given point: x_k = M_i x_(k-1) + b_i with a random map i at each step. The start
    x_0 is not among the points.

    Gradients reach `linear`, `offset` and `start`. The random numbers of a sequence depend only on the seed and its
    index, on every backend. Points stop at coordinates of ±1e6, as in `chaos_game`.

    Raises `InputError` on wrong shapes, dtypes or devices, counts below 1, probabilities as in `chaos_game`, or a
    backend that cannot take the tensors.
    """
    batch, maps = _check_code(linear, offset)
    check_tensor("start", start)
    if batch or start.shape != (2,):
        raise InputError(f"sequences are those of one code, (N, 2, 2), from one start, (2,), got {tuple(linear.shape)} "
                         f"and {tuple(start.shape)}")
    check_alike("start", start, "linear", linear)
    for name, value in (("sequences", sequences), ("length", length)):
        check_count(name, value)
    check_memory(f"{sequences} sequences of {length} points", 16.0 * sequences * length, linear.device,
                 "lower sequences or length")
    thresholds = cumulative_thresholds(probabilities, (), maps, linear.device)[0]
    run = backends.load(__name__, backends.choose(backend, linear)).sequence
    return run(linear, offset, start, thresholds, int(_seeds(seed, batch, linear.device)), sequences, length)


def blob_error(
    points: Tensor,                        # (B, P, 2): row, column
    image: Tensor,                         # (S, S)
    *,
    backend: str = "auto",
) -> Tensor:                               # (B,)
    """The mean squared error between an image and what each set of points draws, clamp(sum_k exp(-d_k²), 0, 1), with
    the distance d_k of a pixel from point k in pixels (Tu et al. 2023). Pixel (0, 0) has its centre at (0, 0).

    Gradients reach the points, but not the image. Points must be finite. The `cpu` backend leaves out what they draw
    beyond 4.5 pixels (below 2e-9).

    Raises `InputError` on wrong shapes, dtypes or devices, or a backend that cannot take the tensors.
    """
    check_tensor("points", points)
    check_tensor("image", image)
    if points.ndim != 3 or points.shape[-1] != 2:
        raise InputError(f"points must have shape (B, P, 2), got {tuple(points.shape)}")
    if image.ndim != 2 or image.shape[0] != image.shape[1]:
        raise InputError(f"image must have shape (S, S), got {tuple(image.shape)}")
    check_alike("image", image, "points", points)
    run = backends.load(__name__, backends.choose(backend, points)).blob_error
    return run(points, image)
