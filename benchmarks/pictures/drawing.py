"""Pictures of polygons, lines and dots as others draw them: by Pillow without smoothing, by matplotlib with it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from PIL import Image, ImageDraw

from fractal_exp.ifs.code import IFS
from fractal_exp.images.placement import Placement

DPI = 100
INK = {"black": (0, 0, 0), "green": (0, 128, 0), "blue": (31, 119, 180), "red": (200, 30, 45), "orange": (255, 140, 0),
       "white": (255, 255, 255)}  # white ink is on black paper, any other on white paper
JPEG_QUALITY = 70


@dataclass(frozen=True)
class Similarity:
    """From the coordinates of a fractal, y up, to the pixels of a picture, y down: (x + scale X, y - scale Y)."""

    scale: float
    x: float
    y: float

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """Points (…,2) of the fractal in pixels; the upper left pixel has its centre at (0.5, 0.5)."""
        return np.asarray(points) * [self.scale, -self.scale] + [self.x, self.y]

    def onto(self, placement: Placement) -> tuple[float, tuple[float, float]]:
        """The scale and the shift from the fractal to the canvas on which a picture has this placement."""
        x, y = placement.to_canvas((self.x, self.y)).tolist()
        return self.scale * 2 / placement.side, (x, y)


@dataclass(frozen=True)
class Page:
    """Paper of `size` (width, height) pixels and what is laid on it: ink and where the fractal lies."""

    size: tuple[int, int]
    ink: str
    similarity: Similarity

    @property
    def paper(self) -> tuple[int, int, int]:
        return (0, 0, 0) if self.ink == "white" else (255, 255, 255)


def page(rng: np.random.Generator, points: np.ndarray, ink: str) -> Page:
    """A page on which points (P,2) fill most of a picture whose longer side has 512 to 800 pixels, not quite in its
    middle."""
    low, high = points.min(0), points.max(0)
    width, height = (high - low).clip((high - low).max() / 4)
    longer = rng.integers(512, 801)
    scale = longer * rng.uniform(0.8, 0.9) / max(width, height)
    room = longer - scale * max(width, height)
    size = np.rint(scale * np.array([width, height]) + room).astype(int)
    free = size - scale * (high - low)
    left, top = free * rng.uniform(0.35, 0.65, 2)
    similarity = Similarity(float(scale), float(left - scale * low[0]), float(top + scale * high[1]))
    return Page((int(size[0]), int(size[1])), ink, similarity)


def by_pillow(on: Page, polygons: np.ndarray | None = None, lines: np.ndarray | None = None,
              widths: np.ndarray | float = 2.0) -> np.ndarray:
    """Polygons (K,V,2) filled and lines (K,2,2) of `widths` pixels, each pixel all or nothing: (H,W,3) uint8."""
    picture = Image.new("RGB", on.size, on.paper)
    pen = ImageDraw.Draw(picture)
    for corners in np.floor(_in_pixels(on, polygons)):  # whole numbers of the pixels that hold the points
        pen.polygon([tuple(corner) for corner in corners.tolist()], fill=INK[on.ink])
    ends = np.floor(_in_pixels(on, lines))
    for pair, width in zip(ends, np.broadcast_to(widths, len(ends)), strict=True):
        pen.line([tuple(end) for end in pair.tolist()], fill=INK[on.ink], width=max(1, round(float(width))))
    return np.asarray(picture)


def by_matplotlib(on: Page, polygons: np.ndarray | None = None, lines: np.ndarray | None = None,
                  widths: np.ndarray | float = 2.0, dots: np.ndarray | None = None, dot: float = 0.2) -> np.ndarray:
    """The same with smooth edges, and dots (P,2) as `scatter` draws them with s=`dot`: (H,W,3) uint8."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.figure import Figure

    width, height = on.size
    ink, paper = (np.array(colour) / 255 for colour in (INK[on.ink], on.paper))
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor=tuple(paper))
    canvas = FigureCanvasAgg(figure)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    axes.set_xlim(0, width)
    axes.set_ylim(height, 0)
    if polygons is not None:
        axes.add_collection(PolyCollection(list(_in_pixels(on, polygons)), facecolors=[ink], edgecolors="none"))
    if lines is not None:
        points = np.broadcast_to(widths, len(lines)) * 72 / DPI
        axes.add_collection(LineCollection(list(_in_pixels(on, lines)), colors=[ink], linewidths=points,
                                           capstyle="round"))
    if dots is not None:
        at = _in_pixels(on, dots)
        axes.scatter(at[:, 0], at[:, 1], s=dot, color=[ink])
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


DRAW = {"pillow": by_pillow, "matplotlib": by_matplotlib}


def jpeg_file(pixels: np.ndarray, name: str, quality: int = JPEG_QUALITY) -> Path:
    """The path of the picture as a JPEG file. It lives as long as this process."""
    path = Path(_folder().name) / f"{name}.jpg"
    Image.fromarray(pixels).save(path, quality=quality)
    return path


@cache
def _folder() -> TemporaryDirectory:
    return TemporaryDirectory()


def placed(code: IFS, similarity: Similarity, placement: Placement) -> IFS:
    """A code in the fractal's coordinates, as a code of the canvas."""
    return code.similar(*similarity.onto(placement))


def _in_pixels(on: Page, points: np.ndarray | None) -> np.ndarray:
    return np.empty((0, 1, 2)) if points is None else on.similarity(points)
