"""Two pictures compared, in all of their pixels."""

from __future__ import annotations

import torch
from torch import Tensor

from ..runtime.checks import check_memory
from . import metrics
from .inside import LIT, ssim_inside
from .scoring import Perceptual

BYTES = 230  # of a pixel, for SSIM and what is alive beside it


def compare_pictures(picture: Tensor, truth: Tensor, lit: Tensor | None = None, true_lit: Tensor | None = None,
                     perceptual: Perceptual | None = None, *, above: float = LIT, known: Tensor | None = None
                     ) -> dict[str, float]:
    """f1, f1_1px, iou, psnr (dB), ssim, ssim_inside and the perceptual distance, under its column's name, of a picture
    (H,W) in [0,1] against its truth (H,W): see `metrics` and `inside`.

    Unlike views of codes, pictures are compared to their very edges. lit, true_lit: the masks (H,W) of f1, f1_1px and
    iou; by default what is above 0. above, known: of ssim_inside. A distance that is absent is NaN. Raises `InputError`
    if the shapes differ, or the pictures are too small for SSIM, 11 px, or for the distance, or too large for the
    memory.
    """
    metrics.check_pair(picture, truth, "H, W")
    check_memory(f"comparing pictures of {picture.shape[1]}×{picture.shape[0]} px", BYTES * picture.numel(),
                 picture.device, "compare smaller ones")
    perceptual, pair = perceptual or Perceptual.load(), (picture[None], truth[None])
    masks = [(each > 0 if mask is None else mask)[None].float() for each, mask in ((picture, lit), (truth, true_lit))]
    scores = {metric.__name__: metric(*masks) for metric in (metrics.f1, metrics.f1_1px, metrics.iou)}
    scores |= {"psnr": metrics.psnr(*pair), "ssim": metrics.ssim(*pair),
               "ssim_inside": torch.tensor([ssim_inside(picture, truth, above, known)]),
               perceptual.column: perceptual.measure(*pair)}
    return {name: float(value) for name, value in scores.items()}
