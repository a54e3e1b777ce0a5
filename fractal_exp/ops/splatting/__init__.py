"""The splatting of points: an image of Gaussians, differentiable."""

from __future__ import annotations

import math

from torch import Tensor

from ...errors import InputError
from ...runtime.checks import check_count, check_memory, check_number, check_tensor, shown, warn_of_nan
from ...runtime.threads import available
from .. import backends
from .reference import cutoff_radius

LEAST_SIGMA = 1e-3     # pixels; such a small splat is drawn in one pixel or none, and below 1e-19 it overflows


def splat(
    points: Tensor,                        # (…, P, 2)
    resolution: int,
    *,
    sigma_px: float = 2.5,
    supersample: int = 5,
    backend: str = "auto",
) -> Tensor:                               # (…, R, R)
    """Render points (…,P,2) as isotropic Gaussians, white on black: images (…,R,R) in [0,1] of the canvas [-1,1]², the
    y axis up. resolution: R, pixels a side.

    The grid has `supersample` · R subpixels a side. At distance r from point k, in subpixels, the opacity is alpha_k =
    min(0.99, exp(-r² / 2 sigma_px²)), or 0 where that is below 1/255. A subpixel is 1 - prod_k (1 - alpha_k), and a
    pixel of the image is the mean of its supersample² subpixels (Kerbl et al. 2023 with one colour; section 4.2 of the
    paper). The gradient is that of the unclamped Gaussian, so it does not stop where alpha reaches 0.99. Points beyond
    the canvas count as far as they reach into it. Infinite and NaN points are left out and have a zero gradient;
    on a CPU, a warning tells of NaN.

    The `cpu` backend repeats bit for bit on any number of threads, and so does `cuda` on GPUs of one kind, because it
    has no atomics. The `torch` backend adds with atomics on a GPU, so it may not repeat.

    Raises `InputError` on wrong shapes or dtypes, resolution or supersample below 1, sigma_px that is not a finite
    number from 0.001 on, sizes that take more memory than there is, or a backend that cannot take the tensor.
    """
    check_tensor("points", points)
    if points.ndim < 2 or points.shape[-1] != 2 or points.shape[-2] < 1:
        raise InputError(f"points must have shape (…, P, 2) with P >= 1, got {tuple(points.shape)}")
    for name, value in (("resolution", resolution), ("supersample", supersample)):
        check_count(name, value)
    warn_of_nan(points=points)
    check_number("sigma_px", sigma_px, f"a finite number of supersampled pixels from {LEAST_SIGMA} on", LEAST_SIGMA)
    batch, count = points.shape[:-2], points.shape[-2]
    check_memory(f"splatting at {shown(resolution)}² pixels, supersample {shown(supersample)} and sigma_px "
                 f"{shown(sigma_px)}", math.prod(batch) * _splat_bytes(points, resolution, supersample, sigma_px),
                 points.device, "lower them, or draw fewer images at a time")
    run = backends.load(__name__, backends.choose(backend, points)).splat
    images = run(points.reshape(math.prod(batch), count, 2), int(resolution), sigma_px=float(sigma_px),
                 supersample=int(supersample))
    return images.view(*batch, resolution, resolution)


def _splat_bytes(points: Tensor, resolution: int, supersample: int, sigma_px: float) -> float:
    """About the memory of one image: the image itself; with gradients, the transmittance of every supersampled pixel;
    and on a CPU, a buffer of three by two footprints for each thread."""
    footprint = 2 * cutoff_radius(float(sigma_px)) + 1
    buffers = 24 * available() * footprint * footprint if points.device.type == "cpu" else 0
    side = float(resolution) * float(supersample)
    return 4 * float(resolution) ** 2 + (4 * points.requires_grad + 0.01) * side * side + buffers
