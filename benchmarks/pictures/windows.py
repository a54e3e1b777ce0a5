"""Pictures that show a part of a shape whose true code is known: cuts and zooms.

A cut is a picture of the textbook set, or of a fractal of the random suite, with 10 to 40% of its lit pixels left out
on one side or on two. A zoom is a drawing of a code that is two or four times closer, around a random point of its
attractor. A name gives the same picture every time.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from fractal_exp import codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS, View
from fractal_exp.images.reading import ReadImage
from fractal_exp.rendering.still import render

from . import judging, textbook
from .drawing import Similarity

SIDE, SUPERSAMPLE = 640, 8       # pixels of a drawing of a code, and subpixels along each
INK = 64                         # levels of 255 by which a lit pixel differs from the paper
OUTSIDE = 0.1, 0.4               # share of the lit pixels that a cut leaves out
MOST_OFF = 0.3                   # distance of a zoom's middle from the canvas', canvas units: no corner of the shape
FAMILIES = ("koch_curve", "gasket", "heighway", "carpet", "levy", "fern_dots", "spiral_dots", "gasket_dots",
            "tree_dots", "maple_leaf_dots")
CLASSICS = "sierpinski_triangle", "fern", "tree", "maple_leaf", "spiral"
FACTORS = 2, 4
DRAWN = [f"suite-{k:03d}" for k in range(10)]


@dataclass(frozen=True)
class Part:
    """A picture (H,W) or (H,W,3) uint8 of a part of a code's attractor, and what takes the code's coordinates to its
    pixels. kind: "cut", "zoom 2" or "zoom 4"."""

    pixels: np.ndarray
    code: IFS
    similarity: Similarity
    kind: str


@cache
def kinds() -> dict[str, str]:
    """"cut-gasket-6-black", "cut-suite-003", "zoom2-fern", "zoom4-suite-003", each with its kind."""
    deepest = {each.family: name for name, each in reversed(textbook.pictures().items())
               if each.deepest and not each.jpeg and each.family in FAMILIES}
    cuts = [f"cut-{name}" for name in (*sorted(deepest.values()), *DRAWN)]
    zooms = {f"zoom{factor}-{name}": f"zoom {factor}" for factor in FACTORS for name in (*CLASSICS, *DRAWN[:5])}
    return dict.fromkeys(cuts, "cut") | zooms


@cache
def part(name: str) -> Part:
    """The picture of this name."""
    kind, rng = kinds()[name], np.random.default_rng(zlib.crc32(name.encode()))
    shown = name.partition("-")[2]
    if kind != "cut":
        return _zoom(_code(shown), int(kind.removeprefix("zoom ")), rng)
    if shown in DRAWN:
        return _cut(*_drawing(_code(shown), View()), rng)
    drawn = textbook.pictures()[shown].draw()
    assert drawn.truth.code is not None
    return _cut(drawn.pixels, drawn.truth.code, drawn.similarity, rng)


def _code(name: str) -> IFS:
    """A code in its frame on the canvas."""
    if name not in DRAWN:
        return attractor.normalize(codes.known(name))
    return attractor.normalize(suite.random_suite(len(DRAWN), suite.SUITE_SEED)[DRAWN.index(name)])


def _drawing(code: IFS, view: View) -> tuple[np.ndarray, IFS, Similarity]:
    pixels = (255 * render(code, view, resolution=SIDE, supersample=SUPERSAMPLE)).round().byte().numpy()
    scale, (x, y) = view.zoom * SIDE / 2, view.center
    return pixels, code, Similarity(scale, SIDE / 2 - scale * x, SIDE / 2 + scale * y)


def _cut(pixels: np.ndarray, code: IFS, similarity: Similarity, rng: np.random.Generator) -> Part:
    """A picture without a share of its lit pixels on one side, or in equal parts on two neighbouring sides."""
    paper = pixels[0, 0].astype(int)
    lit = np.abs(pixels.astype(int) - paper).reshape(*pixels.shape[:2], -1).max(-1) > INK
    share, upright = rng.uniform(*OUTSIDE), [rng.random() < 0.5]
    upright += [not upright[0]] if rng.random() < 0.5 else []
    left_out = share * lit.sum() / len(upright)
    for is_upright in upright:
        along = np.cumsum(lit.sum(0 if is_upright else 1))
        is_first = rng.random() < 0.5
        at = int(np.searchsorted(along, left_out if is_first else along[-1] - left_out))
        kept = slice(at, None) if is_first else slice(None, at)
        pixels, lit = (each[:, kept] if is_upright else each[kept] for each in (pixels, lit))
        if is_first:
            similarity = replace(similarity, x=similarity.x - at * is_upright, y=similarity.y - at * (not is_upright))
    return Part(np.ascontiguousarray(pixels), code, similarity, "cut")


def _zoom(code: IFS, factor: int, rng: np.random.Generator) -> Part:
    """A view of a code in which the longer side of its box would be `factor` times as long as the picture."""
    lit = judging.drawing(code).nonzero()
    middles = np.stack([2 * (lit[1] + 0.5) / judging.RESOLUTION - 1, 1 - 2 * (lit[0] + 0.5) / judging.RESOLUTION], 1)
    middles = middles[np.abs(middles).max(1) < MOST_OFF]
    x, y = middles[rng.integers(len(middles))].tolist()
    return Part(*_drawing(code, View((x, y), 2 * factor / attractor.FRAME_SIDE)), f"zoom {factor}")


def truth(name: str, read: ReadImage) -> IFS:
    """The true code of a picture, on the canvas on which it was read."""
    found = part(name)
    return found.code.similar(*found.similarity.onto(read.placement))


def in_frame_of(code: IFS, true: IFS) -> tuple[IFS, IFS]:
    """Two codes of one canvas, moved alike so that the second one is in its frame."""
    x0, y0, x1, y1 = (float(side) for side in attractor.visible_box(true))
    scale = attractor.FRAME_SIDE / max(x1 - x0, y1 - y0)
    shift = -scale * (x0 + x1) / 2, -scale * (y0 + y1) / 2
    return code.similar(scale, shift), true.similar(scale, shift)


def score(name: str, code: IFS, read: ReadImage) -> dict[str, float | bool | str]:
    """f1_known: F1 within a pixel in what the picture shows; f1_truth: the same of the whole attractors, in the frame
    of the true one; told: whether the picture was read as a part; others: see `judging.against_code`."""
    true, side = truth(name, read), read.image.shape[-1]
    shown = np.ones((side, side), bool) if read.known is None else read.known.mask(side).numpy()
    known = judging.f1_within_a_pixel(*(judging.drawing(each, side) & shown for each in (code, true)))
    likeness = judging.f1_within_a_pixel(*(judging.drawing(each, side) for each in in_frame_of(code, true)))
    return {"kind": kinds()[name], "told": read.known is not None, "f1_known": known, "f1_truth": likeness,
            "true_maps": len(true), **judging.against_code(code, true, likeness, side)}
