"""The tone of a shape: which side is the background, the background's noise, and the level of a flat colour."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from ..errors import InputError
from .bands import Bands, Overview, Profile
from .checks import Notes
from .colours import MIN_CONTRAST

STEADY = 0.75           # minimum share of the border near the background's level, in a picture that has a background
MOST_OF_PAPER = 0.7     # share of a picture with one level from which that level is the background's
NOISES = 4.0            # standard deviations of the border's noise that count as background
NOISE_SHARE = 0.8       # quantile of the border's deviations that estimates its noise: most of a noisy border deviates
MOST_NOISE = 0.25       # maximum level that counts as noise of the background
GRAIN = 1.6             # times the noise up to which a lone speck is noise, too
QUIET = 0.02            # maximum share of the border that is brighter than the noise if what was measured is noise
RINGING = 0.9           # quantile of the levels beside a shape that measures a JPEG's errors
RINGINGS = 1.5          # factor on that quantile up to which the errors reach
MOST_RINGING = 0.12     # maximum level that counts as such an error
NEAR_PX, APART_PX = 8, 2  # "beside a shape": within a JPEG's block of it, but off its smooth edge
FLAT_PX = 64            # minimum pixels lit all around that determine a shape's level; with fewer, all lit pixels do
FLAT_WIDTH = 0.012      # half the width of the peak of levels of a flat colour
FLAT_SHARE = 0.6        # minimum share of pixels in the peak
FLAT_ABOVE = 0.03       # maximum share of pixels brighter than the peak by more than FLAT_MORE
FLAT_MORE = 0.06
FLAT_RANGE = (0.15, 0.98)  # levels of flat colours that are raised to white


def check_contrast(profile: Profile, name: str) -> None:
    """Raise `InputError` if the picture shows nothing."""
    low, high = float(profile.low), float(profile.high)
    if high - low < MIN_CONTRAST:
        kind = "empty (all black)" if high < MIN_CONTRAST else "all white" if low > 1 - MIN_CONTRAST else "evenly grey"
        raise InputError(f"{name} is {kind}: its levels run from {low:.3f} to {high:.3f}; a target needs a shape that "
                         "stands out from its background")


def background(grey: Bands, profile: Profile, invert: bool | str, notes: Notes, overview: Overview | None
               ) -> tuple[float, bool, bool]:
    """The background's level; whether the picture must be inverted to make its shape white; and whether even then most
    of what deviates from the background is darker.

    With an overview, if the border has no common level, as on a scanned paper, most of the picture gives the level.
    """
    level, contrast = float(np.median(profile.border)), float(profile.high - profile.low)
    if overview is not None and (np.abs(profile.border - level) < contrast / 4).mean() < STEADY:
        most = float(np.median(overview.mean))
        level = most if (np.abs(overview.mean - most) < contrast / 10).mean() > MOST_OF_PAPER else level
    above = total = 0.0
    for band in grey:
        energy = np.square(band - level, dtype=np.float64)
        total += float(energy.sum())
        above += float(energy[band > level].sum())
    brighter = above / total
    inverted = brighter < 0.5 if invert == "auto" else bool(invert)
    steady = float((np.abs(profile.border - level) < contrast / 4).mean())
    say_polarity(inverted, invert, max(brighter, 1 - brighter) < 0.75 or steady < STEADY,
                 notes)
    return level, inverted, (1 - brighter if inverted else brighter) < 0.5


def say_polarity(inverted: bool, invert: bool | str, doubtful: bool, notes: Notes) -> None:
    """Note which side was taken for the shape."""
    said = "black shape on white: inverted" if inverted else "white shape on black"
    notes.doubtful = invert == "auto" and doubtful
    if notes.doubtful:
        notes.warn(f"{said}, but the border leaves doubt; invert={str(not inverted).lower()} takes it the other way")
    else:
        notes.append(said if invert == "auto" else f"{said}, as asked")


def above_background(profile: Profile, level: float, notes: Notes
                     ) -> tuple[Callable[[np.ndarray], np.ndarray] | None, float]:
    """A function of levels that takes the background's level and its noise, measured on the border, to 0, and white to
    1, or None if nothing needs to change; and the level of that noise."""
    contrast = float(profile.high) - level
    away = np.abs(profile.border - level)
    away = away[away < contrast / 4]
    deviation = float(np.quantile(away, NOISE_SHARE)) if away.size else 0.0
    noise = min(NOISES * deviation / (1 - level), MOST_NOISE) if level < 1 else 0.0
    if level < 1e-6 and noise < 1e-6:
        return None, 0.0
    if level > MIN_CONTRAST:
        notes.append(f"the background's level, {level:.2f}, was taken away")
    if noise >= 1e-6:
        notes.append(f"levels up to {noise:.2g} are noise of the background: black")

    def raised(levels: np.ndarray) -> np.ndarray:
        lit = ((levels - np.float32(level)) / np.float32(1 - level)).clip(0, 1)
        return np.where(lit <= noise, np.float32(0), lit) if noise >= 1e-6 else lit

    return raised, noise


def grain(overview: Overview, profile: Profile, noise: float) -> np.ndarray | None:
    """The faint specks (h,w) of a picture whose noise, up to a level, is black already: what noise leaves of itself.
    None if there are none, or if the border shows more than noise."""
    lit = overview.highest > 0
    if not lit.any() or noise <= MIN_CONTRAST or (profile.border > 0).mean() > QUIET:
        return None
    labels, _ = ndimage.label(lit, np.ones((3, 3)))  # type: ignore[misc]
    strong = np.unique(labels[overview.highest > GRAIN * noise])
    found = lit & ~np.isin(labels, strong)
    return found if found.any() and (lit & ~found).any() else None


def ringing(overview: Overview) -> float:
    """The level that a JPEG's errors reach beside the shape; 0 if there are none."""
    lit = overview.mean
    reach = max(1, NEAR_PX // overview.block)
    strong, any_lit = lit > 0.5, ndimage.maximum_filter(lit, 2 * APART_PX + 1) > 0.25
    beside = lit[np.logical_and(ndimage.maximum_filter(strong, 2 * reach + 1), ~any_lit)]
    return min(RINGINGS * float(np.quantile(beside, RINGING)), MOST_RINGING) if beside.size >= FLAT_PX else 0.0


@dataclass(frozen=True)
class Flat:
    """A shape of one level. `inner`: whether pixels that are lit all around determined it."""

    level: float
    inner: bool

    @classmethod
    def of(cls, overview: Overview) -> Flat | None:
        """The level of a shape of one flat colour, white on black, or None.

        Most pixels that are lit all around have it, and hardly any is brighter; points of a chaos game scatter more.
        """
        from scipy import ndimage

        lit = overview.mean
        least = max(FLAT_RANGE[0] / 2, 0.25 * float(lit.max()))
        inner = ndimage.minimum_filter(lit, 3, mode="constant") > least
        enough = int(inner.sum()) >= FLAT_PX
        levels = lit[inner] if enough else lit[lit > least]
        if not levels.size:
            return None
        counts, edges = np.histogram(levels, 256, (0, 1))
        peak = (edges[counts.argmax()] + edges[counts.argmax() + 1]) / 2
        near = levels[np.abs(levels - peak) <= FLAT_WIDTH]
        level = float(np.median(near))
        if near.size < FLAT_SHARE * levels.size or (levels > level + FLAT_MORE).mean() > FLAT_ABOVE:
            return None
        return cls(level, enough)


def levelled(overview: Overview, notes: Notes, *, coloured: bool) -> float:
    """The factor that makes a shape of one flat colour white; 1 for any other shape. coloured: levels are distances
    from the background's colour, so no level has a meaning of its own."""
    flat = Flat.of(overview)
    most = 1.0 if coloured else FLAT_RANGE[1]
    if flat is None or not FLAT_RANGE[0] <= flat.level < most:
        return 1.0
    if flat.level < FLAT_RANGE[1]:
        notes.append(f"one flat colour: its level, {flat.level:.2f}, was raised to white")
    return 1 / flat.level


def check_noise(overview: Overview, name: str) -> None:
    """Raise `InputError` on a picture of noise: neighbouring pixels are independent, evenly everywhere."""
    lit = overview.mean
    side = min(lit.shape)
    if side < 32:
        return
    centred = lit - lit.mean()
    variance = float(np.square(centred).mean())
    across, down = (float((centred[a] * centred[b]).mean()) / variance for a, b in (
        ((slice(None), slice(1, None)), (slice(None), slice(None, -1))),
        ((slice(1, None), slice(None)), (slice(None, -1), slice(None)))))
    cell = side // 8
    blocks = lit[:lit.shape[0] // cell * cell, :lit.shape[1] // cell * cell]
    means = blocks.reshape(blocks.shape[0] // cell, cell, -1, cell).mean((1, 3))
    busy = float((np.abs(lit - np.median(lit)) > 0.02).mean())
    if busy > 0.3 and max(abs(across), abs(down)) < 0.1 and float(means.std()) < 5 * np.sqrt(variance) / cell:
        raise InputError(f"{name} is noise: neighbouring pixels have nothing to do with one another, and no part is "
                         "brighter than another; a target needs a shape that stands out from its background")


def check_clear(overview: Overview, profile: Profile, level: float, notes: Notes) -> None:
    """Add a note if the picture has no background, as in most photographs."""
    contrast = float(profile.high - profile.low)
    steady = float((np.abs(profile.border - level) < contrast / 4).mean())
    spread = float(np.abs(profile.border - level).mean()) / contrast
    like_it = float((np.abs(overview.mean - level) < contrast / 10).mean())
    if like_it < 0.35 and (steady < STEADY or spread > 0.1):
        notes.no_clear_shape("the border is not of one colour, and only "
                             f"{like_it:.0%} of the picture are of the colour that the border has most")
