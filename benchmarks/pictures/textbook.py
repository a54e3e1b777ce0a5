"""Textbook fractals whose true codes are known: steps of their construction, and scatter plots of the chaos game.

The constructions are the twelve of FractalBench (arXiv 2511.06522), at growing depths and in five colours; the scatter
plots have 60 000 dots and textbook probabilities. Each family of pictures is for tuning or only for reporting: see
`TUNING` and `REPORTING`. The same name and seed give the same picture; the seed moves the fractal on the page, changes
its size, and draws the dots. The set `textbook_redrawn` has the pictures of a second seed.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import torch

from fractal_exp import codes
from fractal_exp.ifs.code import IFS
from fractal_exp.images.placement import Placement

from .drawing import DRAW, Page, Similarity, by_matplotlib, jpeg_file, page
from .figures import FIGURES, Truth

COLOURS = ("black", "green", "blue", "red", "orange")  # white on black comes besides
DOTS, SKIPPED = 60_000, 20   # of the chaos game; the first ones are not drawn
FEW_DOTS = 20_000            # of the triangle of the chaos game


@dataclass(frozen=True)
class Drawn:
    """A picture (H,W,3) uint8 as a file would give it, what it shows, in the fractal's coordinates, and what takes
    these to its pixels."""

    pixels: np.ndarray
    truth: Truth
    similarity: Similarity

    def truth_on(self, placement: Placement) -> Truth:
        """The truth on the canvas on which the picture has this placement."""
        return self.truth.similar(*self.similarity.onto(placement))


@dataclass(frozen=True)
class Textbook:
    """A picture by name. depth: of the construction, None for a scatter plot; tool: what draws it."""

    name: str
    family: str
    depth: int | None
    ink: str
    tool: str
    jpeg: bool = False

    @property
    def role(self) -> str:
        """"tuning" or "reporting"."""
        return "tuning" if self.family in TUNING else "reporting"

    @property
    def deepest(self) -> bool:
        """Whether no picture of the family is deeper."""
        return self.depth is None or self.depth == FIGURES[self.family].depths[-1]

    def draw(self, seed: int = 0) -> Drawn:
        """The picture, before it is saved as JPEG."""
        rng = np.random.default_rng([zlib.crc32(self.name.removesuffix("-jpeg").encode()), seed])
        return _dots(self, rng) if self.depth is None else _strokes(self, rng)

    def source(self, seed: int = 0) -> np.ndarray | Path:
        """What `invert` is given: the pixels, or the file of a JPEG, so that the reader knows that pixels have errors.
        """
        pixels = self.draw(seed).pixels
        return jpeg_file(pixels, f"{self.name}-{seed}") if self.jpeg else pixels


@dataclass(frozen=True)
class Plot:
    """A scatter plot: a code with its probabilities, the ink, and the number of dots."""

    code: Callable[[], IFS]
    ink: str
    dots: int = DOTS


def _dragon() -> IFS:
    """The dragon of FRACTINT (fractint.ifs, Stone Soup Group)."""
    return IFS(torch.tensor([[[.824074, .281482], [-.212346, .864198]], [[.088272, .520988], [-.463889, -.377778]]]),
               torch.tensor([[-1.882290, -.110607], [.785360, 8.095795]]), torch.tensor([.787473, .212527]))


PLOTS = {
    "fern_dots": Plot(lambda: codes.known("fern"), "green"),
    "spiral_dots": Plot(lambda: codes.known("spiral"), "blue"),
    "gasket_dots": Plot(lambda: replace(codes.known("sierpinski_triangle"), probabilities=torch.full((3,), 1 / 3)),
                        "black", FEW_DOTS),
    "tree_dots": Plot(lambda: codes.known("tree"), "black"),
    "maple_leaf_dots": Plot(lambda: codes.known("maple_leaf"), "red"),
    "dragon_dots": Plot(_dragon, "blue"),
    "cyclosorus_dots": Plot(lambda: codes.known("cyclosorus"), "green"),
    "culcita_dots": Plot(lambda: codes.known("culcita"), "orange"),
}
TUNING = ("cantor_dust", "koch_curve", "koch_filled", "gasket", "heighway", "binary_tree_thinning", "fern_dots",
          "spiral_dots", "gasket_dots", "tree_dots")
REPORTING = ("cantor_set", "koch_outline", "carpet", "pentagon", "levy", "pentigree", "pythagoras", "binary_tree",
             "maple_leaf_dots", "dragon_dots", "cyclosorus_dots", "culcita_dots")


@cache
def pictures() -> dict[str, Textbook]:
    """All pictures of the set by name: "koch_curve-6-blue", "fern_dots-green-jpeg"."""
    every = [*(picture for k, family in enumerate(FIGURES) for picture in _of_figure(family, k)),
             *(picture for family, plot in PLOTS.items() for picture in _with_jpeg(
                 Textbook(f"{family}-{plot.ink}", family, None, plot.ink, "matplotlib")))]
    return {picture.name: picture for picture in every}


def _of_figure(family: str, start: int) -> list[Textbook]:
    """Each depth in another colour; the deepest in the colours that are left, as JPEG, and in white on black.

    Pillow and matplotlib draw in turn.
    """
    *shallow, deepest = FIGURES[family].depths
    inks = COLOURS[start % 5:] + COLOURS[:start % 5]
    steps = [*zip(shallow, inks, strict=False), *((deepest, ink) for ink in (*inks[len(shallow):], "white"))]
    plain = [Textbook(f"{family}-{depth}-{ink}", family, depth, ink, list(DRAW)[(start + k) % 2])
             for k, (depth, ink) in enumerate(steps)]
    first = len(shallow)
    return [*plain[:first], *_with_jpeg(plain[first]), *plain[first + 1:]]


def _with_jpeg(picture: Textbook) -> list[Textbook]:
    return [picture, replace(picture, name=f"{picture.name}-jpeg", jpeg=True)]


def _strokes(picture: Textbook, rng: np.random.Generator) -> Drawn:
    figure = FIGURES[picture.family]
    strokes = figure.strokes(picture.depth or 0)
    on: Page = page(rng, strokes.points, picture.ink)
    pixels = DRAW[picture.tool](on, strokes.polygons, strokes.lines, strokes.widths)
    return Drawn(pixels, figure.truth(), on.similarity)


def _dots(picture: Textbook, rng: np.random.Generator) -> Drawn:
    plot = PLOTS[picture.family]
    code = plot.code()
    dots = chaos_game(code, plot.dots, rng)
    on = page(rng, dots, picture.ink)
    return Drawn(by_matplotlib(on, dots=dots), Truth((code,)), on.similarity)


def chaos_game(code: IFS, count: int, rng: np.random.Generator) -> np.ndarray:
    """One orbit (count,2) under maps drawn by the code's probabilities, as every textbook's loop runs it."""
    maps = torch.cat([code.linear.reshape(-1, 4), code.offset], 1).double().tolist()
    chances = code.sampling_probabilities().double().numpy()
    x = y = 0.0
    dots = []
    for k in rng.choice(len(maps), count + SKIPPED, p=chances / chances.sum()).tolist():
        a, b, c, d, e, f = maps[k]
        x, y = a * x + b * y + e, c * x + d * y + f
        dots.append((x, y))
    return np.array(dots[SKIPPED:])
