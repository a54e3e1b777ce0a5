"""What the grey levels of a target mean. It is decided once, when the picture is read, and carried with the target."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from torch import Tensor

from ..runtime.checks import check_choice
from .known import Known

Levels = Literal["auto", "density", "linear", "dots", "tonemapped", "coverage", "binary"]

MEANINGS = get_args(Levels)
TARGET_SUPERSAMPLE = 16   # subpixels along a pixel
TARGET_ROUNDING = 0.0025  # subpixels; 16 bits round a grey level by up to 0.002, 8 bits by up to 0.5
DRAWN = "drawn"           # by others: a search finds out how


@dataclass(frozen=True, eq=False)
class TargetImage:
    """A target and the meaning of its grey levels.

    image: (R,R) float32 in [0,1], white shape on black. levels: one of `MEANINGS` other than "auto", which
    docs/cameras.md explains, or "drawn" for a picture that others drew, whose meaning a search finds out. known: the
    part of the canvas that the picture shows, None: all of it. The image is 0 beyond.
    """

    image: Tensor
    levels: str = field(kw_only=True)
    known: Known | None = field(kw_only=True, default=None)

    @classmethod
    def of(cls, target: Tensor | TargetImage, levels: str = "auto") -> TargetImage:
        """A target whose levels have this meaning. "auto": that of the target, or else as they look, see `meaning_of`.
        Raises `InputError` if there is no such meaning."""
        image = target.image if isinstance(target, TargetImage) else target
        if levels == "auto" and isinstance(target, TargetImage):
            return target
        return TargetImage(image, levels=decided(levels, image), known=getattr(target, "known", None))


def decided(levels: str, image: Tensor) -> str:
    """The meaning that a user names, or for "auto" that of an image (R,R) as it looks. Raises `InputError` if there is
    no such meaning."""
    if levels != DRAWN:
        check_choice("levels", levels, MEANINGS)
    return meaning_of(image) if levels == "auto" else levels


def meaning_of(image: Tensor) -> str:
    """What the grey levels of an image (R,R) mean by their look: "binary" if there are no greys; "density" if all are
    whole numbers of our renderer's subpixels, and some are odd, unlike in a shrunk picture; else "drawn"."""
    if bool(((image == 0) | (image == 1)).all()):
        return "binary"
    return "density" if has_target_levels(image) else DRAWN


def has_target_levels(image: Tensor) -> bool:
    """Whether the levels of an image (R,R) in [0,1] are those of a grey target: whole numbers of subpixels, up to a
    rounding in subpixels. Some of them must be odd, unlike in a binary target that was shrunk."""
    shares = image * TARGET_SUPERSAMPLE**2
    whole = shares.round()
    return bool(((shares - whole).abs() <= TARGET_ROUNDING).all()) and bool((whole % 2 == 1).any())
