"""Colours in all formats with colours: the code's own, or else those of a palette that is the same in all of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch

from ..code import IFS
from ..colours import Colours

COLOURS = 256  # of a palette
# Bright on black and not pale on white. Neighbours also differ in lightness, so they differ in grey.
ANCHORS = np.array([[38, 110, 214], [18, 164, 150], [96, 188, 64], [240, 178, 36], [232, 98, 60], [196, 60, 140]])
SPEED = 0.5       # of maps without a blend
SAMPLED = 50_000  # points of the chaos game from which a palette is made
PATHS = 16        # through the colours of the maps that are tried, at most
MANY = 1000       # maps above which a single path is tried, as its work grows with their square


@dataclass(frozen=True)
class Palette:
    """What flam3 has for colours: a palette rgb (256,3), uint8, and places on it and speeds of the maps (N,) in [0,1].

    A point has a place u on the palette. The map i that moves the point makes it u <- (1 - s_i) u + s_i u_i.
    """

    rgb: np.ndarray
    places: np.ndarray
    speeds: np.ndarray

    @classmethod
    def of(cls, code: IFS) -> Palette:
        """The palette with which flam3 draws a contractive code in its own colours, as nearly as it can. A code without
        colours gets one that tells its maps apart.

        A place on the palette has the mean colour of the points there, which is the best in the least-squares sense.
        Points of other colours at the same place make the error, so several places of the maps are tried, in several
        orders of the maps: along the principal axis of the points' colours, and along paths through the maps' colours
        that always go on to the nearest one left. In each order, either the maps' places are as far apart as their
        colours and the speeds are the blends, so that a place mixes them as a colour does; or each map has a part of
        the palette for itself, so that a place tells which maps a point came from. The first is exact if the maps'
        colours lie on a line in RGB, as any two do. Raises `InputError` if no point gets a colour.
        """
        count, own = len(code), code.colours
        if own is None:
            return cls(ramp(np.linspace(0, 1, COLOURS)), np.array([place(i, count) for i in range(count)]),
                       np.full(count, SPEED))
        rgb, blends = (each.cpu().double().numpy() for each in (own.rgb, own.blends))
        points = _folded(code, rgb, blends[:, None], SAMPLED)
        axis = np.linalg.eigh(np.cov(points.T))[1][:, -1]
        along = [_unit(rgb @ axis), *(_path(rgb, start) for start in range(min(count, PATHS if count <= MANY else 1)))]
        widths = np.minimum(1 - blends, np.sqrt(code.sampling_probabilities().cpu().double().numpy()))
        tried = [*((each, blends) for each in along), *(_apart(each, widths) for each in along)]
        places, speeds = (np.column_stack(each) for each in zip(*tried, strict=True))
        where = np.vstack([_folded(code, places, speeds, SAMPLED), places])
        shown = np.vstack([points, rgb])  # the maps too, so that the palette has their colours also where no point is
        fits = [_mean_colours(each, shown) for each in where.T]
        best = min(range(len(fits)), key=lambda k: fits[k][1])
        return cls(np.rint(255 * fits[best][0]).astype(np.uint8), places[:, best], speeds[:, best])


def of_palette(entries: Mapping[int, Sequence[float]], places: np.ndarray, speeds: np.ndarray) -> Colours | None:
    """The colours of maps with places on a palette and speeds (N,), in [0,1]; None if the palette is the one that
    `Palette.of` gives to codes without any.

    entries: red, green and blue in [0,255] of indices in [0,255]. Between two of them, round the palette's end as well,
    flam3 interpolates. A code mixes colours where flam3 mixes places. They are the same if the speeds are 1 or the
    palette is a straight line in RGB.
    """
    given = sorted(entries)
    table = np.array([entries[index] for index in given], np.float64).clip(0, 255)
    if len(given) == COLOURS and np.array_equal(table, ramp(np.linspace(0, 1, COLOURS))):
        return None
    at = np.minimum(COLOURS * places, COLOURS - 1)
    rgb = np.stack([np.interp(at, given, channel, period=COLOURS) for channel in table.T], 1) / 255
    return Colours(torch.from_numpy(rgb), torch.from_numpy(speeds))


def place(index: int, count: int) -> float:
    """Where map `index` of `count` lies on the palette of codes without colours, in [0,1]."""
    return index / max(count - 1, 1)


def ramp(places: np.ndarray) -> np.ndarray:
    """Colours (…,3), uint8, at places (…) in [0,1] of that palette."""
    knots = np.linspace(0, 1, len(ANCHORS))
    return np.rint(np.stack([np.interp(places, knots, channel) for channel in ANCHORS.T], -1)).astype(np.uint8)


def of_points(code: IFS, maps: np.ndarray) -> np.ndarray:
    """Colours (K,3), uint8, of the first K points of `attractor.random_points` of a contractive code and seed 0, which
    gives the maps (K,) that led to them too: the code's own, or else those of the last maps. Raises `InputError` if the
    code has colours and no point gets one."""
    if code.colours is None:
        return ramp(maps / max(len(code) - 1, 1))
    rgb, blends = (each.cpu().double().numpy() for each in (code.colours.rgb, code.colours.blends))
    return np.rint(255 * _folded(code, rgb, blends[:, None], len(maps)).clip(0, 1)).astype(np.uint8)


def _folded(code: IFS, values: np.ndarray, speeds: np.ndarray, count: int) -> np.ndarray:
    """What points of the chaos game have (count,K), if each map blends in its values (N,K) with its speeds (N,K) or
    (N,1), as it does with colours."""
    from .. import attractor  # imports numba, which reading does not need

    if code.colours is not None:
        code.colours.shares(code.sampling_probabilities())  # or it raises
    weights = speeds * code.sampling_probabilities().cpu().double().numpy()[:, None]
    now = (weights * values).sum(0) / weights.sum(0)  # the mean over all points
    keep, gift = 1 - speeds, speeds * values
    letters = attractor.random_letters(code, count)
    made = np.empty((len(letters) - attractor.WARM_UP, letters.shape[1], values.shape[1]))
    for step, maps in enumerate(letters):
        now = keep[maps] * now + gift[maps]
        if step >= attractor.WARM_UP:
            made[step - attractor.WARM_UP] = now
    return made.reshape(-1, values.shape[1])[:count]


def _path(rgb: np.ndarray, start: int) -> np.ndarray:
    """Places in [0,1] (N,) of colours (N,3) by their way along a path from one of them always on to the nearest."""
    ways, left, now = np.zeros(len(rgb)), np.ones(len(rgb), bool), start
    for _ in range(len(rgb) - 1):
        left[now] = False
        away = np.where(left, np.linalg.norm(rgb - rgb[now], axis=1), np.inf)
        before, now = now, int(away.argmin())
        ways[now] = ways[before] + away[now]
    return _unit(ways)


def _apart(along: np.ndarray, widths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Places and speeds (N,) with which each map takes the whole palette to a part of its own, in the order of `along`
    (N,), with gaps between if there is room. widths (N,): of the parts, in [0,1], which are scaled to fit.

    So a place tells the last maps of its points, as an arithmetic code does (Rissanen 1976).
    """
    order, widths = np.argsort(along, kind="stable"), widths / max(1.0, widths.sum())
    gap = (1 - widths.sum()) / max(len(along) - 1, 1)
    begins, speeds = np.empty(len(along)), 1 - widths
    begins[order] = np.cumsum(np.append(0.0, widths[order][:-1] + gap))
    return (begins / speeds).clip(0, 1), speeds


def _unit(values: np.ndarray) -> np.ndarray:
    """Values brought to [0,1]; 0 if all are the same."""
    return (values - values.min()) / max(float(np.ptp(values)), 1e-9)


def _mean_colours(places: np.ndarray, colours: np.ndarray) -> tuple[np.ndarray, float]:
    """A palette (256,3) with the mean of the colours (K,3) at each of the places (K,), and their mean squared distance
    to it. Between, where no place is, it is interpolated."""
    entries = np.minimum(np.rint(COLOURS * places), COLOURS - 1).astype(np.int64)  # flam3 has entry k at k / 256
    counts = np.bincount(entries, minlength=COLOURS)
    hit = np.flatnonzero(counts)
    means = [np.bincount(entries, channel, COLOURS)[hit] / counts[hit] for channel in colours.T]
    palette = np.stack([np.interp(np.arange(COLOURS), hit, mean) for mean in means], 1)
    return palette, float(((colours - palette[entries])**2).sum(1).mean())
