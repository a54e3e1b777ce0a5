"""Coloured drawings of self-similar shapes, as people bring them: by matplotlib and Pillow, never by our renderer."""

from __future__ import annotations

import io
import math
from collections.abc import Callable

import numpy as np
from PIL import Image, ImageDraw

FINE = 4     # pixels drawn for one of the picture, along each side
FERN = ((0.01, 0, 0, 0, 0.16, 0, 0), (0.85, 0.85, 0.04, -0.04, 0.85, 0, 1.6), (0.07, 0.2, -0.26, 0.23, 0.22, 0, 1.6),
        (0.07, -0.15, 0.28, 0.26, 0.24, 0, 0.44))  # probability a b c d e f
BY_MAP = ("#5d4037", "#2e7d32", "#c0ca33", "#00897b")
BARK, SPROUT = (92, 58, 30), (124, 196, 58)
STALK, TIP = (70, 110, 40), (214, 72, 32)


def _fern_points(count: int = 60_000) -> tuple[np.ndarray, np.ndarray]:
    rng, point = np.random.default_rng(0), np.zeros(2)
    points, letters = np.empty((count, 2)), rng.choice(4, count, p=[row[0] for row in FERN])
    for number, chosen in enumerate(letters):
        _, a, b, c, d, e, f = FERN[chosen]
        point = np.array([a * point[0] + b * point[1] + e, c * point[0] + d * point[1] + f])
        points[number] = point
    return points, letters


def _scatter(points: np.ndarray, **colours: object) -> Image.Image:
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, plot = plt.subplots(figsize=(6, 6), dpi=100)
    plot.scatter(points[:, 0], points[:, 1], s=0.8, linewidths=0, **colours)
    plot.set_aspect("equal")
    plot.axis("off")
    file = io.BytesIO()
    figure.savefig(file, format="png")
    plt.close(figure)
    return Image.open(file).convert("RGB")


def fern_by_height() -> Image.Image:
    """Barnsley's fern as a scatter plot, its colour by the height of a point."""
    points, _ = _fern_points()
    return _scatter(points, c=points[:, 1], cmap="summer_r")


def fern_by_map() -> Image.Image:
    """The fern as a scatter plot, each point in the colour of the map that led to it."""
    points, letters = _fern_points()
    return _scatter(points, c=[BY_MAP[letter] for letter in letters])


def _mixed(a: tuple[int, ...], b: tuple[int, ...], t: float) -> tuple[int, ...]:
    return tuple(round(x + (y - x) * t) for x, y in zip(a, b, strict=True))


def pythagoras_tree(depth: int = 11, side: int = 700) -> Image.Image:
    """Pythagoras's tree, its squares coloured by depth from bark to sprout, on white."""
    picture = Image.new("RGB", (side * FINE, side * FINE), "white")
    pen = ImageDraw.Draw(picture)

    def grow(a: complex, b: complex, level: int) -> None:
        up = (b - a) * -1j
        square = [a, b, b + up, a + up]
        colour = _mixed(BARK, SPROUT, level / depth)
        pen.polygon([(point.real * FINE, point.imag * FINE) for point in square], fill=colour)
        if level < depth:
            top = a + up + (b - a) / 2 + up / 2
            grow(a + up, top, level + 1)
            grow(top, b + up, level + 1)

    width = side / 7.2
    grow(complex(side / 2 - width / 2, 0.8 * side), complex(side / 2 + width / 2, 0.8 * side), 0)
    return picture.resize((side, side), Image.Resampling.BOX)


def compound_leaf(depth: int = 5, side: int = 600) -> Image.Image:
    """A leaf of leaflets of leaflets, from a green stalk to red tips, on transparent paper."""
    picture = Image.new("RGBA", (side * FINE, side * FINE), (255, 255, 255, 0))
    pen = ImageDraw.Draw(picture)

    def grow(foot: complex, along: complex, level: int) -> None:
        """A stalk with a pair of leaflets at .45 of its length, and a smaller leaf in place of its upper part."""
        if level == depth:
            outline = [foot + along * (t + 0.22j * s * math.sin(math.pi * t))
                       for s, ts in ((1, np.linspace(0, 1, 9)), (-1, np.linspace(1, 0, 9))) for t in ts]
            pen.polygon([(point.real * FINE, point.imag * FINE) for point in outline], fill=(*tint, 255))
            return
        joint = foot + 0.45 * along
        share = level / depth
        pen.line([(foot.real * FINE, foot.imag * FINE), (joint.real * FINE, joint.imag * FINE)],
                 fill=(*_mixed(STALK, TIP, share), 255), width=max(1, round(0.035 * abs(along) * FINE)))
        for turn, size in ((0, 0.55), (math.radians(52), 0.42), (math.radians(-52), 0.42)):
            grow(joint, along * size * complex(math.cos(turn), math.sin(turn)), level + 1)

    tint = TIP
    grow(complex(side / 2, 0.93 * side), complex(0, -0.86 * side), 0)
    return picture.resize((side, side), Image.Resampling.BOX)


def dragon(order: int = 12, side: int = 640) -> Image.Image:
    """The Heighway dragon as a line, its colour by the length so far, on black."""
    import colorsys

    turns = [1]
    for _ in range(order - 1):
        turns = [*turns, 1, *(-turn for turn in reversed(turns))]
    steps = np.cumprod([1, *(1j * turn for turn in turns)])
    points = np.concatenate([[0], np.cumsum(steps)])
    low = complex(points.real.min(), points.imag.min())
    span = max(np.ptp(points.real), np.ptp(points.imag))
    at = (points - low) / span * 0.86 * side + complex(0.07, 0.2) * side
    picture = Image.new("RGB", (side * FINE, side * FINE), "black")
    pen = ImageDraw.Draw(picture)
    width = round(1.05 * 0.86 * side / span * FINE)
    for k, (a, b) in enumerate(zip(at, at[1:], strict=False)):
        colour = tuple(round(255 * part) for part in colorsys.hsv_to_rgb(0.02 + 0.55 * k / len(at), 0.75, 0.95))
        pen.line([(a.real * FINE, a.imag * FINE), (b.real * FINE, b.imag * FINE)], fill=colour, width=width)
    return picture.resize((side, side), Image.Resampling.BOX)


DRAWINGS: dict[str, Callable[[], Image.Image]] = {
    "fern_by_height": fern_by_height, "fern_by_map": fern_by_map, "pythagoras_tree": pythagoras_tree,
    "compound_leaf": compound_leaf, "dragon": dragon,
}
