"""Photographed and scanned paper: find the sheet that lies on something darker, and even out the light on it."""

from __future__ import annotations

import numpy as np
from scipy import ndimage
from scipy.interpolate import RBFInterpolator

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

DESK = 0.6              # maximum level around a sheet, relative to the sheet's
SAME = 0.5              # maximum share of the picture's edge that has one level in a photograph
SHEET = 0.2             # minimum share of a picture that a sheet covers
FOUR_CORNERED = 0.97    # minimum share of a sheet and of the polygon of its four corners that they have in common
INSET, FREE = 0.015, 0.999 # margin along a sheet's sides that is left out, and minimum share without ink beside it
INKED = 0.001, 0.6      # limits of the share of a sheet that is ink


def sheet(picture: Bands, notes: Notes) -> Bands:
    """What lies on a sheet of paper in a photograph that shows a darker desk all around it; another picture as it is.

    The sheet is bright, has four corners, ink in it, and a margin without ink, so that a level box holds all that is
    drawn. A warning says that it was found, or that there is no such box.
    """
    overview = Overview.of(picture.map(lambda band: np.atleast_3d(band).min(-1)))
    levels, (height, width) = overview.mean, overview.mean.shape
    edge = np.concatenate([levels[0], levels[-1], levels[:, 0], levels[:, -1]])
    bright, dark = float(np.quantile(levels, 0.95)), float(np.median(edge))
    if dark > DESK * bright or np.bincount(np.rint(255 * edge).astype(int)).max() > SAME * edge.size:
        return picture
    labels, count = ndimage.label(levels > (bright + dark) / 2)  # type: ignore[misc]
    if not count:
        return picture
    largest = labels == np.bincount(labels.ravel())[1:].argmax() + 1
    whole = np.asarray(ndimage.binary_fill_holes(largest))
    at = np.argwhere(whole)[:, ::-1]
    corners = np.stack([at[(at @ way).argmax()] for way in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    (x, y), after = corners.T, np.roll(corners, -1, 0).T
    area = abs(float((x * after[1] - after[0] * y).sum())) / 2
    if not SHEET * height * width <= min(area, len(at)) or min(area, len(at)) < FOUR_CORNERED * max(area, len(at)):
        return picture
    inset = round(INSET * max(height, width))
    left, right = max(x[0], x[3]) + inset, min(x[1], x[2]) - inset
    top, bottom = max(y[0], y[1]) + inset, min(y[2], y[3]) - inset
    paper = (labels > 0)[top:bottom, left:right]
    if min(paper.shape) <= 4 * inset or not INKED[0] <= 1 - paper.mean() <= INKED[1]:
        return picture
    if min(side.mean() for side in (paper[:inset], paper[-inset:], paper[:, :inset], paper[:, -inset:])) < FREE:
        notes.warn("a sheet of paper seems to lie on something darker, but what is drawn on it reaches too near to its "
                   "sides: turn the picture until the sheet is upright, and crop it")
        return picture
    notes.warn("a sheet of paper lies on something darker: only what is drawn on it is read; invert=false takes the "
               "sheet itself for the shape")
    return picture.part(*(int(side) * overview.block for side in (top, bottom, left, right)))


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
