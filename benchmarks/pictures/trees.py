"""Trees and plants as recursions and L-systems draw them, each with its true code.

The drawings end after a few steps. A trunk is one or more segments in the complex plane, from 0 upwards; copies are
similarities z' = a z + b. Depth d is the d-th step: the trunk under all words of 0 to d copies. The plants are
node-rewriting ones of Prusinkiewicz and Lindenmayer (*The Algorithmic Beauty of Plants*, 1990) and variants of them.
Each tree is for tuning or only for reporting; the seed moves it on the page and changes its size. Random trees are for
reporting: nobody chose them, and nothing was chosen by them.
"""

from __future__ import annotations

import cmath
import math
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import torch

from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.images.reading import ReadImage

from . import judging
from .drawing import DRAW, INK, jpeg_file, page
from .figures import Truth, orbit, similarities
from .textbook import Drawn

Copies = Sequence[tuple[complex, complex]]      # (a, b) of each
Trunk = Sequence[tuple[complex, complex]]       # (start, end) of each segment

RANDOM_SEED, RANDOM_TREES = 1127, 16
MOST_TWIGS = 1100                               # of a random tree
JPEG_SHARE = 0.25                               # of random trees


@dataclass(frozen=True)
class Tree:
    """A drawing. width: of the pen, pixels; thinning: the factor on it at each step; tool: what draws it."""

    copies: Copies
    trunk: Trunk
    depth: int
    ink: str
    width: float = 2.0
    thinning: float = 1.0
    tool: str = "pillow"
    jpeg: bool = False
    tuning: bool = False

    @property
    def role(self) -> str:
        """"tuning" or "reporting"."""
        return "tuning" if self.tuning else "reporting"

    def steps(self) -> list[np.ndarray]:
        """The strokes (S,2,2) of each step, from their start to their end; the trunk is the first step."""
        return [np.concatenate(step) for step in zip(
            *(orbit(similarities(*self.copies), _points(*segment), self.depth) for segment in self.trunk), strict=True)]

    def draw(self, name: str, seed: int = 0) -> Drawn:
        """The picture, before it is saved as JPEG."""
        rng = np.random.default_rng([zlib.crc32(name.encode()), seed])
        steps = self.steps()
        widths = [np.full(len(step), max(1.0, self.width * self.thinning**k)) for k, step in enumerate(steps)]
        lines = np.concatenate(steps)
        on = page(rng, lines.reshape(-1, 2), self.ink)
        pixels = DRAW[self.tool](on, None, lines, np.concatenate(widths))
        return Drawn(pixels, Truth((self.code(),)), on.similarity)

    def source(self, name: str, seed: int = 0) -> np.ndarray | Path:
        """What `invert` is given: the pixels, or the file of a JPEG."""
        pixels = self.draw(name, seed).pixels
        return jpeg_file(pixels, f"{name}-{seed}") if self.jpeg else pixels

    def code(self) -> IFS:
        """The copies, and a map of rank one for each segment of the trunk, which projects the whole tree onto the
        y-axis and lays it on the segment."""
        copies, ends = similarities(*self.copies), [[end.real, end.imag] for segment in self.trunk for end in segment]
        points = IFS(torch.zeros(len(ends), 2, 2, dtype=torch.float64), torch.tensor(ends, dtype=torch.float64))
        reach = attractor.support_function(_together(copies, points))  # of the tree: strokes lie between ends
        low, high = -float(reach[3 * len(reach) // 4]), float(reach[len(reach) // 4])
        return _with_trunk(copies, self.trunk, low, high)


def _together(*codes: IFS) -> IFS:
    return IFS(torch.cat([each.linear for each in codes]), torch.cat([each.offset for each in codes]))


def _points(start: complex, end: complex) -> np.ndarray:
    return np.array([[start.real, start.imag], [end.real, end.imag]])


def _with_trunk(copies: IFS, trunk: Trunk, low: float, high: float) -> IFS:
    """The copies, and maps that take [low, high] on the y-axis to the segments of the trunk."""
    along = [(end - start) / (high - low) for start, end in trunk]
    linear = torch.tensor([[[0.0, each.real], [0.0, each.imag]] for each in along], dtype=torch.float64)
    offset = torch.tensor([[(start - each * low).real, (start - each * low).imag]
                           for (start, _), each in zip(trunk, along, strict=True)], dtype=torch.float64)
    return _together(copies, IFS(linear, offset))


def _branching(*branches: tuple[float, float]) -> tuple[Copies, Trunk]:
    """A trunk from 0 to i, and a smaller tree on its end at each angle, degrees, and ratio."""
    return [(cmath.rect(ratio, math.radians(angle)), 1j) for angle, ratio in branches], [(0j, 1j)]


def _fractal_plant(angle: float) -> tuple[Copies, Trunk]:
    """X → F+[[X]-X]-F[-FX]+X with F → FF: four copies half as large, and a twig on the trunk."""
    turn, fork = cmath.exp(1j * math.radians(angle)), 2j + 1j * cmath.exp(-1j * math.radians(angle))
    copies = [(turn / 2, 1j), (0.5, 1j), (1 / turn / 2, fork), (turn / 2, 2j)]
    return copies, [(0j, 2j), (2j, fork)]


def _weed(angle: float) -> tuple[Copies, Trunk]:
    """X → F[+X][-X]FX with F → FF: three copies half as large."""
    turn = cmath.exp(1j * math.radians(angle))
    return [(turn / 2, 1j), (1 / turn / 2, 1j), (0.5, 2j)], [(0j, 2j)]


def _herb(angle: float) -> tuple[Copies, Trunk]:
    """X → F[+X]F[-X]+X with F → FF: three copies half as large."""
    turn = cmath.exp(1j * math.radians(angle))
    return [(turn / 2, 1j), (1 / turn / 2, 2j), (turn / 2, 2j)], [(0j, 2j)]


@cache
def trees() -> Mapping[str, Tree]:
    """All trees by name."""
    tuned: dict[str, Any] = {"tuning": True}
    return {
        "plant_4": Tree(*_fractal_plant(25), 3, "green", **tuned),
        "plant_6": Tree(*_fractal_plant(25), 5, "green", 1.0, tool="matplotlib", **tuned),
        "plant_5_jpeg": Tree(*_fractal_plant(-22.5), 4, "black", jpeg=True, **tuned),
        "weed_5": Tree(*_weed(25.7), 4, "green", tool="matplotlib", **tuned),
        "herb_6": Tree(*_herb(20), 5, "black", 1.0, **tuned),
        "two_5": Tree(*_branching((25, .7), (-25, .7)), 5, "black", 3.0, tool="matplotlib", **tuned),
        "two_10": Tree(*_branching((45, .66), (-45, .66)), 10, "white", **tuned),
        "lean_8": Tree(*_branching((35, .75), (-20, .62)), 8, "red", tool="matplotlib", **tuned),
        "three_6": Tree(*_branching((40, .6), (0, .65), (-40, .6)), 6, "blue", **tuned),
        "thin_7_jpeg": Tree(*_branching((28, .72), (-28, .72)), 7, "orange", 10.0, .7, jpeg=True, **tuned),
        "high_plant_6": Tree(*_fractal_plant(-30), 5, "green"),
        "weed_6_jpeg": Tree(*_weed(20), 5, "black", jpeg=True),
        "herb_5": Tree(*_herb(-30), 4, "green", tool="matplotlib"),
        "herb_7": Tree(*_herb(25), 6, "blue", 1.0),
        "two_4": Tree(*_branching((30, .7), (-30, .7)), 4, "red", 4.0),
        "two_9_jpeg": Tree(*_branching((20, .75), (-20, .75)), 9, "black", tool="matplotlib", jpeg=True),
        "lean_7": Tree(*_branching((50, .7), (-30, .65)), 7, "orange"),
        "three_5": Tree(*_branching((50, .55), (0, .7), (-50, .55)), 5, "blue", 3.0, tool="matplotlib"),
        "four_6": Tree(*_branching((60, .6), (20, .6), (-20, .6), (-60, .6)), 6, "white"),
        "thin_8": Tree(*_branching((33, .7), (-33, .7)), 8, "red", 12.0, .7, tool="matplotlib"),
    }


@cache
def random_trees() -> Mapping[str, Tree]:
    """Trees of two or three branches with random angles, ratios, depths and pens, by name."""
    rng = np.random.default_rng(RANDOM_SEED)
    return {f"random_{number:02}": _random_tree(rng) for number in range(RANDOM_TREES)}


def _random_tree(rng: np.random.Generator) -> Tree:
    count = int(rng.choice([2, 2, 3]))
    angles = np.linspace(-1, 1, count) * rng.uniform(20, 55) + rng.uniform(-10, 10, count)
    ratios = rng.uniform(0.5, 0.75, count)
    deepest = int(math.log(MOST_TWIGS) / math.log(count))
    return Tree(*_branching(*zip(angles.tolist(), ratios.tolist(), strict=True)), int(rng.integers(4, deepest + 1)),
                str(rng.choice(list(INK))), float(rng.uniform(2, 6)), float(rng.choice([1.0, 0.75])),
                str(rng.choice(list(DRAW))), bool(rng.random() < JPEG_SHARE))


def named(name: str) -> Tree:
    """The tree of this name, random or not."""
    return (random_trees() if name.startswith("random_") else trees())[name]


def truth(name: str, read: ReadImage) -> Truth:
    """What a tree shows, on the canvas of what was read."""
    return named(name).draw(name).truth_on(read.placement)


def score(name: str, code: IFS, read: ReadImage) -> dict[str, Any]:
    """Of a code on the canvas of what was read: see `judging.against_truth`."""
    return {"depth": named(name).depth, **judging.likeness(code, read.image.numpy()),
            **judging.against_truth(code, truth(name, read), read.image.shape[-1])}
