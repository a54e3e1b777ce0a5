"""Real pictures for trials, from files that come with scikit-image and matplotlib."""

from __future__ import annotations

import numpy as np
from torch import Tensor

from ..runtime.extras import need
from .reading import check_resolution, read_target

FIELD_LEVEL = 40             # level of the red channel below which a pixel is the camera's mask, not the eye
RIM_PX = 8                   # width stripped off the photograph's round rim
VESSEL_PX = 12               # half the widest structure that counts as a vessel
RIDGE_SCALES = (2, 3, 4)     # pixels, standard deviations of the ridge filter
RIDGE_LEVELS = (0.03, 0.11)  # a vessel lies above the lower everywhere and above the upper somewhere
SPECK_PX = 400               # connected areas below this size are not vessels


def retina_vessels(resolution: int) -> Tensor:
    """The blood vessels of `skimage.data.retina()` as a target (resolution, resolution) in [0,1], white on black.

    The photograph (1411×1411, in scikit-image's wheel, no download) goes through a black top-hat of the logarithm of
    its green channel, which keeps dark, narrow parts; Sato's ridge filter (Sato et al. 1998), chosen by eye over
    Meijering's, Frangi's and the hybrid Hessian filter; a threshold with hysteresis; and the removal of specks.
    `read_target` frames it, and raises `InputError` on an unusable resolution.
    """
    check_resolution(resolution)
    return read_target(_vessels(), resolution, invert=False).image


def snowflake(resolution: int) -> Tensor:
    """The snowflake ❄ of the font DejaVu Sans (in matplotlib's wheel) as a target (resolution, resolution) in [0,1].

    Raises the `InputError` of `read_target` on an unusable resolution.
    """
    need("matplotlib")
    from matplotlib import font_manager
    from PIL import Image, ImageDraw, ImageFont

    check_resolution(resolution)
    side = 4 * max(resolution, 256)
    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), side // 2)
    glyph = Image.new("L", (side, side))
    ImageDraw.Draw(glyph).text((side / 2, side / 2), "\N{SNOWFLAKE}", 255, font, anchor="mm")
    return read_target(np.asarray(glyph), resolution, invert=False).image


def _vessels() -> np.ndarray:
    """The mask (1411,1411) of the vessels."""
    need("skimage")
    from scipy import ndimage
    from skimage import data, filters, measure, morphology

    photograph = data.retina()
    field = np.pad(ndimage.binary_fill_holes(photograph[..., 0] > FIELD_LEVEL), 1)
    depth = ndimage.distance_transform_edt(field)[1:-1, 1:-1]
    # Beyond the rim, pixels get the nearest colour of the eye, so that the rim itself is not a ridge.
    nearest = ndimage.distance_transform_edt(depth < RIM_PX / 2, return_distances=False, return_indices=True)
    green = np.log(photograph[..., 1].clip(1).astype(np.float32))[tuple(nearest)]
    disk = morphology.disk(VESSEL_PX, decomposition="sequence")
    hollows = morphology.black_tophat(ndimage.gaussian_filter(green, 1), disk)
    ridges = filters.sato(hollows, sigmas=RIDGE_SCALES, black_ridges=False) * (depth > RIM_PX)
    labels = measure.label(filters.apply_hysteresis_threshold(ridges, *RIDGE_LEVELS))
    large = np.bincount(labels.ravel()) >= SPECK_PX
    large[0] = False
    return large[labels]
