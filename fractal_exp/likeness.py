"""The likeness of what a code draws to the picture that it was found on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import distance_transform_edt
from torch import Tensor

from .cameras.camera import Camera
from .cameras.comparison import WITHIN_NOISE, Comparison
from .cameras.estimate import estimated
from .cameras.kinds import levels_of, with_camera
from .cameras.levels import Levels, mean_of
from .cameras.params import CameraParams
from .evaluation import metrics
from .evaluation.inside import f1_dark, ssim_inside
from .ifs.code import IFS
from .images.known import Known
from .images.levels import TargetImage
from .runtime.seeds import derive

# What is good enough, for the search as for the verdict.
FEW_MAPS = 12        # with which a code that draws the shape, or its dots, is no accident
ALIKE = 0.985        # F1 within a pixel at which a code of few maps is no accident
UNLIKE = 0.95        # F1 within a pixel from which the shape is right, though grey levels may be wrong
ALIKE_DARK = 0.85    # F1 within a pixel of the dark inside an outline below which a shape lost what makes it
OUTLINE = 0.5        # likeness inside below which no more than the outline is alike
BESIDE_PX = 1.5      # an attractor's pixel that is nearer counts as beside one of the shape: all eight neighbours are
LEAST_CHANCE = 0.5   # lower limit of the divisor of `ssim_share`: drawings of mere noise are not alike, and allow all
SMALL_TILE_PX = 8.0  # an attractor may lie off the shape by half a tile, but by no more than half of this
TILED_MAPS = 2       # except for a code of at most so many maps, which do not draw a picture by chance


@dataclass(frozen=True)
class Likeness:
    """The likeness of a code's rendering to the input, both (R,R). The code is rendered as the input was drawn: its
    grey levels are a density of points, a coverage of pixels, or black and white. Where the input shows a part of the
    canvas (`TargetImage.known`), only that part is compared.

    f1, iou: of the masks I > 0 on the whole canvas, in [0,1]; for a picture that others drew, I > 1/4, or I > 1/20
    in a density that is grey inside. f1_1px: F1 within a pixel, with each mask compared to the other's dilation by 3×3
    pixels; for a picture that others drew, at most the attractor's own, so that a camera cannot make a wrong code look
    right. noise_ratio: the error of the rendering over the error between two renderings of the code with different
    random points; about 1 for the true code. The error compares both images at several scales, see
    `cameras.comparison`. A picture of dots has more noise, which `cameras.grain` allows for. colour: the mean CIEDE2000
    difference between the code's colours and the picture's (see `colouring.error`), or None for a code without colours.

    ssim: SSIM inside the shape (`evaluation.inside`), which a slab in the place of branches lacks. ssim_chance: that of
    two drawings of the code by its camera with different random points, or dots: about what the true code has. f1_dark:
    F1 within a pixel of what is dark inside the shape's outline, None if nothing is. ssim_share: ssim over the same of
    two drawings without dots, both of images with pixels twice as large, in which the dots of a scatter plot weigh
    less. All four are None in files of older versions.
    """

    f1: float
    iou: float
    noise_ratio: float
    f1_1px: float
    colour: float | None = None
    ssim: float | None = None
    ssim_chance: float | None = None
    f1_dark: float | None = None
    ssim_share: float | None = None

    @classmethod
    def of(cls, code: IFS, target: TargetImage, camera: Camera | None = None, *, params: CameraParams | None = None,
           seed: int = 0) -> Likeness:
        """The likeness of a contractive code to a target. camera: that drew it, or None to estimate it if necessary,
        see `camera_for`; params: what the user knows of it."""
        image, camera = target.image, camera or camera_for(code, target, params=params, seed=seed)
        levels = with_camera(_levels_of(target, params), camera)
        comparison = Comparison(image, levels, derive(seed, "likeness"))
        rendering, known = comparison.render(code), target.known and target.known.mask(len(image))
        least = _lit_above(levels)
        masks = [(each > least).float()[None] for each in (rendering, image)]
        f1, iou, f1_1px = (float(metric(*masks)) for metric in (metrics.f1, metrics.iou, metrics.f1_1px))
        if not levels.is_exact and levels.is_whole:
            f1_1px = min(f1_1px, likeness_of_attractor(code, image, levels))
        ratio, again_seed = comparison.noise_ratio(code, rendering), derive(seed, "likeness", "again")
        again = comparison.masked(levels.noisy(code, len(image), again_seed).to(rendering))
        # A picture that is farther off than dots allow is no plot of this code, so its grain says nothing of chance.
        chance = again if ratio >= WITHIN_NOISE else comparison.masked(
            levels.plotted(code, len(image), again_seed).to(rendering))
        return cls(f1, iou, ratio, f1_1px,
                   ssim=ssim_inside(rendering, image, least, known),
                   ssim_chance=ssim_inside(chance, rendering, least, known),
                   f1_dark=f1_dark(rendering, image, least),
                   ssim_share=share_inside(rendering, image, again, least, target.known))

    @property
    def is_outline(self) -> bool:
        """Whether no more than the outline of the shape is alike, as in a slab in the place of a tree."""
        return self.ssim_share is not None and self.ssim_share < OUTLINE

    def __str__(self) -> str:
        colour = "" if self.colour is None else f", colours {self.colour:.2g} apart (CIEDE2000)"
        known = self.ssim is not None and self.ssim_chance is not None
        inside = "" if not known else f"SSIM {self.ssim:.3f} inside (by chance {self.ssim_chance:.3f}), "
        return (f"F1 {self.f1:.3f} ({self.f1_1px:.3f} within a pixel), IoU {self.iou:.3f}, {inside}"
                f"error {self.noise_ratio:.3g} × noise{colour}")


def share_inside(drawn: Tensor, image: Tensor, again: Tensor, above: float, shown: Known | None = None) -> float:
    """SSIM inside the shape of an image (R,R) in a drawing, over that of another drawing of the same code in it; both
    with pixels twice as large. above: the grey level above which a pixel belongs to the shape; shown: the part of the
    canvas that counts, None: all."""
    small, wanted, other = (mean_of(each, len(image) // 2) for each in (drawn, image, again))
    known = shown and shown.mask(len(small))
    return ssim_inside(small, wanted, above, known) / max(ssim_inside(other, small, above, known), LEAST_CHANCE)


def camera_for(code: IFS, target: TargetImage, *, params: CameraParams | None = None, seed: int = 0) -> Camera:
    """The camera that suits a code and a target best: of the kind that the target's levels say, with its values
    estimated if others drew the picture."""
    levels = _levels_of(target, params)
    return estimated(target.image, levels, code, derive(seed, "likeness")) or levels.camera


def default_camera(target: TargetImage) -> Camera:
    """The camera of a target as far as its levels say."""
    return _levels_of(target, None).camera


def lit_above(target: TargetImage, camera: Camera) -> float:
    """The grey level of a target above which a pixel counts as lit, as in `Likeness`."""
    return _lit_above(with_camera(_levels_of(target, None), camera))


def _lit_above(levels: Levels) -> float:
    return 0.0 if levels.is_exact else levels.lit_above


def redrawn(code: IFS, target: TargetImage, camera: Camera, *, params: CameraParams | None = None, seed: int = 0
            ) -> Tensor:
    """The code (R,R) drawn as the target was, with this camera, on the whole canvas: a part that the picture does not
    show is drawn as the code continues it."""
    levels = with_camera(_levels_of(target, params), camera)
    return levels.render(code, target.image.shape[-1], seed)


def _levels_of(target: TargetImage, params: CameraParams | None) -> Levels:
    return levels_of(target.image, target.levels, params or CameraParams(), target.known)


def likeness_of_attractor(code: IFS, image: Tensor, levels: Levels) -> float:
    """Agreement of a code's attractor with the shape in an image (R,R), as the F1 of a precision and a recall.

    Precision is the share of the attractor within a pixel of the shape. Recall is the share of the shape within a pixel
    of what the camera's pen draws around the attractor, or within half a tile or twig of the attractor.

    Precision also allows for half a tile: the attractor of a dragon fills what a drawing of few steps shows as a
    lattice. Large tiles look like the picture itself, and would make a wrong code look right. So the allowance is at
    most half of `SMALL_TILE_PX`, except for a code of `TILED_MAPS` or fewer.
    """
    side = len(image)
    attractor = levels.occupied(code, side, 1, levels.points(side), 0, False).numpy() > 0
    if levels.known is not None:
        attractor &= levels.known.mask(side).numpy()
    shape = (image > levels.lit_above).cpu().numpy()
    if not attractor.any() or not shape.any():
        return 0.0
    pen, tile = levels.pen * side / 2, levels.smallest_part(code, side) * side / 2
    largest = tile if len(code) <= TILED_MAPS else SMALL_TILE_PX
    near, inside = max(BESIDE_PX + pen, tile / 2), max(BESIDE_PX, min(tile, largest) / 2)
    off, away = (np.asarray(distance_transform_edt(~mask), np.float32) for mask in (shape, attractor))
    precision, recall = float((off[attractor] < inside).mean()), float((away[shape] < near).mean())
    return 2 * precision * recall / max(precision + recall, 1e-9)
