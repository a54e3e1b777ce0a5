"""Shapes that are no attractors, or of no known code: photographs, glyphs, maps, plants. Each with its licence.

Each is for tuning or only for reporting. Those that are drawn by chance are made anew by every seed; the others are
what they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from .growth import GROWTH
from .terrain import drainage

DEJAVU = "Bitstream Vera licence, changes in the public domain (DejaVu Sans, in matplotlib)"
OWN = "MIT, drawn by this project"
GLYPH_SIDE = 800
STREAM_CELLS = 500          # that a stream of the drainage drains at least
PETAL_LEVEL, PETAL_BLOCK = 0.6, 41


@dataclass(frozen=True)
class Shape:
    """A shape by name: how it is made from a seed, where it is from, and whether it is for tuning."""

    make: Callable[[int], np.ndarray]
    licence: str
    tuning: bool

    @property
    def role(self) -> str:
        """"tuning" or "reporting"."""
        return "tuning" if self.tuning else "reporting"


def _glyph(character: str, seed: int) -> np.ndarray:
    """Black on white, in matplotlib's DejaVu Sans: (H,W) uint8."""
    from matplotlib import font_manager

    font = ImageFont.truetype(font_manager.findfont("DejaVu Sans"), GLYPH_SIDE * 3 // 4)
    picture = Image.new("L", (GLYPH_SIDE, GLYPH_SIDE), 255)
    ImageDraw.Draw(picture).text((GLYPH_SIDE / 2, GLYPH_SIDE / 2), character, 0, font, anchor="mm")
    return np.asarray(picture)


def _grown(name: str, seed: int) -> np.ndarray:
    return GROWTH[name](np.random.default_rng([seed, *name.encode()]))


def _retina(seed: int) -> np.ndarray:
    from fractal_exp.images.samples import retina_vessels

    return np.rint(255 * retina_vessels(1024).numpy()).astype(np.uint8)


def _horse(seed: int) -> np.ndarray:
    from skimage import data

    return np.pad(np.where(data.horse(), 255, 0).astype(np.uint8), 8, constant_values=255)


def _flower(seed: int) -> np.ndarray:
    """The lit parts of the dahlia's petals: above their surroundings in the red channel."""
    from scipy import ndimage
    from skimage import filters, measure
    from sklearn.datasets import load_sample_image

    red = ndimage.gaussian_filter(load_sample_image("flower.jpg")[..., 0] / 255.0, 0.7)
    labels = measure.label(ndimage.binary_closing(red > PETAL_LEVEL, iterations=3))
    head = ndimage.binary_fill_holes(labels == np.bincount(labels[labels > 0]).argmax())
    return (255 * ((red > filters.threshold_local(red, PETAL_BLOCK)) & head)).astype(np.uint8)


def _drainage(seed: int) -> np.ndarray:
    """Streams of a digital elevation model of the Jacksboro fault, three pixels a cell."""
    from matplotlib import cbook

    height = cbook.get_sample_data("jacksboro_fault_dem.npz")["elevation"].astype(float)
    return np.kron(drainage(height, STREAM_CELLS), np.full((3, 3), 255, np.uint8))


def _coastline(seed: int) -> np.ndarray:
    """The line where land and sea meet, drawn smoothly at eight pixels a cell."""
    from matplotlib import cbook
    from scipy import ndimage

    height = cbook.get_sample_data("topobathy.npz")["topo"].astype(float)
    land = ndimage.gaussian_filter(ndimage.zoom(height, 8, order=1), 4) > 0
    line = ndimage.binary_dilation(land ^ ndimage.binary_erosion(land, border_value=1), iterations=1)
    return np.pad((255 * line).astype(np.uint8), 16)


def _from_dejavu(character: str, tuning: bool) -> Shape:
    return Shape(partial(_glyph, character), DEJAVU, tuning)


GLYPHS = {"snowflake": ("❄", True), "tight_snowflake": ("❅", False), "heavy_snowflake": ("❆", False),
          "shamrock": ("☘", True), "heart_mark": ("❣", True), "floral_heart": ("❦", False),
          "rotated_heart": ("❧", True), "blossom": ("⚘", False), "lily": ("⚜", False), "asterisk": ("✺", True)}
GROWN_FOR_TUNING = ("winter_tree", "compound_leaf", "lightning", "diffusion_limited_cluster", "julia_boundary")
TERRAIN = "matplotlib's licence (BSD-like; its sample data, from United States government surveys)"


@cache
def shapes() -> dict[str, Shape]:
    """All shapes by name."""
    return {
        "retina_vessels": Shape(_retina, "CC0 (Mikael Häggström, in scikit-image)", True),
        "horse": Shape(_horse, "CC0 (Andreas Preuss, in scikit-image)", True),
        "flower": Shape(_flower, "CC BY 2.0 (vultilion on Flickr, in scikit-learn)", False),
        "drainage": Shape(_drainage, TERRAIN, True),
        "coastline": Shape(_coastline, TERRAIN, False),
        **{name: _from_dejavu(*glyph) for name, glyph in GLYPHS.items()},
        **{name: Shape(partial(_grown, name), OWN, name in GROWN_FOR_TUNING) for name in GROWTH},
    }
