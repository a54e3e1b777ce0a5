"""Gaussian blur of images and its inverse, on the device of the images."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import conv2d

from ..params.camera import CameraParams

EMPTY = 1e-12   # added to pixels of an image of mass 1, to avoid 0 / 0


def blurred(images: Tensor, sigma_px: float, camera: CameraParams) -> Tensor:
    """Images (…,H,W) blurred by a Gaussian of this standard deviation, with zeros beyond their edges, like
    `scipy.ndimage.gaussian_filter(mode="constant")`."""
    if sigma_px < camera.least_blur_px:
        return images
    reach = int(camera.blur_reach * sigma_px + 0.5)  # rounded
    kernel = (-0.5 * (torch.arange(-reach, reach + 1, device=images.device) / sigma_px).square()).exp().to(images)
    kernel = kernel / kernel.sum()
    flat = images.reshape(-1, 1, *images.shape[-2:])
    flat = conv2d(flat, kernel.view(1, 1, -1, 1), padding=(reach, 0))
    return conv2d(flat, kernel.view(1, 1, 1, -1), padding=(0, reach)).view(images.shape)


def deblurred(image: Tensor, sigma_px: float, camera: CameraParams) -> Tensor:
    """A measure (H,W) of mass 1 whose blur is close to an image (H,W) without negative values, after
    `camera.deblur_steps` steps of Richardson (1972) and Lucy (1974). More steps remove more of the blur."""
    image = image / image.sum()
    if sigma_px < camera.least_blur_px:
        return image
    found = image + EMPTY
    for _ in range(camera.deblur_steps):
        ratio = (image + EMPTY) / (blurred(found, sigma_px, camera) + EMPTY)
        found = found * blurred(ratio, sigma_px, camera)
    return found / found.sum()
