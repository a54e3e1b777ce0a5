"""Even out the light on a photographed or scanned paper: divide by what the paper itself shows of it."""

from __future__ import annotations

import numpy as np

from .bands import Bands, Overview
from .checks import Notes
from .colours import ROWS

UNEVEN = 0.06           # share by which the border's brightest part exceeds its darkest one under an uneven light
RIM = 0.02              # width of the border in which that is measured, relative to the picture's side
PARTS = 8               # of each side of the border
CELLS = 32              # along the longer side, of each of which the paper's level is estimated
LEAST_CELLS = 4         # along the shorter side, without which no surface is fitted
PAPER = 0.8             # quantile of a cell's levels that is the paper's, if it has any
INK = 0.5               # share of the brightest cell's level below which a cell shows ink
ROUGH = 3.0             # times the texture of plain paper from which a cell shows ink
SMOOTH = 1e-4           # of the spline through the paper's levels
NEAR = 0.12             # relative distance from the spline within which a cell is paper
WHITE = 0.9             # maximum level of the paper when it is evened out; its noise goes beyond
DARKEST = 0.4           # minimum level of the paper, relative to its brightest part
ROUNDS = 3              # of fitting the spline and choosing the cells
MOST, MOST_OF_RIM = 0.35, 0.8  # minimum share of cells that are paper, of all and along the border


def evened(picture: Bands, notes: Notes) -> Bands:
    """A picture (H,W) or (H,W,3) in [0,1] of ink on paper, or chalk on a board, under an uneven light, as if the light
    were even; another picture as it is. A note says what was done.

    Cells without ink are known by a level near their neighbours' and a texture like that of most; a smooth surface (a
    thin plate spline) through them gives the paper's level everywhere, in each channel.
    """
    if _unevenness(picture) <= UNEVEN:
        return picture
    channels = [Overview.of(picture.map(lambda band, k=k: np.atleast_3d(band)[..., k])).mean
                for k in range(picture.channels)]
    light = _light(np.stack(channels, -1))
    if light is None:
        return picture
    darkest = float(light.min(axis=(0, 1)).mean() / light.max(axis=(0, 1)).mean())
    notes.append(f"the light on the paper is uneven, down to {darkest:.0%} of its brightest: it was evened out")
    return picture.over(light)


def _unevenness(picture: Bands) -> float:
    """How much brighter the brightest part of a picture's border is than the darkest, as a share."""
    rim = max(1, round(RIM * min(picture.height, picture.width)))
    ends = [picture.rows(0, rim), picture.rows(picture.height - rim, picture.height)]
    rows = np.linspace(0, picture.height - 1, ROWS).astype(int).tolist()
    sides = np.concatenate([picture.rows(row, row + 1) for row in rows])
    strips = [*(np.moveaxis(end, 0, 1) for end in ends), sides[:, :rim], sides[:, -rim:]]
    levels = [np.median(part) for strip in strips for part in np.array_split(strip, PARTS)]
    return 1 - float(np.min(levels)) / max(float(np.max(levels)), 1e-6)


def _light(levels: np.ndarray) -> np.ndarray | None:
    """By what to divide a picture (H,W,C), at nodes (h,w,C) as `Bands.over` takes them, so that all of its paper is as
    bright as its brightest part; None if it shows no paper under an uneven light."""
    from scipy.interpolate import RBFInterpolator

    cell = -(-max(levels.shape) // CELLS)
    rows, columns = (np.array_split(np.arange(side), -(-side // cell)) for side in levels.shape[:2])
    if min(len(rows), len(columns)) < LEAST_CELLS:
        return None
    cells = [[levels[np.ix_(down, across)] for across in columns] for down in rows]
    level = np.array([[np.quantile(each, PAPER, axis=(0, 1)) for each in row] for row in cells])
    texture = np.array([[each.min(-1).std() for each in row] for row in cells])
    at = np.stack(np.meshgrid([each.mean() for each in rows], [each.mean() for each in columns], indexing="ij"), -1)
    at = (at / max(levels.shape)).reshape(-1, 2)
    darkest = level.min(-1)
    plain = texture <= ROUGH * np.quantile(texture, 0.3)
    is_paper = plain & (darkest >= INK * np.quantile(darkest, 0.95))
    for _ in range(ROUNDS):
        if is_paper.mean() < MOST:
            return None
        spline = RBFInterpolator(at[is_paper.ravel()], level[is_paper], smoothing=SMOOTH)
        fitted = spline(at).reshape(level.shape)
        is_paper = plain & (np.abs(level - fitted) <= NEAR * fitted).all(-1)
    rim = np.ones_like(is_paper)
    rim[1:-1, 1:-1] = False
    if is_paper[rim].mean() < MOST_OF_RIM:
        return None
    light = fitted.mean(-1)[is_paper]
    if not 0 < DARKEST * light.max() <= light.min() <= (1 - UNEVEN) * light.max():
        return None
    brightest = np.minimum(fitted[is_paper].max(0), WHITE)
    nodes = np.stack(np.meshgrid(*(np.linspace(0, side / max(levels.shape), 2 * len(part) + 1) for side, part in
                                   zip(levels.shape[:2], (rows, columns), strict=True)), indexing="ij"), -1)
    return spline(nodes.reshape(-1, 2)).reshape(*nodes.shape[:2], -1).clip(0.01) / brightest
