"""Plots of codes by matplotlib, as tutorials and notebooks show them: axes, ticks, grids, legends, colour bars, dark
styles.

A name gives the same picture every time.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from fractal_exp import codes
from fractal_exp.ifs import attractor

from .figures import UNIT_SEGMENT, copies
from .seen import Seen

CODES = ("fern", "sierpinski_triangle", "maple_leaf", "heighway_dragon", "spiral", "tree", "levy_c_curve", "cyclosorus",
         "twindragon", "culcita", "terdragon", "sierpinski_carpet")
CURVES = {"koch_curve": 5, "heighway_dragon": 11, "levy_c_curve": 11, "terdragon": 7}  # with their steps
MAPS = ("viridis", "inferno", "jet", "gray_r", "coolwarm", "hot")  # of colours
KINDS = ("grid", "legend", "dark", "stretched")
STYLES = {"dark": "dark_background", "stretched": "seaborn-v0_8-whitegrid"}
PENS = ("tab:blue", "green", "black", "crimson")
DOTS: dict[str, Any] = {"s": 0.6, "linewidths": 0}
POINTS, BINS, MARGIN = 40_000, 200, 0.06
SIZE, DPI = (6.4, 4.8), 120


@cache
def names() -> dict[str, tuple[str, str]]:
    """"grid-fern", "viridis-spiral", each with its kind and its code."""
    drawn = [(kind, CODES[(3 * k + 4 * j) % len(CODES)]) for k, kind in enumerate(KINDS) for j in range(3)]
    drawn += [("curve", code) for code in CURVES] + [("steps", code) for code in CODES[2:4]]
    drawn += [(colours, CODES[(5 * k + 7 * j) % len(CODES)]) for k, colours in enumerate(MAPS) for j in range(2)]
    return {f"{kind}-{code}": (kind, code) for kind, code in drawn}


@cache
def seen(name: str) -> Seen:
    """The plot of this name."""
    kind, known = names()[name]
    pixels, onto = _drawn(kind, known, zlib.crc32(name.encode()), plain=False)
    alone, _ = _drawn(kind, known, zlib.crc32(name.encode()), plain=True)
    return Seen(pixels, alone.mean(-1) / alone.max(), codes.known(known), onto)


def _drawn(kind: str, known: str, seed: int, plain: bool) -> tuple[np.ndarray, Callable[[np.ndarray], np.ndarray]]:
    """The plot (H,W,3) uint8, and what takes its coordinates to pixels; plain: the shape alone, white on black."""
    from matplotlib import style
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    code = codes.known(known)
    points, letters = attractor.random_points(code, POINTS, seed)
    pen = "white" if plain or kind == "dark" else PENS[seed % len(PENS)]
    with style.context(STYLES.get(kind, "default")):
        figure = Figure(figsize=SIZE, dpi=DPI)
        canvas = FigureCanvasAgg(figure)
        axes = figure.add_subplot()
        if kind != "stretched":
            axes.set_aspect("equal", adjustable="box" if kind in MAPS else "datalim")
        shown = None
        if kind in MAPS:
            shown = _density(axes, points, "gray" if plain else kind)
        elif kind == "curve":
            line = copies(code, UNIT_SEGMENT, CURVES[known]).reshape(-1, 2)
            axes.plot(*line.T, color=pen, linewidth=1)
        elif kind == "steps":
            colours = np.full(POINTS, POINTS) if plain else np.arange(POINTS)
            shown = axes.scatter(*points.T, c=colours, cmap="gray" if plain else "plasma", vmin=0, vmax=POINTS, **DOTS)
        elif kind == "legend" and not plain:
            for letter in np.unique(letters):
                axes.scatter(*points[letters == letter].T, label=f"$f_{letter + 1}$", **DOTS)
            axes.legend(markerscale=10, title="map")
        else:
            axes.scatter(*points.T, color=pen, **DOTS)
        axes.set(title=f"{known.replace('_', ' ')}, {POINTS} points", xlabel="x", ylabel="y")
        axes.grid(kind not in (*MAPS, "legend"))
        if shown is not None and kind in (*MAPS, "steps"):
            figure.colorbar(shown, ax=axes, label="log(1 + count)" if kind in MAPS else "step")
        if plain:
            _stripped(figure, axes)
        canvas.draw()
        pixels = np.asarray(canvas.buffer_rgba())[..., :3].copy()
        transform, height = axes.transData.frozen(), len(pixels)
    return pixels, lambda places: transform.transform(places) * [1, -1] + [0, height]


def _density(axes: Any, points: np.ndarray, colours: str) -> Any:
    """The logarithm of the counts of points, as an image with a margin."""
    margin = MARGIN * np.ptp(points, 0)
    (x0, y0), (x1, y1) = points.min(0) - margin, points.max(0) + margin
    counts = np.histogram2d(*points.T, BINS, ((x0, x1), (y0, y1)))[0].T
    return axes.imshow(np.log1p(counts), origin="lower", cmap=colours, extent=(x0, x1, y0, y1))


def _stripped(figure: Any, axes: Any) -> None:
    """Leave nothing but the shape, on black, where it is."""
    for each in figure.axes[1:]:
        each.set_visible(False)
    axes.set_axis_off()
    axes.set_title("")
    axes.grid(False)
    figure.set_facecolor("black")
