"""SVG: the parallelograms of the maps over the shape, to look at and to print."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape

import numpy as np

from ..ifs.code import IFS, View
from ..ifs.formats.base import CodeFormat, only_one, plain
from ..ifs.formats.colours import place, ramp

PIXELS = 768     # per side of the shape's image
MARGIN = 1.1     # factor on a window that is larger than the canvas
CORNERS = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])


class Svg(CodeFormat):
    """A drawing: the attractor in grey, its box, and the image of the box under each map, a parallelogram.

    A dot marks the image of the box's lower left corner, and a thick side the image of its lower side, so that
    rotations and flips can be seen. The title of each map gives its number and probability. x points right and y up;
    the window is the canvas [-1,1]² if everything fits. The file cannot be read back, so keep the JSON file.
    """

    key, suffixes = "svg", (".svg",)

    def write(self, codes: Sequence[IFS]) -> bytes:
        from .sheets import silhouette  # imports numba, which reading does not need

        code = only_one(codes, self.key).check_contractive()
        box = _box_corners(code)
        linear, offset = code.linear.cpu().double().numpy(), code.offset.cpu().double().numpy()
        images = np.einsum("nij,kj->nki", linear, box) + offset[:, None]
        view = _window(np.vstack([box[None], images]))
        picture = base64.b64encode(silhouette(code, view, PIXELS)).decode()
        (x, y), half = view.center, 1 / view.zoom
        box_of_view = " ".join(f"{number:.9g}" for number in (x - half, -y - half, 2 * half, 2 * half))
        title = escape(plain(code.meta.get("title")) or plain(code.meta.get("name")) or repr(code))
        lines = [
            '<?xml version="1.0" encoding="UTF-8"?>',
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box_of_view}" width="768" height="768">',
            f"<title>{title}</title>",
            f'<rect x="{x - half:.9g}" y="{-y - half:.9g}" width="100%" height="100%" fill="#fff"/>',
            f'<image x="{x - half:.9g}" y="{-y - half:.9g}" width="{2 * half:.9g}" height="{2 * half:.9g}" '
            f'href="data:image/png;base64,{picture}"/>',
            f'<g stroke-linejoin="round" stroke-width="{half / 160:.6g}">',
            f'<polygon points="{_points(box)}" fill="none" stroke="#555" stroke-dasharray="{half / 40:.6g}"/>',
            *(_parallelogram(i, corners, code, half) for i, corners in enumerate(images)),
            "</g>", "</svg>", ""]
        return "\n".join(lines).encode()


def _box_corners(code: IFS) -> np.ndarray:
    from ..ifs import attractor

    x0, y0, x1, y1 = attractor.visible_box(code)
    return np.array([x0, y0]) + CORNERS * np.array([x1 - x0, y1 - y0])


def _window(polygons: np.ndarray) -> View:
    """The canvas, or a square around all polygons (N,4,2)."""
    low, high = polygons.min((0, 1)), polygons.max((0, 1))
    if max(abs(low).max(), abs(high).max()) <= 1:
        return View()
    x, y = (low + high) / 2
    return View((float(x), float(y)), 2 / (MARGIN * float((high - low).max())))


def _parallelogram(index: int, corners: np.ndarray, code: IFS, half: float) -> str:
    colour = "#" + bytes(ramp(np.array(place(index, len(code))))).hex()
    chance = float(code.sampling_probabilities()[index])
    first, second = corners[0], corners[1]
    return (f'<g stroke="{colour}" fill="{colour}"><title>map {index + 1}: probability {chance:.4g}</title>'
            f'<polygon points="{_points(corners)}" fill-opacity="0.15"/>'
            f'<polyline points="{_points(np.stack([first, second]))}" stroke-width="{half / 80:.6g}"/>'
            f'<circle cx="{first[0]:.9g}" cy="{0.0 - first[1]:.9g}" r="{half / 60:.6g}"/></g>')


def _points(corners: np.ndarray) -> str:
    """SVG's y points down."""
    return " ".join(f"{x:.9g},{0.0 - y:.9g}" for x, y in corners)
