"""The grey levels of the suite's targets, by which they are known from other pictures."""

from __future__ import annotations

from torch import Tensor

TARGET_SUPERSAMPLE = 16   # subpixels along a pixel
TARGET_ROUNDING = 0.0025  # subpixels; 16 bits round a grey level by up to 0.002, 8 bits by up to 0.5


def has_target_levels(image: Tensor, supersample: int = TARGET_SUPERSAMPLE, rounding: float = TARGET_ROUNDING) -> bool:
    """Whether the levels of an image (R,R) in [0,1] are those of a grey target: whole numbers of subpixels, up to a
    rounding in subpixels. Some of them must be odd, unlike in a binary target that was shrunk."""
    shares = image * supersample**2
    whole = shares.round()
    return bool(((shares - whole).abs() <= rounding).all()) and bool((whole % 2 == 1).any())
