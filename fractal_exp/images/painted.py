"""The colours of a picture where its target lies: what a code's colours are fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from ..errors import InputError
from .bands import Bands
from .checks import unit
from .pixels import open_pixels
from .reading import ReadImage
from .sampling import resample

FINEST = 4           # pixels of a painted picture for one of the target, at most, along each side
MOST_SIDE = 1024     # pixels a side of a painted picture, at most, unless the target has more
COVERED = 0.5        # share of a pixel above which it counts as the shape's
ALIKE = 0.5          # of the largest distance from the ground nearby: pixels beyond are wholly covered
UNSEEN = 1 / 512     # level of the target up to which a pixel is dark
UNLIKE = 0.02        # distance from the ground up to which a pixel is the ground's
GREY = 0.01          # difference between channels up to which a colour is a grey


@dataclass(frozen=True, eq=False)
class Painted:
    """A picture in colour in the square that fills the canvas, (S,S) pixels, S a multiple of the target's side.

    seen (S,S,3): the picture as it is, transparent parts laid on the ground; ground (3,): the colour of its background;
    cover (S,S): the share of a pixel that the shape covers; all in [0,1]. lit (S,S): the shape's pixels, more than half
    of them covered. So a pixel of the shape's colour c is seen as cover · c + (1 - cover) · ground.
    """

    seen: np.ndarray
    ground: np.ndarray
    cover: np.ndarray
    lit: np.ndarray

    @classmethod
    def of(cls, picture: ReadImage) -> Painted:
        """The colours of the picture that a target was read from.

        The cover is the picture's opacity where it has any; otherwise `cover_of` estimates it. A picture that was given
        without its source is its target, in greys. Raises `InputError` if the picture cannot be read again or has
        another size now.
        """
        target = picture.image.numpy()
        step = max(1, min(FINEST, int(1 / max(picture.scale, 1e-6)), MOST_SIDE // len(target)))
        level = np.kron(target, np.ones((step, step), np.float32))
        if picture.source is None:
            return cls._opaque(np.repeat(level[..., None], 3, -1), level, np.zeros(3))
        pixels = open_pixels(picture.source, crop=picture.crop)
        if pixels.full != picture.source_size:
            raise InputError(f"the picture {picture.source} now has {pixels.full[0]}×{pixels.full[1]} pixels, but had "
                             f"{picture.source_size[0]}×{picture.source_size[1]}; give `invert` the new one")
        channels = [_placed(pixels, picture, channel, len(level)) for channel in range(4)]
        seen, alpha = np.dstack(channels[:3]), channels[3]
        if pixels.channels == 4 and alpha[1:-1, 1:-1].min() < 1 - UNLIKE:
            ground = np.full(3, float(picture.inverted))
            laid = seen + (1 - alpha[..., None]) * ground.astype(np.float32)
            return cls(laid, ground, alpha, (alpha > COVERED) & (level > UNSEEN))
        dark = (level <= UNSEEN) & (alpha == 1)
        ground = np.median(seen[dark] if dark.any() else seen[:1].reshape(-1, 3), axis=0)
        return cls._opaque(seen + (1 - alpha[..., None]) * ground, level, ground)

    @classmethod
    def _opaque(cls, seen: np.ndarray, level: np.ndarray, ground: np.ndarray) -> Painted:
        away = np.linalg.norm(seen - ground, axis=-1) * (level > UNSEEN)
        cover = cover_of(away)
        return cls(seen.astype(np.float32), ground, cover, cover > COVERED)

    @property
    def is_grey(self) -> bool:
        """Whether the shape has no colours but greys."""
        shape = self.seen[self.lit]
        return not len(shape) or float(np.ptp(shape, axis=-1).max()) <= GREY


def cover_of(away: np.ndarray) -> np.ndarray:
    """The share of each pixel (H,W) that a shape covers, in [0,1]. away: how far the pixel is from the ground's colour.
    One among others about as far is covered wholly, and one at an edge by its distance over the largest nearby."""
    inside = minimum_filter(away, 3) >= ALIKE * maximum_filter(away, 3)
    cover = np.where(inside, 1.0, away / np.maximum(maximum_filter(away, 5), UNLIKE)) * (away > UNLIKE)
    return cover.astype(np.float32)


def _placed(pixels: Bands, picture: ReadImage, channel: int, side: int) -> np.ndarray:
    """A channel of the square that fills the canvas, (S,S), 0 beyond what was read of the picture: red, green and blue
    times opacity, or opacity (3)."""
    def one(band: np.ndarray) -> np.ndarray:
        levels = np.atleast_3d(unit(band))
        opacity = levels[..., 3] if pixels.channels == 4 else np.ones(levels.shape[:2], np.float32)
        return opacity if channel == 3 else opacity * levels[..., min(channel, levels.shape[2] - 1)]

    (left, top), (x0, y0, x1, _) = pixels.origin, picture.crop_box
    return resample(pixels.map(one), x0 - left, y0 - top, x1 - x0, side, 0.0)
