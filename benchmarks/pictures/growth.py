"""Shapes that grow by chance: drawn by Pillow, or pixel by pixel, from a seed. White on black, (SIDE,SIDE) uint8."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

SIDE = 800
Point = tuple[float, float]
CLUSTER_SIDE, CLUSTER_GRAINS = 240, 3600
JULIA, JULIA_STEPS = complex(-0.8, 0.156), 300


@dataclass(frozen=True)
class Branching:
    """A plant in the manner of a recursive program.

    angles: of the branches against their parent, in degrees; ratio: of their lengths; shrink: of their widths;
    jitter: relative, of lengths, and in degrees times 60 of angles; bends: segments of a branch, each turned by up to
    `bend` degrees; levels: of branching; lean: degrees by which the trunk leans.
    """

    angles: tuple[float, ...]
    ratio: float = 0.7
    width: float = 12
    shrink: float = 0.7
    jitter: float = 0.15
    bends: int = 1
    bend: float = 0
    levels: int = 9
    length: float = 150
    start: Point = (SIDE / 2, SIDE - 40)
    lean: float = 0

    def __call__(self, rng: np.random.Generator) -> np.ndarray:
        """The plant, a picture (SIDE,SIDE) uint8."""
        picture = Image.new("L", (SIDE, SIDE))
        pen = ImageDraw.Draw(picture)
        tips = [(self.start, 90.0 + self.lean, self.length, self.width, 0)]
        while tips:
            at, heading, length, width, level = tips.pop()
            for _ in range(self.bends):
                heading += rng.uniform(-self.bend, self.bend)
                at = _stroke(pen, at, heading, length / self.bends, width)
            if level < self.levels:
                tips += [(at, heading + angle + 60 * self.jitter * rng.uniform(-1, 1),
                          length * self.ratio * (1 + self.jitter * rng.uniform(-1, 1)),
                          max(1.5, width * self.shrink), level + 1) for angle in self.angles]
        return np.asarray(picture)


def _stroke(pen: ImageDraw.ImageDraw, at: Point, heading: float, length: float, width: float) -> Point:
    """Draw a segment with round ends; return its end."""
    end = at[0] + length * math.cos(math.radians(heading)), at[1] - length * math.sin(math.radians(heading))
    pen.line([at, end], fill=255, width=max(1, round(width)))
    if width > 3:
        for x, y in (at, end):
            pen.ellipse((x - width / 2, y - width / 2, x + width / 2, y + width / 2), fill=255)
    return end


def compound_leaf(rng: np.random.Generator, pairs: int = 10, depth: int = 2) -> np.ndarray:
    """A pinnate leaf whose leaflets are such leaves themselves, down to small ellipses."""
    picture = Image.new("L", (SIDE, SIDE))
    pen = ImageDraw.Draw(picture)

    def leaf(at: Point, heading: float, length: float, depth: int) -> None:
        if depth == 0:
            _blade(pen, at, heading, length)
            return
        step = length / pairs
        for k in range(pairs):
            at = _stroke(pen, at, heading + 2 * rng.uniform(-1, 1), step, max(1.5, length / 130))
            size = length * 0.42 * math.sin(math.pi * (k + 2) / (pairs + 2)) ** 0.8 * rng.uniform(0.92, 1.08)
            for side in (-1, 1):
                leaf(at, heading + side * (58 - 1.5 * k), size if depth > 1 else 0.5 * size, depth - 1)
        leaf(at, heading, length * 0.12, 0)

    leaf((SIDE / 2, SIDE - 40), 90, 660, depth)
    return np.asarray(picture)


def _blade(pen: ImageDraw.ImageDraw, at: Point, heading: float, length: float) -> None:
    """A lens-shaped blade from `at`."""
    t = np.linspace(0, 1, 12)
    along, across = length * np.concatenate([t, t[::-1]]), 0.14 * length * np.sin(math.pi * np.concatenate([t, -t]))
    c, s = math.cos(math.radians(heading)), math.sin(math.radians(heading))
    pen.polygon([(at[0] + c * u - s * v, at[1] - s * u - c * v) for u, v in zip(along, across, strict=True)], fill=255)


def lobed_leaf(rng: np.random.Generator) -> np.ndarray:
    """An oak's leaf: a blade whose half width swells and shrinks along a midrib, with a stalk."""
    t = np.linspace(0, 1, 200)
    lobes = 1 + 0.35 * np.sin(2 * math.pi * 5 * t + rng.uniform(-0.4, 0.4)) + 0.06 * np.sin(2 * math.pi * 17 * t)
    halves = [170 * np.sin(math.pi * t**0.8) ** 0.8 * lobes * rng.uniform(0.9, 1.1) for _ in range(2)]
    middle = SIDE / 2 + 25 * np.sin(2 * math.pi * t * rng.uniform(0.4, 0.6))
    y = SIDE - 130 - 600 * t
    picture = Image.new("L", (SIDE, SIDE))
    pen = ImageDraw.Draw(picture)
    edge = np.concatenate([np.stack([middle - halves[0], y], 1), np.stack([middle + halves[1], y], 1)[::-1]])
    pen.polygon([tuple(corner) for corner in edge.tolist()], fill=255)
    pen.line([(middle[0], y[0] - 20), (middle[0] - 12, SIDE - 30)], fill=255, width=9)
    return np.asarray(picture)


def lightning(rng: np.random.Generator) -> np.ndarray:
    """A bolt by midpoint displacement, with side strokes that are bolts themselves."""
    picture = Image.new("L", (SIDE, SIDE))
    pen = ImageDraw.Draw(picture)

    def bolt(start: np.ndarray, end: np.ndarray, width: float, depth: int) -> None:
        path = np.stack([start, end])
        for k in range(7):
            spread = 0.09 * np.linalg.norm(end - start) / 2**k
            middle = (path[1:] + path[:-1]) / 2 + rng.normal(0, spread, (len(path) - 1, 2))
            path = np.insert(path, np.arange(1, len(path)), middle, axis=0)
        pen.line([tuple(each) for each in path.tolist()], fill=255, width=max(1, round(width)), joint="curve")
        for k in rng.choice(len(path) * 4 // 5, 6, replace=False) if depth else []:
            ahead = (end - path[k]) * rng.uniform(0.3, 0.6)
            angle = rng.choice([-1, 1]) * rng.uniform(0.35, 0.8)
            turned = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]]) @ ahead
            bolt(path[k], path[k] + turned, width * 0.6, depth - 1)

    bolt(np.array([SIDE * 0.45, 30.0]), np.array([SIDE * 0.55, SIDE - 30.0]), 6, 3)
    return np.asarray(picture)


def diffusion_limited_cluster(rng: np.random.Generator) -> np.ndarray:
    """A cluster of grains that walked at random until they touched it (Witten and Sander 1981)."""
    side = CLUSTER_SIDE
    grid, centre, reach = np.zeros((side, side), bool), side // 2, 2.0
    near = np.zeros((side, side), bool)          # pixels beside the cluster
    steps = np.array([[0, 1], [0, -1], [1, 0], [-1, 0]])

    def stick(r: int, c: int) -> float:
        grid[r, c] = True
        near[r - 1:r + 2, c] = near[r, c - 1:c + 2] = True
        return math.hypot(r - centre, c - centre)

    stick(centre, centre)
    walkers, placed = np.zeros((0, 2), int), 1
    while placed < CLUSTER_GRAINS and reach < centre - 8:
        if len(walkers) < 400:
            angle = rng.uniform(0, 2 * math.pi, 400 - len(walkers))
            born = centre + (reach + 3) * np.stack([np.sin(angle), np.cos(angle)], 1)
            walkers = np.concatenate([walkers, np.rint(born).astype(int)])
        walkers = walkers + steps[rng.integers(0, 4, len(walkers))]
        far = np.hypot(*(walkers - centre).T) > min(1.5 * reach + 8, centre - 2)
        walkers = walkers[~far]
        touching = near[walkers[:, 0], walkers[:, 1]]
        for r, c in walkers[touching].tolist():
            if not grid[r, c]:
                reach, placed = max(reach, stick(r, c)), placed + 1
        walkers = walkers[~touching]
    return np.kron(grid, np.full((3, 3), 255, np.uint8))


def julia_boundary(rng: np.random.Generator) -> np.ndarray:
    """The boundary of a filled Julia set of z² + c, a line of about two pixels; c by the seed, near -0.8 + 0.156i."""
    from scipy import ndimage

    c = JULIA + complex(*rng.uniform(-0.004, 0.004, 2))
    x, y = np.meshgrid(np.linspace(-1.7, 1.7, SIDE), np.linspace(1.7, -1.7, SIDE))
    z, inside = x + 1j * y, np.ones((SIDE, SIDE), bool)
    for _ in range(JULIA_STEPS // 4):
        z[inside] = z[inside] ** 2 + c
        inside &= np.abs(z) < 4
    thin = inside ^ ndimage.binary_erosion(inside)
    return (ndimage.binary_dilation(thin) * 255).astype(np.uint8)


def river(rng: np.random.Generator) -> np.ndarray:
    """A river system: the drainage of a rough valley."""
    from .terrain import drainage

    side = 200
    rough = sum(2.0 ** -k * _waves(rng, side, 3 * 2**k) for k in range(5))
    valley = np.abs(np.linspace(-1, 1, side))
    height = np.linspace(7, 0, side)[:, None] + 3 * valley + 0.9 * np.asarray(rough)
    streams = drainage(height, least=90)
    return np.kron(streams, np.full((SIDE // side,) * 2, 255, np.uint8))


def _waves(rng: np.random.Generator, side: int, cells: int) -> np.ndarray:
    """Smooth noise (side,side) with about `cells` hills along a side."""
    from scipy import ndimage

    return ndimage.zoom(rng.normal(0, 1, (cells + 1, cells + 1)), side / (cells + 1), order=3)[:side, :side]


GROWTH: dict[str, Callable[[np.random.Generator], np.ndarray]] = {
    "winter_tree": Branching((-24, 22), 0.78, 22, 0.72, 0.2, levels=9, length=150),
    "bush": Branching((-32, -4, 27), 0.66, 12, 0.68, 0.2, bends=3, bend=7, levels=6, length=190),
    "coral": Branching((-30, 28), 0.83, 26, 0.86, 0.25, bends=2, bend=10, levels=7, length=110),
    "root": Branching((-38, 6, 40), 0.64, 10, 0.7, 0.35, bends=5, bend=16, levels=5, length=210, start=(SIDE / 2, 40),
                      lean=180),
    "compound_leaf": compound_leaf,
    "lobed_leaf": lobed_leaf,
    "lightning": lightning,
    "diffusion_limited_cluster": diffusion_limited_cluster,
    "julia_boundary": julia_boundary,
    "river": river,
}
