"""Dimensions of a measure by points, dimension and lacunarity of a picture by boxes: slopes over a range of scales."""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree
from scipy.special import digamma
from scipy.stats import linregress, t

from ..errors import InputError
from ..ifs.attractor import random_points
from ..ifs.code import IFS
from . import Dimension

GAMES, POINTS, CENTRES = 8, 50_000, 2000  # chaos games, points of each, and of these whose neighbours are looked for
RADII = np.geomspace(3e-4, 3e-2, 13)      # of balls, in the points' standard deviation
NEIGHBOURS = 2 ** np.arange(1, 8)         # the nearest, the next but one …, to which distances are taken
SMALLEST = 1e-12                          # of distances, and of a standard deviation beside which points differ
SIZES, OFFSETS, LEAST_SIDE = 12, 8, 16    # of boxes, from 2 px to a quarter of the shape; a side; of a shape, px


def slope(x: np.ndarray, y: np.ndarray) -> tuple[float, float, float]:
    """The slope of y over x by least squares, its standard error, and how far that of half the range is from it."""
    whole, half = linregress(x, y), len(x) // 2 + 1
    parts = [linregress(x[i:i + half], y[i:i + half]).slope for i in range(len(x) - half + 1)]
    return float(whole.slope), float(whole.stderr), float(np.abs(np.subtract(parts, whole.slope)).max())


def information(points: np.ndarray) -> tuple[float, float, float]:
    """By distances to the k-th nearest of points (n,2) (Badii and Politi 1985, Grassberger 1985)."""
    distances, _ = KDTree(points).query(points[::len(points) // CENTRES], NEIGHBOURS + 1)
    return slope(np.log(np.maximum(distances, SMALLEST)).mean(0), digamma(NEIGHBOURS))


def correlation(points: np.ndarray) -> tuple[float, float, float]:
    """By the number of pairs of points (n,2) within radii (Grassberger and Procaccia 1983)."""
    tree = KDTree(points)
    return slope(np.log(RADII), np.log(np.maximum(tree.count_neighbors(tree, RADII) - len(points), 1)))


MEASURES = {"information": information, "correlation": correlation}


def of_points(code: IFS, kind: str, seed: int) -> Dimension:
    """The information or correlation dimension of a contractive code's measure. The interval is that of the mean of
    the games, and twice by how much the slope changes over its range, as it goes on to change at smaller scales."""
    found = []
    for game in range(GAMES):
        points = random_points(code, POINTS, [seed, game])[0]
        points = points - points.mean(0)
        size = np.sqrt((points**2).sum(1).mean())
        found.append(MEASURES[kind](points / size) if size > SMALLEST else (0.0, 0.0, 0.0))  # all are one point
    slopes, _, changes = np.transpose(found)
    error = t.ppf(0.975, GAMES - 1) * slopes.std(ddof=1) / np.sqrt(GAMES)
    return _estimate(kind, slopes.mean(), error + 2 * changes.mean(), f"{GAMES} × {POINTS} points")


def count_boxes(lit: np.ndarray) -> Dimension:
    """The box dimension of the lit pixels (H,W) of a picture, by the number of square boxes of each size that hold one,
    the mean over up to 64 offsets of their lattice. The interval is two standard errors, and twice by how much the
    slope changes over its range. Raises `InputError` if the longer side of the shape has less than 16 pixels."""
    table, sizes = _summed(lit)
    counts = []
    for size in sizes:
        starts = np.unique(np.linspace(-size, 0, min(size, OFFSETS), endpoint=False).astype(int)) + 1
        rows, columns = ([np.arange(start, side + size - 1, size).clip(0, side - 1) for start in starts]
                         for side in table.shape)
        counts.append(np.mean([np.count_nonzero(np.diff(np.diff(table[level][:, upright], axis=0)))
                               for level in rows for upright in columns]))
    value, error, change = slope(-np.log(sizes), np.log(counts))
    return _estimate("boxes", value, 2 * error + 2 * change,
                     f"{len(sizes)} sizes from {sizes[0]} to {sizes[-1]} px, standard error {error:.2g}")


def lacunarity(lit: np.ndarray) -> dict[int, float]:
    """How unevenly the lit pixels (H,W) of a picture fill boxes of each size: the mean square of their number in a box,
    over the square of its mean, over all boxes within the shape's bounding box (Allain and Cloitre 1991). It is 1 where
    all hold as many. Raises `InputError` as `count_boxes` does."""
    (table, sizes), found = _summed(lit), {}
    for size in sizes[sizes < min(table.shape)].tolist():
        strips = table[:, size:] - table[:, :-size]
        masses = (strips[size:] - strips[:-size]).astype(np.float64)
        found[size] = float((masses**2).mean() / masses.mean() ** 2)
    return found


def _summed(lit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The number of lit pixels above and to the left of each corner within the bounding box, and sizes of boxes."""
    rows, columns = (np.flatnonzero(lit.any(axis)) for axis in (1, 0))
    side = max(np.ptp(rows), np.ptp(columns)) + 1 if len(rows) else 0
    if side < LEAST_SIDE:
        raise InputError(f"a shape to measure has at least {LEAST_SIDE} px a side, got {side}; take a larger picture")
    part = lit[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1]
    table = np.pad(part.cumsum(0, dtype=np.int32).cumsum(1, dtype=np.int32), ((1, 0), (1, 0)))
    return table, np.unique(np.geomspace(2, side / 4, SIZES).round().astype(int))


def _estimate(kind: str, value: float, margin: float, how: str) -> Dimension:
    return Dimension(kind, min(float(value), 2.0), max(float(value - margin), 0.0), min(float(value + margin), 2.0),
                     "estimate", how)
