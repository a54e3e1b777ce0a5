"""The camera of an endless zoom: a target point on the attractor, and the views on the way to it."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch.nn.functional import avg_pool2d, max_pool2d

from ..errors import InputError
from ..ifs import attractor
from ..ifs.code import IFS, View
from ..ifs.contraction import AVERAGE
from ..ops.histogram import AddressTree, planes
from ..ops.histogram.boxes import lit_share
from ..ops.histogram.cpu import LIT
from ..runtime.seeds import derive
from .still import MAX_ZOOM, render_with_info
from .weighing import address_tree, weighed, window_of

LOOK, LOOK_POINTS = 64, 20_000  # pixels per side and points of a preview
EFFORT = 0.03         # of a still's work, for a preview: a fraction of a second
CANDIDATES, DEPTHS = 4, 12  # candidate points of each kind for a film, and views of each candidate
EYES, WORDS = 48, 2000     # eyes of spirals that are looked at, and the number of words that are searched for them
NEAR = 0.5                 # share of the best candidate's richness with which another may be taken
CLOSER = 4            # from one look to the next, on the way to a film's target
EASE = 0.15           # share of the time for acceleration, and the same for braking
CENTERED = 0.4        # share of the time after which the target is in the middle of the picture


def rich_point(code: IFS, seed: int = 0, *, end_zoom: float = 1e4) -> tuple[float, float]:
    """A point (x, y) of the attractor with much to see around it at every zoom up to `end_zoom`.

    A random point often lies in an evenly filled region. Where maps flatten, almost all deep views show parallel lines.
    Candidates are a few random points, as many points about which half of each view is lit, and three times as many
    eyes of spirals, around which a view comes back at ever smaller scales. Each has twelve views, evenly spaced in the
    logarithm of the zoom, and counts as much as its dullest. One is drawn by the seed from those that come near the
    best; if all are dull somewhere, from those that are so last. The same seed gives the same point. It takes up to
    three hundred and fifty drawings of 64²; a candidate gets no more of them once it is too dull to be taken.

    Raises `InputError` if the code is not contractive.
    """
    tree = address_tree(code)
    points = [find(code, tree, derive(seed, "target", number), end_zoom) for number in range(CANDIDATES)
              for find in (_half_lit_point, lambda code, _, seed, __: attractor.random_point(code, seed))]
    zooms = [float(zoom) for zoom in np.geomspace(2, max(end_zoom, 2), DEPTHS)]
    points += _eyes(code, tree, zooms[DEPTHS // (6 if code.contraction.kind == AVERAGE else 2)])
    rich, best, farthest = list[tuple[float, int]](), 0.0, 0
    for point in points:
        least, seen = math.inf, 0
        for zoom in zooms:
            least = min(least, _richness(_look(tree, point, zoom)))
            if least == 0 or least < NEAR * best:
                break
            seen += 1
        rich.append((least, seen))
        best, farthest = max(best, least), max(farthest, seen)
    near = [point for point, (least, seen) in zip(points, rich, strict=True)
            if least >= NEAR * best and (best > 0 or seen == farthest)]
    return near[int(np.random.default_rng(derive(seed, "of the best")).integers(len(near)))]


def _eyes(code: IFS, tree: AddressTree, zoom: float) -> list[tuple[float, float]]:
    """The fixed points (x, y) of words of maps that turn and are much like a similarity, at most 3 `CANDIDATES`.

    About such a point the attractor is a spiral that never flattens. Of `EYES` of them, those with the richest views at
    this zoom are taken, because many lie where all is filled. Where a code contracts on average only, most words meet a
    deep view, so the zoom is to be a small one.
    """
    chosen = code.sampling_probabilities() > 0
    linear, offset = (values[chosen].cpu().double().numpy() for values in (code.linear, code.offset))
    matrices, shifts = linear, offset
    found: list[tuple[float, float, float]] = []
    while True:
        trace, det = np.trace(matrices, axis1=1, axis2=2), np.linalg.det(matrices)
        turning = det - trace**2 / 4  # the square of the eigenvalues' imaginary part
        for k in np.nonzero((turning > 1e-12) & (det < 1))[0]:
            flatness = float(((matrices[k] - np.eye(2) * trace[k] / 2)**2).sum() / turning[k])  # 2 for a similarity
            x, y = np.linalg.solve(np.eye(2) - matrices[k], shifts[k]).tolist()
            found.append((round(flatness, 3), x, y))
        if len(matrices) * len(linear) > WORDS:
            break
        shifts = (np.einsum("nij,mj->nmi", linear, shifts) + offset[:, None]).reshape(-1, 2)
        matrices = np.einsum("nij,mjk->nmik", linear, matrices).reshape(-1, 2, 2)
    apart = {(round(x, 6), round(y, 6)): (x, y) for _, x, y in sorted(found, key=lambda eye: eye[0])}
    roundest = list(apart.values())[:EYES]
    return sorted(roundest, key=lambda eye: -_richness(_look(tree, eye, zoom)))[:3 * CANDIDATES]


def _look(tree: AddressTree, center: tuple[float, float], zoom: float) -> torch.Tensor:
    """The lit pixels of a small picture of a view; none where so many maps overlap that a film would take for ever."""
    window, lit = window_of(View(center, zoom), LOOK), np.zeros((LOOK, LOOK), np.float32)
    # Tails that nothing else is beside are no place for a film, so none are looked for.
    plan = weighed(tree, window, LOOK_POINTS, 0, EFFORT, 0.0, has_tails=False)
    if plan.thrown * plan.mass > LOOK_POINTS / 2:
        canvas = planes(LOOK, LOOK, LIT)
        tree.scatter(window, plan.thrown, seed=(0, 0, 0), canvas=canvas, mode=LIT)
        lit_share(canvas, 1, lit)
    return torch.from_numpy(lit > 0)


def _richness(lit: torch.Tensor) -> float:
    """The change of brightness along the direction of least change, times its share of the change along that of most:
    with the eigenvalues a >= b of the mean structure tensor (Förstner and Gülch 1987), b · b / a. It is 0 for a view
    that is empty or full, and small for one that shows parallel lines."""
    smooth = avg_pool2d(_without_noise(lit), 3, 1)[0]
    across, down = (smooth[1:, 1:] - smooth[1:, :-1]).flatten(), (smooth[1:, 1:] - smooth[:-1, 1:]).flatten()
    least, most = torch.linalg.eigvalsh(torch.stack([across, down]) @ torch.stack([across, down], 1)).tolist()
    return max(least, 0.0)**2 / most if most > 0 else 0.0


def _without_noise(lit: torch.Tensor) -> torch.Tensor:
    """The picture (1,R,R) with gaps of one pixel filled: they are noise of the points, not content."""
    return max_pool2d(lit.float()[None], 3, 1, 1)


def _half_lit_point(code: IFS, tree: AddressTree, seed: int, end_zoom: float) -> tuple[float, float]:
    """A point found by zooming in from the whole. In a small picture of each view, a lit pixel is judged by the window
    that the next view, `CLOSER` times closer, shows around it, and so on down to a 64th of the last view."""
    rng = np.random.default_rng(seed)
    (x, y), radius = attractor.bounding_disc(code)
    zoom, near = 1 / max(radius, 1e-6), 1.0
    while zoom < min(LOOK * end_zoom, MAX_ZOOM):
        lit = _look(tree, (x, y), zoom)
        if not lit.any():
            break
        row, column = _rich_pixel(lit, near, rng)
        x, y = x + ((2 * column + 1) / LOOK - 1) / zoom, y + (1 - (2 * row + 1) / LOOK) / zoom
        zoom, near = zoom * CLOSER, 0.5
    return float(x), float(y)


def _rich_pixel(lit: torch.Tensor, near: float, rng: np.random.Generator) -> tuple[int, int]:
    """A random lit pixel from the middle part `near` of a picture (R,R), among the tenth around which the lit share is
    closest to 1/2."""
    share = avg_pool2d(_without_noise(lit), LOOK // CLOSER + 1, 1, LOOK // CLOSER // 2, count_include_pad=False)[0]
    place = (torch.arange(LOOK) - (LOOK - 1) / 2).abs() <= near * LOOK / 2
    candidates = (lit & place[:, None] & place).nonzero()
    if not len(candidates):
        candidates = lit.nonzero()
    richness = -(share[candidates[:, 0], candidates[:, 1]] - 0.5).abs()
    best = richness.argsort(descending=True, stable=True)[:max(1, len(candidates) // 10)]
    row, column = candidates[best[int(rng.integers(len(best)))]].tolist()
    return row, column


def nearest_point(code: IFS, to: tuple[float, float]) -> tuple[float, float]:
    """The point (x, y) of the attractor nearest to `to`, found in pictures: a small one of the whole, then one of a few
    pixels around the nearest lit pixel, and so on down to 1e-12 of the canvas.

    It is nearest to within a pixel of each picture. Raises `InputError` if the code is not contractive.
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

    The zoom grows exponentially, at a rate that rises at the beginning and falls at the end. The target glides to the
    middle of the picture and stays there. Raises `InputError` unless frames >= 2 and the end zoom is above the start
    zoom and at most 1e12.
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
    """The distance covered at time t, both in [0,1]: constant acceleration, constant speed, constant braking."""
    if t > 0.5:
        return 1 - _eased(1 - t)
    speed = 1 / (1 - EASE)
    return speed * (t * t / (2 * EASE) if t < EASE else t - EASE / 2)
