"""Gaussian blur of images and its inverse, on the device of the images."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import conv2d

REACH = 4.0        # standard deviations at which a Gaussian ends, as in SciPy
LEAST_BLUR_PX = 0.2   # a narrower blur hardly reaches the next pixel, and is left out
DEBLUR_STEPS = 10  # that sharpen an image; more remove more of the blur, and bring out more of the noise
EMPTY = 1e-12      # added to pixels of an image of mass 1, to avoid 0 / 0


def blurred(images: Tensor, sigma_px: float) -> Tensor:
    """Images (…,H,W) blurred by a Gaussian of this standard deviation, with zeros beyond their edges, like
    `scipy.ndimage.gaussian_filter(mode="constant")`."""
    if sigma_px < LEAST_BLUR_PX:
        return images
    reach = int(REACH * sigma_px + 0.5)  # rounded
    kernel = (-0.5 * (torch.arange(-reach, reach + 1, device=images.device) / sigma_px).square()).exp().to(images)
    kernel = kernel / kernel.sum()
    flat = images.reshape(-1, 1, *images.shape[-2:])
    flat = conv2d(flat, kernel.view(1, 1, -1, 1), padding=(reach, 0))
    return conv2d(flat, kernel.view(1, 1, 1, -1), padding=(0, reach)).view(images.shape)


def deblurred(image: Tensor, sigma_px: float) -> Tensor:
    """A measure (H,W) of mass 1 whose blur is close to an image (H,W) without negative values, after
    `DEBLUR_STEPS` steps of Richardson (1972) and Lucy (1974)."""
    image = image / image.sum()
    if sigma_px < LEAST_BLUR_PX:
        return image
    found = image + EMPTY
    for _ in range(DEBLUR_STEPS):
        ratio = (image + EMPTY) / (blurred(found, sigma_px) + EMPTY)
        found = found * blurred(ratio, sigma_px)
    return found / found.sum()
