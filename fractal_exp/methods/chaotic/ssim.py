"""The structural similarity (Wang et al. 2004) that fits minimise. Scores have kornia's."""

from __future__ import annotations

import math

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor
from torch.autograd.function import once_differentiable

from ...errors import InputError

RADIUS = 5  # an 11×11 window of sigma 1.5
_TAPS = [math.exp(-((k / 1.5) ** 2) / 2) for k in range(-RADIUS, RADIUS + 1)]
WINDOW = [tap / sum(_TAPS) for tap in _TAPS]
C1, C2 = 0.01**2, 0.03**2  # for a data range of 1


def ssim(image: Tensor, target: Tensor, statistics: tuple[Tensor, Tensor]) -> Tensor:
    """The mean SSIM (…,) of images (…,R,C) in [0,1] and a target; in [-1,1], 1 for equal images.

    Gaussian window 11×11 of sigma 1.5, C1 = .01², C2 = .03², population variances, mean over the pixels whose window
    lies inside the image. statistics: `local_statistics` of the target. Raises `InputError` on images below 11 px a
    side.
    """
    target_mean, target_variance = statistics
    mean, variance = local_statistics(image)
    covariance = _GaussianBlur.apply(image * target) - mean * target_mean
    luminance = (2 * mean * target_mean + C1) / (mean.square() + target_mean.square() + C1)
    structure = (2 * covariance + C2) / (variance + target_variance + C2)
    return (luminance * structure).mean((-2, -1))


def local_statistics(image: Tensor) -> tuple[Tensor, Tensor]:
    """Mean and population variance of an image (…,R,C) under the window, (…,R-10,C-10) each."""
    if min(image.shape[-2:]) <= 2 * RADIUS:
        raise InputError(f"SSIM needs pictures of at least {2 * RADIUS + 1} px a side, got "
                         f"{image.shape[-1]}×{image.shape[-2]}; raise the resolution")
    mean = _GaussianBlur.apply(image)
    return mean, _GaussianBlur.apply(image.square()) - mean.square()


class _GaussianBlur(torch.autograd.Function):
    """The window where it fits: (…,H,W) -> (…,H-10,W-10). The adjoint of a symmetric window is the same over the
    zero-padded cotangent."""

    @staticmethod
    def forward(ctx, image: Tensor) -> Tensor:
        return _blurred(image)

    @staticmethod
    @once_differentiable
    def backward(ctx, cotangent: Tensor) -> Tensor:
        return _blurred(F.pad(cotangent, [2 * RADIUS] * 4))


def _blurred(image: Tensor) -> Tensor:
    if image.device.type == "cpu" and image.dtype == torch.float32:
        from .ssim_kernels import blurred  # at its first use, so that nobody else waits for a compiler

        images = image.reshape(-1, *image.shape[-2:]).contiguous()
        found = blurred(images.numpy(), np.array(WINDOW))
        return torch.from_numpy(found).view(*image.shape[:-2], *found.shape[1:])
    return shifted_sums(shifted_sums(image, -1), -2)


def shifted_sums(image: Tensor, dim: int) -> Tensor:
    """The window along one axis, by sums of shifted views: PyTorch's convolutions are made for many channels."""
    size = image.shape[dim] - 2 * RADIUS
    out = image.narrow(dim, RADIUS, size) * WINDOW[RADIUS]
    for k in range(RADIUS):
        mirrored = image.narrow(dim, k, size) + image.narrow(dim, 2 * RADIUS - k, size)
        out.add_(mirrored, alpha=WINDOW[k])
    return out
