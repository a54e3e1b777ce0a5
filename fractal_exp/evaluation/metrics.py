"""Similarity of two images: F1 and IoU of their masks, PSNR and SSIM, on batches of grey images."""

from __future__ import annotations

from itertools import count

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d

from ..errors import InputError
from ..runtime.checks import check_unit
from ..runtime.extras import need

MSE_FLOOR = 1e-10            # PSNR of equal images: 100 dB
SSIM_WINDOW = 11             # of sigma 1.5
CROP = 8                     # an eighth of the image is cut off on each side
# Pixels a side, from which on the window fits into the inner crop.
SMALLEST = next(side for side in count(SSIM_WINDOW) if side - 2 * (side // CROP) >= SSIM_WINDOW)


def inner_crop(images: Tensor) -> Tensor:
    """The inner 75% per side, pixels [R/8, 7R/8), of images (…,R,R): the frame of a normalised attractor."""
    size = images.shape[-1]
    return images[..., size // CROP:size - size // CROP, size // CROP:size - size // CROP]


def f1(images: Tensor, truth: Tensor) -> Tensor:
    """F1 (Dice) of the masks I > 0 of images (B,H,W): 2|A and B| / (|A| + |B|), 1 if both are empty; (B,) in [0,1]."""
    both, _, total = _overlap(images, truth)
    return torch.where(total > 0, 2 * both / total, 1.0).float()


def iou(images: Tensor, truth: Tensor) -> Tensor:
    """Intersection over union (Jaccard) of the masks I > 0 of images (B,H,W), 1 if both are empty; (B,) in [0,1]."""
    both, either, total = _overlap(images, truth)
    return torch.where(total > 0, both / either, 1.0).float()


def f1_1px(images: Tensor, truth: Tensor) -> Tensor:
    """F1 within a pixel of the masks I > 0 of images (B,H,W): the harmonic mean of each mask's share within the other's
    dilation by 3×3 pixels; 1 if both are empty; (B,) in [0,1]."""
    check_pair(images, truth)
    a, b = (images > 0).float(), (truth > 0).float()
    near = [(one * max_pool2d(other[:, None], 3, 1, 1)[:, 0]).sum((-2, -1)).double() for one, other in ((a, b), (b, a))]
    total = [mask.sum((-2, -1)).double() for mask in (a, b)]
    precision, recall = (part / whole.clamp(min=1) for part, whole in zip(near, total, strict=True))
    alike = 2 * precision * recall / (precision + recall).clamp(min=torch.finfo(torch.float64).tiny)
    return torch.where(total[0] + total[1] > 0, alike, 1.0).float()


def psnr(images: Tensor, truth: Tensor) -> Tensor:
    """Peak signal-to-noise ratio in dB of images (B,H,W) in [0,1], the mean squared error floored at 1e-10; (B,)."""
    check_pair(images, truth)
    error = (images.double() - truth.double()).square().mean((-2, -1))
    return (-10 * torch.log10(error.clamp(min=MSE_FLOOR))).float()


def ssim(images: Tensor, truth: Tensor) -> Tensor:
    """Mean structural similarity of images (B,H,W) in [0,1]; (B,) in [-1,1].

    Gaussian window 11 × 11 of sigma 1.5, data range 1, averaged where the window fits (Wang et al. 2004; as
    `skimage.metrics.structural_similarity` with Gaussian weights). Raises `InputError` on images below 11 px.
    """
    need("kornia")
    from kornia.metrics import ssim as ssim_map

    check_pair(images, truth)
    if min(images.shape[-2:]) < SSIM_WINDOW:
        raise InputError(f"SSIM needs pictures of at least {SSIM_WINDOW} px a side, got "
                         f"{images.shape[-1]}×{images.shape[-2]}; raise the resolution")
    # In float64: the variance of a bright, nearly constant window is a difference of two large numbers.
    maps = ssim_map(images[:, None].double(), truth[:, None].double(), SSIM_WINDOW, max_val=1.0, eps=0.0,
                    padding="valid")
    return maps.mean((-3, -2, -1)).float()


METRICS = {"f1": f1, "iou": iou, "psnr": psnr, "ssim": ssim}


def empty_pairs(images: Tensor, truth: Tensor) -> Tensor:
    """Pairs of images (B,R,R) whose inner crops are both empty; (B,) bool."""
    _, _, total = _overlap(inner_crop(images), inner_crop(truth))
    return total == 0


def compare(images: Tensor, truth: Tensor) -> dict[str, Tensor]:
    """All metrics by name, (B,) each, of the inner crops of images (B,R,R) against truth (B,R,R), both in [0,1].

    They are NaN for `empty_pairs`: two black pictures agree, but say nothing about a method. Raises `InputError` if the
    shapes differ, images are not finite or leave [0,1], or have fewer than `SMALLEST` px a side.
    """
    check_pair(images, truth)
    if images.shape[-1] < SMALLEST:
        raise InputError(f"SSIM needs images of at least {SMALLEST} px a side, got {tuple(images.shape[-2:])}; "
                         "raise the resolution")
    for name, batch in (("image", images), ("truth", truth)):
        check_unit(f"the {name} to compare", batch)
    empty = empty_pairs(images, truth)
    images, truth = inner_crop(images), inner_crop(truth)
    return {name: metric(images, truth).masked_fill(empty, torch.nan) for name, metric in METRICS.items()}


def _overlap(images: Tensor, truth: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Pixels in the intersection and in the union of both masks, and the sum of both masks' pixels; (B,) float64."""
    check_pair(images, truth)
    a, b = images > 0, truth > 0
    both = (a & b).sum((-2, -1)).double()
    total = a.sum((-2, -1)).double() + b.sum((-2, -1)).double()
    return both, total - both, total


def check_pair(image: Tensor, truth: Tensor, axes: str = "B, H, W") -> None:
    """Raise `InputError` unless both, images or batches of images, have one shape of these axes."""
    if image.ndim != axes.count(",") + 1 or image.shape != truth.shape:
        raise InputError(f"both images must have one shape ({axes}), got {tuple(image.shape)} and "
                         f"{tuple(truth.shape)}; bring both to one size")
