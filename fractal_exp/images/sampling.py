"""Find the square of a picture that fills the canvas, and resample it at the target's resolution."""

from __future__ import annotations

from collections.abc import Collection
from typing import NamedTuple

import numpy as np
import torch
from scipy.sparse import csr_array

from .bands import Bands, Profile
from .levels import has_target_levels

SHAPE_LEVEL = 0.1                        # share of the contrast above which a pixel belongs to the shape
SHAPE_LEVEL_IF_RINGING = 0.25            # the same in a coloured drawing as JPEG, which rings beside edges
# Shares of a shape's span between which a side at least is lit in a picture that cuts it off. Photographs that are
# trimmed on some sides have less, and flat edges of a shape more.
LEAST_CUT, MOST_CUT = 0.17, 0.95
NARROWEST = 0.25                         # canvas units: four cells of the search's coarsest grid
FRAMED = 0.9, 1.25                       # limits of the box's longer side, in sides of the frame: tips may be faint
CENTRED = 0.1                            # limit of the distance of the box's centre from the canvas', in the same unit


class Cut(NamedTuple):
    """A side cuts the shape off if it is lit along more than `least` and at most `most` of the shape's span. all_sides:
    whether a shape that reaches all four may be cut off, or is taken to be trimmed to its own box, as many are."""

    least: float
    most: float = np.inf
    all_sides: bool = True


CUT = Cut(LEAST_CUT, MOST_CUT, all_sides=False)
CUT_IN_CROP, CUT_IF_SAID = Cut(LEAST_CUT), Cut(0.0)   # whoever crops means it, and whoever says so knows


def window(grey: Bands, profile: Profile, level: float, padding: float, notes: list[str], *,
           rings: bool = False, cut: Cut = CUT) -> tuple[float, float, float, Collection[str]]:
    """The square (x, y, side) of a grey picture with this profile that fills the canvas: the shape's box, centred, with
    its padding; and the sides of the picture that cut the shape off. level: of the background; rings: whether it is a
    coloured drawing in a lossy file; cut: how a picture is known to cut it off."""
    scale, origin = grey.scale, grey.origin
    contrast = float(profile.high) - level
    away = np.abs(profile.border - level) / contrast
    noise = float(np.sqrt(np.square(away[away < 0.25]).mean())) if (away < 0.25).any() else 0.0
    lowest = min(max(SHAPE_LEVEL_IF_RINGING if rings else SHAPE_LEVEL, 6 * noise), 0.5)

    def extent(highest: np.ndarray) -> tuple[float, float]:
        share = ((highest - level) / contrast).clip(0)
        first, last = np.flatnonzero(share > lowest)[[0, -1]]
        return float(first + 1 - share[max(first - 1, 0):first + 1].sum()), float(last + share[last:last + 2].sum())

    (x0, x1), (y0, y1) = extent(profile.columns[1]), extent(profile.rows[1])
    side = max(x1 - x0, y1 - y0) / (1 - padding)
    width, height = (round(scale * len(each[1])) for each in (profile.columns, profile.rows))
    notes.append(f"the shape spans {scale * (x1 - x0):.1f}×{scale * (y1 - y0):.1f} px of {width}×{height}, "
                 f"centred at ({origin[0] + scale * (x0 + x1) / 2:.1f}, {origin[1] + scale * (y0 + y1) / 2:.1f})")
    spans = {"left": y1 - y0, "right": y1 - y0, "top": x1 - x0, "bottom": x1 - x0}
    lit = {name: float(((levels - level) / contrast > lowest).sum()) for name, levels in profile.sides.items()}
    touched = [name for name, count in lit.items() if count]
    may_be_cut = cut.all_sides or len(touched) < len(lit)
    is_cut = may_be_cut and any(cut.least * spans[name] < lit[name] <= cut.most * spans[name] for name in touched)
    is_wide = 2 * min(grey.width, grey.height) >= NARROWEST * side
    beyond = touched if is_cut and is_wide else []
    if beyond:
        notes.append(f"the picture cuts the shape off ({', '.join(beyond)}): what lies beyond is unknown, and the code "
                     "says how the shape goes on there")
    elif touched:
        notes.append(f"the shape reaches the edge of what is read ({', '.join(touched)}): it is taken to end there"
                     + ("; frame=part says that it goes on" if is_wide else ""))
    return (x0 + x1 - side) / 2, (y0 + y1 - side) / 2, side, beyond


def is_target(grey: Bands, profile: Profile, padding: float) -> bool:
    """Whether a picture (R,R) is a grey target of this package in its frame, with the levels that its code gave it."""
    frame = (1 - padding) * grey.width
    ends = np.array([np.flatnonzero(each[1] > 0)[[0, -1]] for each in (profile.columns, profile.rows)])
    longer = (ends[:, 1] + 1 - ends[:, 0]).max() / frame
    off_centre = np.abs(ends.sum(1) + 1 - grey.width).max() / 2 / frame
    is_framed = FRAMED[0] <= longer <= FRAMED[1] and off_centre <= CENTRED
    return is_framed and has_target_levels(torch.from_numpy(np.concatenate(list(grey))))


def resample(grey: Bands, x: float, y: float, side: float, resolution: int, fill: float) -> np.ndarray:
    """The square at (x, y) of a picture (H,W), resampled to (R,R), with `fill` beyond the picture."""
    rows = _weights(y, side, resolution, grey.height).tocsc()
    columns = _weights(x, side, resolution, grey.width)
    inside, first = np.zeros((resolution, resolution), np.float32), 0
    for band in grey:
        narrow = (columns @ band.T).T
        inside += rows[:, first:first + len(band)] @ narrow
        first += len(band)
    beyond = 1 - np.outer(rows.sum(1), columns.sum(1))
    return np.ascontiguousarray(inside + np.float32(fill) * beyond, np.float32).clip(0, 1)


def _weights(start: float, side: float, resolution: int, count: int) -> csr_array:
    """The weight of each of `count` source pixels in each target pixel, (R, count) float32, sparse.

    Shrinking is exact area averaging: the weight is the length that both pixels share. Enlarging is linear
    interpolation between the centres of source pixels. At equal size both are the same.
    """
    step = side / resolution
    edges = start + step * np.arange(resolution + 1)
    if step >= 1:  # a source pixel reaches into at most two target pixels
        pixels = np.tile(np.arange(count), 2)
        targets = np.floor((pixels - start) / step).astype(np.int64) + np.repeat([0, 1], count)
        known = (targets >= 0) & (targets < resolution)
        pixels, targets = pixels[known], targets[known]
        shared = np.minimum(edges[targets + 1], pixels + 1) - np.maximum(edges[targets], pixels)
        weights = shared.clip(0) / step
    else:  # a target pixel lies between two source pixels
        targets = np.tile(np.arange(resolution), 2)
        centers = ((edges[1:] + edges[:-1]) / 2)[targets]
        pixels = np.floor(centers - 0.5).astype(np.int64) + np.repeat([0, 1], resolution)
        weights = (1 - np.abs(centers - (pixels + 0.5))).clip(0)
        known = (pixels >= 0) & (pixels < count)
        weights, targets, pixels = weights[known], targets[known], pixels[known]
    return csr_array((weights.astype(np.float32), (targets, pixels)), shape=(resolution, count))
