"""Separable filters of images."""

from __future__ import annotations

from collections.abc import Sequence

from torch import Tensor
from torch.nn.functional import pad


def filtered(images: Tensor, window: Sequence[float]) -> Tensor:
    """Images (…,H,W) under a window of odd length along both axes, with zeros beyond their edges. Differentiable.

    They are summed with shifts, because torch convolves a single channel slowly on a CPU.
    """
    radius = len(window) // 2
    for axis, margins in ((-2, (0, 0, radius, radius)), (-1, (radius, radius, 0, 0))):
        wide, size = pad(images, margins), images.shape[axis]
        images = wide.narrow(axis, 0, size) * window[0]
        for shift, weight in enumerate(window[1:], 1):
            images.add_(wide.narrow(axis, shift, size), alpha=weight)
    return images
