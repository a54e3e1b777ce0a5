"""One grey channel from a picture's colours: transparency, luminance, and the distance from the background's colour."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np

from ..errors import InputError
from .bands import Bands
from .checks import Notes, unit

LUMINANCE = (0.2126, 0.7152, 0.0722)     # weights of red, green and blue: ITU-R BT.709
MIN_CONTRAST = 0.02                      # between the darkest and the lightest pixel
LUMA = np.array((0.299, 0.587, 0.114))   # weights of red, green and blue in a JPEG: ITU-R BT.601
LUMA_CONTRAST = 0.15                     # between background and pen, above which a JPEG's luma determines levels
COLOURED = 0.015                         # minimum share of the squared distance from the background that is colour
ONE_PEN = 0.97                           # minimum share of it in one direction if all is drawn with one pen
PEN_LEVEL = 0.999                        # quantile of the shape's distances that counts as the pen's own colour
SHAPE_DISTANCE = 0.1                     # share of the largest distance above which a pixel belongs to the shape
ROWS = 64                                # rows of a picture that determine the colour of its background
BINS = 4096                              # of a histogram of distances, which are at most the square root of three


def luminance(pixels: Bands, invert: bool | str, name: str, notes: Notes) -> tuple[Bands, Bands | None]:
    """Luminance (H,W), with transparent parts laid on a backdrop; and the colours (H,W,3) in [0,1] behind it, or None
    if there are none."""
    if pixels.channels == 1:
        return pixels.map(unit), None
    lowest, highest = (1.0, 1.0) if pixels.channels == 3 else _extremes(pixels.map(_alpha))
    if lowest == 1:
        return pixels.map(luminance_of), pixels.map(lambda band: unit(band[..., :3]), 3)
    if highest == 0:
        raise InputError(f"{name} is fully transparent; there is nothing to see")
    darkest, lightest, mean = _visible(pixels, highest / 2)
    if lightest - darkest < 2 * MIN_CONTRAST:
        notes.append("the shape is in the alpha channel alone: opaque is white")
        return pixels.map(_alpha), None
    backdrop = float(mean < 0.5) if invert == "auto" else float(invert)
    notes.append(f"transparent parts laid on {'white' if backdrop else 'black'}")

    def laid(band: np.ndarray) -> np.ndarray:
        alpha = _alpha(band)
        return alpha * luminance_of(band) + (1 - alpha) * np.float32(backdrop)

    def coloured(band: np.ndarray) -> np.ndarray:
        alpha = _alpha(band)[..., None]
        return alpha * unit(band[..., :3]) + (1 - alpha) * np.float32(backdrop)

    return pixels.map(laid), pixels.map(coloured, 3)


@dataclass(frozen=True, eq=False)
class Pen:
    """Measures how far a pixel's colour is from the background's: along the `direction` (3,) of the pen's colour, or in
    any direction if there are several colours (None). `full` is the distance that counts as 1. `by_luma`:
    whether the luma tells how far along the direction a colour is, because a JPEG stores the rest of a colour at half
    the resolution."""

    background: np.ndarray
    direction: np.ndarray | None
    full: float
    darker: bool
    by_luma: bool = False

    @classmethod
    def of(cls, colours: Bands, invert: bool | str) -> Pen | None:
        """The pen of a coloured picture; None if its colours add nothing to its luminance."""
        background = border_colour(colours)
        moments, sign = np.zeros((3, 3)), np.zeros(3)
        for band in colours:
            away = (band - background).reshape(-1, 3).astype(np.float64)
            moments += away.T @ away
            sign += np.linalg.norm(away, axis=1) @ away
        energy = float(np.trace(moments))
        if energy == 0 or energy - moments.sum() / 3 < COLOURED * energy:
            return None
        strengths, directions = np.linalg.eigh(moments)
        direction = directions[:, -1] * (1 if directions[:, -1] @ sign > 0 else -1)
        darker = bool(direction @ LUMINANCE < 0)
        if invert != "auto" and bool(invert) != darker:
            return None
        pen = cls(background, direction if strengths[-1] > ONE_PEN * energy else None, 1.0, darker)
        pen = replace(pen, full=pen._full(colours))
        if pen.full <= MIN_CONTRAST:
            return None
        return replace(pen, by_luma=colours.lossy and pen._luma > LUMA_CONTRAST)

    def levels(self, colours: np.ndarray) -> np.ndarray:
        """The level (H,W) in [0,1] of each pixel of colours (H,W,3)."""
        away = colours - self.background.astype(np.float32)
        if self.direction is None:
            distance = np.linalg.norm(away, axis=-1)
        else:
            along = LUMA / (self.direction @ LUMA) if self.by_luma else self.direction
            distance = away @ along.astype(np.float32)
        return (distance / np.float32(self.full)).clip(0, 1)

    @property
    def _luma(self) -> float:
        """The contrast in luma between the background and a pen of one colour; 0 if there are several colours."""
        return 0.0 if self.direction is None else abs(self.full * float(self.direction @ LUMA))

    def _full(self, colours: Bands) -> float:
        """The distance of the pen's own colour: a high quantile of the distances of the shape's pixels."""
        edges = np.linspace(0, 1.75, BINS + 1)
        wide = replace(self, full=1.75)
        counts = np.sum([np.histogram(1.75 * wide.levels(band), edges)[0] for band in colours], 0)
        farthest = np.flatnonzero(counts)[-1]
        counts[:int(SHAPE_DISTANCE * farthest) + 1] = 0
        reached = np.searchsorted(np.cumsum(counts), PEN_LEVEL * counts.sum())
        return float(edges[min(reached, farthest)] + edges[1] / 2)

    def describe(self) -> str:
        """A sentence on what was done."""
        background = _name(self.background)
        if self.direction is None:
            return f"coloured: levels are how far a pixel's colour is from the background's, {background}"
        pen = _name(self.background + self.direction * self.full)
        return f"coloured: levels run from the background's colour, {background}, to the pen's, {pen}"


def _name(colour: np.ndarray) -> str:
    return "#" + "".join(f"{round(255 * float(part)):02x}" for part in colour.clip(0, 1))


def border_colour(colours: Bands) -> np.ndarray:
    """The median colour (3,) of a picture's border."""
    bands = [np.concatenate([band[:, 0], band[:, -1]]) for band in colours]
    ends = colours.rows(0, 1)[0], colours.rows(colours.height - 1, colours.height)[0]
    return np.median(np.concatenate([*ends, *bands]), axis=0)


def background_colour(colours: Bands, dark: np.ndarray, block: int) -> np.ndarray:
    """The median colour (3,) of some pixels in the dark blocks of a picture, (h,w) blocks of `block`² pixels."""
    columns, found = np.arange(colours.width) // block, []
    for row in np.unique(np.linspace(0, colours.height - 1, ROWS).astype(int)).tolist():
        found.append(colours.rows(row, row + 1)[0, dark[row // block][columns]])
    seen = np.concatenate(found)
    return np.median(seen, axis=0) if len(seen) else border_colour(colours)


def luminance_of(band: np.ndarray) -> np.ndarray:
    """The luminance (H,W) of a band of colours."""
    parts = (weight * unit(band[..., channel]) for channel, weight in enumerate(LUMINANCE))
    return reduce(add, parts).clip(0, 1)


def _alpha(band: np.ndarray) -> np.ndarray:
    return unit(band[..., 3])


def _extremes(grey: Bands) -> tuple[float, float]:
    lows, highs = zip(*((float(band.min()), float(band.max())) for band in grey), strict=True)
    return min(lows), max(highs)


def _visible(pixels: Bands, least: float) -> tuple[float, float, float]:
    """The lowest, highest and mean luminance where the opacity is at least `least`. It must be so somewhere."""
    low, high, total, count = 1.0, 0.0, 0.0, 0
    for band in pixels:
        seen = luminance_of(band)[_alpha(band) >= least]
        if seen.size:
            low, high = min(low, float(seen.min())), max(high, float(seen.max()))
            total, count = total + float(seen.sum(dtype=np.float64)), count + seen.size
    return low, high, total / count
