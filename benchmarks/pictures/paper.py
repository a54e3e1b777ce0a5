"""Photographs and scans of drawings and plots on paper whose true codes are known.

The drawings are pictures of the textbook set, drawn by Pillow and matplotlib, and plots. Here they are on paper with
grain, or in chalk on a board, under a light that is mostly uneven, seen with a tilt of a few degrees by a camera that
blurs and makes noise, and stored as a JPEG of quality 80. A name gives the same picture every time.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Callable
from functools import cache

import numpy as np
from scipy.ndimage import gaussian_filter
from skimage.transform import ProjectiveTransform, warp

from fractal_exp.ifs.code import IFS

from . import plots, textbook
from .drawing import jpeg_file
from .seen import Seen

SIDE = 1000                      # pixels of a photograph's longer side
JPEG_QUALITY = 80
INK, PAPER = 0.12, (0.93, 0.91, 0.86)  # levels of printed black and of the paper's white
BOARD, CHALK = (0.14, 0.2, 0.17), 0.6  # the board's levels, and the share of what is missing to white that chalk adds
BLUR_PX, GRAIN_PX = 0.8, 1.5
NOISE, GRAIN = 0.012, 0.02       # standard deviations: of the camera, and of the paper's grain before it is blurred
MOST_TILT = 6.0                  # degrees, about both axes
DISTANCE = 2.5                   # of the camera, in longer sides of the page
SHEET = 0.72                     # of the photograph's sides are a sheet's on a desk
DESK = 0.32, 0.22, 0.15

Light = Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]


def _aslant(x: np.ndarray, y: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A third less from side to side."""
    angle = rng.uniform(0, 2 * math.pi)
    along = x * math.cos(angle) + y * math.sin(angle)
    return 1 - 0.3 * (along - along.min()) / np.ptp(along)


def _lamp(x: np.ndarray, y: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Brightest at a point, half as bright in the farthest corner."""
    at = rng.uniform(-0.5, 0.5, 2)
    away = (x - at[0])**2 + (y - at[1])**2
    return 1 - 0.5 * away / away.max()


def _shadow(x: np.ndarray, y: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """The soft shadow of a hand or a phone, two fifths darker, on a side of the paper."""
    angle = rng.uniform(0, 2 * math.pi)
    along = x * math.cos(angle) + y * math.sin(angle) - rng.uniform(0.1, 0.5)
    return (1 - 0.1 * (x + 1) / 2) * (1 - 0.4 / (1 + np.exp(-along / 0.05)))


def _scanner(x: np.ndarray, y: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Even, but for a fold that lifts the paper off along one edge."""
    return 1 - 0.25 * np.exp(-(x + 1) / 0.12)


def _even(x: np.ndarray, y: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.ones_like(x)


KINDS: dict[str, tuple[Light, float]] = {  # with the share of the largest tilt
    "aslant": (_aslant, 0), "lamp": (_lamp, 0), "shadow": (_shadow, 0.3), "scanner": (_scanner, 0), "even": (_even, 0),
    "tilted": (_aslant, 1), "sheet": (_aslant, 0.6), "board": (_lamp, 0), "plot": (_aslant, 0.4)}
FAMILIES = ("koch_curve", "fern_dots", "gasket", "heighway", "tree_dots", "carpet", "levy", "maple_leaf_dots",
            "koch_filled", "binary_tree", "pentagon", "spiral_dots")
PLOTS = "grid-twindragon", "legend-cyclosorus", "stretched-culcita", "curve-heighway_dragon"
EACH = 4                         # drawings of every kind


@cache
def names() -> dict[str, str]:
    """"lamp-gasket-8-orange", each with the name of its drawing."""
    deepest = {each.family: name for name, each in reversed(textbook.pictures().items())
               if each.deepest and not each.jpeg and each.ink != "white"}
    drawings = [deepest[family] for family in FAMILIES] * 2
    drawn = {kind: drawings[5 * k % len(FAMILIES):][:EACH] for k, kind in enumerate(KINDS)} | {"plot": PLOTS}
    return {f"{kind}-{name}": name for kind, of_kind in drawn.items() for name in of_kind}


@cache
def seen(name: str) -> Seen:
    """The photograph of this name."""
    (kind, _, drawing), rng = name.partition("-"), np.random.default_rng(zlib.crc32(name.encode()))
    pixels, onto, alone, code = _drawing(drawing)
    shine, tilt = KINDS[kind]
    height, width = pixels.shape[:2]
    move, size = _camera(width, height, SHEET if kind == "sheet" else 1.0, tilt * MOST_TILT, rng)
    ink = _warped(1 - pixels / 255.0, move, size)
    y, x = (2 * each / max(size) - 1 for each in np.mgrid[:size[1], :size[0]])
    grain = gaussian_filter(rng.normal(0, GRAIN * 2 * math.sqrt(math.pi) * GRAIN_PX, ink.shape[:2]), GRAIN_PX)
    if kind == "board":
        page = np.array(BOARD) * (1 + grain[..., None]) + CHALK * ink.max(-1, keepdims=True) * (1 - np.array(BOARD))
    else:
        page = np.array(PAPER) * (1 + grain[..., None]) * (1 - (1 - INK) * ink)
    if kind == "sheet":
        lies = _warped(np.ones((height, width, 1)), move, size)
        desk = np.array(DESK) * (1 + 4 * gaussian_filter(grain, (0.5, 12))[..., None])
        page = lies * page + (1 - lies) * desk
    photo = gaussian_filter(page * shine(x, y, rng)[..., None], (BLUR_PX, BLUR_PX, 0))
    photo = (255 * (photo + rng.normal(0, NOISE, photo.shape))).clip(0, 255).round().astype(np.uint8)
    return Seen(jpeg_file(photo, name, JPEG_QUALITY), _warped(alone, move, size), code,
                lambda points: move(onto(points) - 0.5) + 0.5)


def _drawing(name: str) -> tuple[np.ndarray, Callable[[np.ndarray], np.ndarray], np.ndarray, IFS]:
    """A drawing (H,W,3) uint8, what takes its code's coordinates to its pixels, the shape alone (H,W) and the code."""
    if name in PLOTS:
        plot = plots.seen(name)
        assert isinstance(plot.source, np.ndarray)
        return plot.source, plot.onto, plot.alone, plot.code
    drawn = textbook.pictures()[name].draw()
    assert drawn.truth.code is not None
    ink = (255 - drawn.pixels.astype(float)).max(-1)
    return drawn.pixels, drawn.similarity, ink / ink.max(), drawn.truth.code


def _camera(width: int, height: int, sheet: float, tilt: float, rng: np.random.Generator
            ) -> tuple[ProjectiveTransform, tuple[int, int]]:
    """From the pixels of a page to those of its photograph, and the size (width, height) of that. sheet: the page's
    share of the photograph; tilt: the largest angle in degrees about either axis."""
    scale = SIDE / max(width, height)
    size = round(scale * width), round(scale * height)
    up, aside, turn = np.radians(rng.uniform(-1, 1, 3) * tilt)
    centred = np.array([[scale, 0, -size[0] / 2], [0, scale, -size[1] / 2], [0, 0, 1]])
    spin = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    away = DISTANCE * SIDE
    seen = np.array([[math.cos(aside), 0, 0], [0, math.cos(up), 0], [math.sin(aside) / away, math.sin(up) / away, 1]])
    back = np.array([[sheet, 0, size[0] / 2], [0, sheet, size[1] / 2], [0, 0, 1]])
    return ProjectiveTransform(back @ seen @ spin @ centred), size


def _warped(page: np.ndarray, move: ProjectiveTransform, size: tuple[int, int]) -> np.ndarray:
    return warp(page, move.inverse, output_shape=size[::-1], order=1, mode="constant", cval=0)
