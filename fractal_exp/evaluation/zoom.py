"""The camera of an endless zoom: a point of the attractor, and the views on the way to it."""

from __future__ import annotations

import math

import numpy as np
import torch

from .. import attractor
from ..errors import InputError
from ..ifs import IFS, View
from ..seeds import derive
from .render import MAX_ZOOM, render_with_info

LOOK, LOOK_POINTS = 64, 20_000  # pixels and points of a look about
CANDIDATES, DEPTHS = 16, 4  # points that are tried for a film, and views of each
EASE = 0.15           # of the time is spent on gathering speed, and as much on braking
CENTERED = 0.4        # of the time after which the target is in the middle of the picture


def rich_point(code: IFS, seed: int = 0, *, end_zoom: float = 1e4) -> tuple[float, float]:
    """A point (x, y) of the attractor with much to see around it on the way to `end_zoom`: of `CANDIDATES` random
    points the one whose dullest of `DEPTHS` views, evenly spread over the zoom's logarithm, is the richest.

    Random points lie where the invariant measure is, so often in an evenly filled region or on a lone line. A view is
    rich where about a third of it is lit and where much of that is edge. The same seed gives the same point; it takes
    `CANDIDATES` times `DEPTHS` drawings of 64². Raises `InputError` if the code is not contractive.
    """
    points = [attractor.random_point(code, derive(seed, "target", number)) for number in range(CANDIDATES)]
    zooms = np.geomspace(2, max(end_zoom, 2), DEPTHS)
    return max(points, key=lambda point: min(_richness(code, View(point, float(zoom))) for zoom in zooms))


def _richness(code: IFS, view: View) -> float:
    """From 0 for a view that is empty or full to about 1: entropy of the lit share times density of edges, both of
    the view and of its middle, where the film stays the longest."""
    image, info = render_with_info(code, view, resolution=LOOK, points_in_view=LOOK_POINTS, supersample=1)
    quarter = LOOK // 4
    parts = (image, image[quarter:-quarter, quarter:-quarter])
    return 0.0 if info.empty else min(_detail(part > 0) for part in parts)


def _detail(lit: torch.Tensor) -> float:
    share = float(lit.float().mean())
    if share in (0.0, 1.0):
        return 0.0
    edges = float((lit[1:] != lit[:-1]).float().mean() + (lit[:, 1:] != lit[:, :-1]).float().mean())
    entropy = -(share * math.log2(share) + (1 - share) * math.log2(1 - share))
    return entropy * edges


def nearest_point(code: IFS, to: tuple[float, float]) -> tuple[float, float]:
    """The point (x, y) of the attractor nearest to `to`, found by looking: a small picture of the whole, then of a few
    pixels about the lit one that is nearest, and so on down to 1e-12 of the canvas.

    Nearest up to a pixel of each picture. Raises `InputError` if the code is not contractive.
    """
    middle, radius = attractor.bounding_disc(code)
    center, zoom = to, 1 / (math.dist(middle, to) + max(radius, 1e-6))
    while zoom < MAX_ZOOM:
        image, info = render_with_info(code, View(center, zoom), resolution=LOOK, points_in_view=LOOK_POINTS,
                                       supersample=1)
        if info.empty:
            break
        row, column = (axis.double() for axis in image.nonzero(as_tuple=True))
        x = center[0] + ((2 * column + 1) / LOOK - 1) / zoom
        y = center[1] + (1 - (2 * row + 1) / LOOK) / zoom
        nearest = int(torch.hypot(x - to[0], y - to[1]).argmin())
        center, zoom = (float(x[nearest]), float(y[nearest])), zoom * LOOK / 4
    return center


def zoom_path(target: tuple[float, float], frames: int, *, start: View | None = None, end_zoom: float = 1e6
              ) -> list[View]:
    """The views of a zoom into `target` (x, y), from `start` (default: the whole canvas) to `end_zoom`.

    The zoom grows exponentially, at a rate that rises at the beginning and falls at the end; meanwhile the target
    glides to the middle of the picture and stays there. Raises `InputError` unless frames >= 2 and the end zoom is
    above the start's and at most 1e12.
    """
    start = start or View()
    if frames < 2:
        raise InputError(f"a zoom needs at least 2 frames, got {frames}")
    if not start.zoom < end_zoom <= MAX_ZOOM:
        raise InputError(f"the zoom must end above the start's {start.zoom:g} and at most at {MAX_ZOOM:g}, got "
                         f"{end_zoom:g}")
    on_screen = [(t - c) * start.zoom for t, c in zip(target, start.center, strict=True)]
    views = []
    for t in np.linspace(0, 1, frames):
        zoom = start.zoom * math.exp(math.log(end_zoom / start.zoom) * _eased(t))
        gone = min(1.0, t / CENTERED)
        left = 1 - gone * gone * (3 - 2 * gone)
        views.append(View((target[0] - on_screen[0] * left / zoom, target[1] - on_screen[1] * left / zoom), zoom))
    return views


def _eased(t: float) -> float:
    """The way made after the time t, both in [0,1]: constant acceleration, constant speed, constant braking."""
    if t > 0.5:
        return 1 - _eased(1 - t)
    speed = 1 / (1 - EASE)
    return speed * (t * t / (2 * EASE) if t < EASE else t - EASE / 2)
