"""The canonical fractals as a turtle or a loop over polygons draws them, each with its true code.

Depth d is the d-th step of the construction: every map applied d times to a first segment or polygon. Coordinates are
the fractal's own, y up.
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import torch

from fractal_exp import codes
from fractal_exp.ifs.code import IFS

TRUNK_RATIO, TRUNK_ANGLE = 0.66, 30  # of the symmetric binary tree; degrees, a divisor of 360
UNIT_SEGMENT = np.array([[0.0, 0], [1, 0]])
UNIT_SQUARE = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
TRIANGLE = np.array([[0, 0], [1, 0], [0.5, math.sqrt(3) / 2]])
SOLID_DEPTH = 16           # to which squares of the Pythagoras tree are counted as its attractor


@dataclass(frozen=True)
class Truth:
    """What a picture shows in the limit of its depth: the union of the attractors of `codes` and of `solids`, filled
    polygons (K,V,2). `code` is the code that draws all of it, where there is one."""

    codes: tuple[IFS, ...]
    solids: np.ndarray | None = None

    @property
    def code(self) -> IFS | None:
        return self.codes[0] if len(self.codes) == 1 and self.solids is None else None

    def similar(self, scale: float, shift: tuple[float, float]) -> Truth:
        """That of the picture scaled and then shifted."""
        solids = None if self.solids is None else self.solids * scale + np.array(shift)
        return Truth(tuple(code.similar(scale, shift) for code in self.codes), solids)


@dataclass(frozen=True)
class Strokes:
    """What is drawn: filled polygons (K,V,2) and lines (K,2,2), these of `widths` pixels."""

    polygons: np.ndarray | None = None
    lines: np.ndarray | None = None
    widths: np.ndarray | float = 2.0

    @property
    def points(self) -> np.ndarray:
        """All corners and ends (P,2)."""
        return np.concatenate([each.reshape(-1, 2) for each in (self.polygons, self.lines) if each is not None])


@dataclass(frozen=True)
class Figure:
    """A canonical fractal: the strokes of a depth, its truth, and the depths it is drawn at, the last the deepest that
    shows at 512 to 800 pixels."""

    strokes: Callable[[int], Strokes]
    truth: Callable[[], Truth]
    depths: tuple[int, ...]


def copies(code: IFS, first: np.ndarray, depth: int) -> np.ndarray:
    """`first` (V,2) under all words of `depth` maps: (N^depth,V,2)."""
    linear, offset = code.linear.double().numpy(), code.offset.double().numpy()
    pieces = first[None]
    for _ in range(depth):
        pieces = (np.einsum("nij,kvj->nkvi", linear, pieces) + offset[:, None, None]).reshape(-1, *first.shape)
    return pieces


def orbit(code: IFS, first: np.ndarray, depth: int) -> list[np.ndarray]:
    """`first` (V,2) under all words of 0 to `depth` maps, a list by the number of maps."""
    return [copies(code, first, count) for count in range(depth + 1)]


def similarities(*maps: tuple[complex, complex]) -> IFS:
    """Direct similarities of the complex plane, z' = a z + b."""
    a, b = (np.array([complex(pair[k]) for pair in maps]) for k in (0, 1))
    linear = np.stack([np.stack([a.real, -a.imag], -1), np.stack([a.imag, a.real], -1)], 1)
    return IFS(torch.from_numpy(linear), torch.from_numpy(np.stack([b.real, b.imag], -1)))


@cache
def cantor_set() -> IFS:
    """The middle-third set on the unit segment; what is drawn of it are bars."""
    return similarities((1 / 3, 0), (1 / 3, 2 / 3))


@cache
def pentagon() -> IFS:
    """Sierpinski's pentagon: five copies in the corners, 1 / golden ratio squared of the size; nothing in the middle.

    L. Riddle, Classic Iterated Function Systems: Sierpinski n-gons.
    """
    ratio = (3 - math.sqrt(5)) / 2
    return similarities(*((ratio, (1 - ratio) * corner) for corner in _corners(5)))


@cache
def pentigree() -> IFS:
    """McWorter's pentigree: a segment becomes six, turned by 36, 108, -36, -108, -36 and 36 degrees.

    W. McWorter and J. Tazelaar, Creating fractals, Byte 12 (1987); L. Riddle, Classic Iterated Function Systems.
    """
    ratio, start, maps = (3 - math.sqrt(5)) / 2, 0j, []
    for degrees in (36, 108, -36, -108, -36, 36):
        maps.append((cmath.rect(ratio, math.radians(degrees)), start))
        start += maps[-1][0]
    return similarities(*maps)


@cache
def pythagoras() -> IFS:
    """The two maps that take the Pythagoras tree on the unit square to its halves.

    The tree is the square with all its images under these maps. No affine map takes the tree onto the square, so there
    is no code of the whole tree: its truth is the attractor of the two maps with the squares down to where they are
    below a pixel, and its maps are not compared.
    """
    return similarities(((1 + 1j) / 2, 1j), ((1 - 1j) / 2, (1 + 1j) / 2 + 1j))


@cache
def binary_tree() -> IFS:
    """A trunk from the origin to (0, 1) and two branches, 30 degrees to each side and 0.66 as long.

    The third map, of rank one, flattens the whole tree sideways and lays it on the trunk, its left end at the origin.
    """
    angle = math.radians(TRUNK_ANGLE)
    branches = similarities((cmath.rect(TRUNK_RATIO, angle), 1j), (cmath.rect(TRUNK_RATIO, -angle), 1j))
    trunk = torch.tensor([[[0, 0], [1 / (2 * tree_reach()), 0]]])
    return IFS(torch.cat([branches.linear, trunk]), torch.cat([branches.offset, torch.tensor([[0, 0.5]])]))


def tree_reach() -> float:
    """How far the binary tree reaches to each side: the largest sum of r^k sin(a_k), where each angle differs by 30
    degrees from the one before, and the first is 0."""
    sines = np.sin(np.radians(np.arange(0, 360, TRUNK_ANGLE)))
    reach = np.zeros_like(sines)
    for _ in range(100):
        reach = sines + TRUNK_RATIO * np.maximum(np.roll(reach, 1), np.roll(reach, -1))
    return float(reach[0])


def snowflake_curves() -> tuple[IFS, ...]:
    """The three Koch curves of the snowflake's outline, whose corners have distance 1 from the origin.

    No part of a closed curve is a smaller closed curve, so the outline as a whole has no code.
    """
    return tuple(_moved(codes.known("koch_curve"), start, end) for start, end in _snowflake_sides())


def _moved(code: IFS, start: complex, end: complex) -> IFS:
    """The code whose attractor is that of `code` after 0 has gone to `start` and 1 to `end`."""
    turn = end - start
    matrix = torch.tensor([[turn.real, -turn.imag], [turn.imag, turn.real]], dtype=torch.float64)
    shift = torch.tensor([start.real, start.imag], dtype=torch.float64)
    linear = matrix @ code.linear.double() @ torch.linalg.inv(matrix)
    return replace(code, linear=linear, offset=code.offset.double() @ matrix.T + shift - linear @ shift)


def _corners(count: int) -> list[complex]:
    """The corners of a regular polygon about the origin, the first at the top, counterclockwise."""
    return [cmath.rect(1, math.pi / 2 + 2 * math.pi * k / count) for k in range(count)]


def _snowflake_sides() -> list[tuple[complex, complex]]:
    corners = _corners(3)[::-1]  # clockwise, so that the curves bulge outwards
    return list(zip(corners, corners[1:] + corners[:1], strict=True))


def _lines(code: IFS, width: float) -> Callable[[int], Strokes]:
    return lambda depth: Strokes(lines=copies(code, UNIT_SEGMENT, depth), widths=width)


def _polygons(code: IFS, first: np.ndarray) -> Callable[[int], Strokes]:
    return lambda depth: Strokes(polygons=copies(code, first, depth))


def _bars(depth: int) -> Strokes:
    """The last row of the middle-third construction, as bars a hundredth of its length high."""
    return Strokes(polygons=copies(cantor_set(), UNIT_SEGMENT, depth)[:, [0, 1, 1, 0]]
                   + np.array([[0, -1], [0, -1], [0, 1], [0, 1]]) / 200)


def _outline(depth: int) -> Strokes:
    sides = [copies(curve, np.array([[a.real, a.imag], [b.real, b.imag]]), depth)
             for curve, (a, b) in zip(snowflake_curves(), _snowflake_sides(), strict=True)]
    return Strokes(lines=np.concatenate(sides))


def _filled(depth: int) -> Strokes:
    return Strokes(polygons=_outline(depth).lines[None, :, 0])  # type: ignore[index]


def _squares(depth: int) -> Strokes:
    grown = orbit(pythagoras(), UNIT_SQUARE, depth)
    return Strokes(polygons=np.concatenate(grown))


def _branches(thinner: bool) -> Callable[[int], Strokes]:
    """Trunk and branches of the binary tree; a constant pen, or one from 10 pixels to 1."""
    def strokes(depth: int) -> Strokes:
        two = IFS(binary_tree().linear[:2], binary_tree().offset[:2])
        grown = orbit(two, np.array([[0.0, 0], [0, 1]]), depth)
        widths = [np.full(len(each), max(1.0, 10 * 0.72**k) if thinner else 2.0) for k, each in enumerate(grown)]
        return Strokes(lines=np.concatenate(grown), widths=np.concatenate(widths))
    return strokes


def _own(code: IFS) -> Callable[[], Truth]:
    return lambda: Truth((code,))


def _of(name: str) -> IFS:
    return replace(codes.known(name), probabilities=None)


def _corner_array(count: int) -> np.ndarray:
    return np.array([[corner.real, corner.imag] for corner in _corners(count)])


FIGURES: dict[str, Figure] = {
    "cantor_set": Figure(_bars, _own(cantor_set()), (3, 4, 5)),
    "cantor_dust": Figure(_polygons(_of("cantor_dust"), UNIT_SQUARE), _own(_of("cantor_dust")), (3, 4, 5)),
    "koch_curve": Figure(_lines(_of("koch_curve"), 3), _own(_of("koch_curve")), (3, 4, 6)),
    "koch_outline": Figure(_outline, lambda: Truth(snowflake_curves()), (3, 4, 5)),
    "koch_filled": Figure(_filled, _own(_of("koch_snowflake")), (3, 4, 5)),
    "gasket": Figure(_polygons(_of("sierpinski_triangle"), TRIANGLE), _own(_of("sierpinski_triangle")), (4, 6, 8)),
    "carpet": Figure(_polygons(_of("sierpinski_carpet"), UNIT_SQUARE), _own(_of("sierpinski_carpet")), (3, 4, 5)),
    "pentagon": Figure(_polygons(pentagon(), _corner_array(5)), _own(pentagon()), (3, 4, 6)),
    "heighway": Figure(_lines(_of("heighway_dragon"), 2), _own(_of("heighway_dragon")), (4, 8, 12, 16)),
    "levy": Figure(_lines(_of("levy_c_curve"), 2), _own(_of("levy_c_curve")), (4, 8, 12, 16)),
    "pentigree": Figure(_lines(pentigree(), 2), _own(pentigree()), (3, 4, 6)),
    "pythagoras": Figure(_squares, lambda: Truth((pythagoras(),), _squares(SOLID_DEPTH).polygons), (4, 8, 13)),
    "binary_tree": Figure(_branches(thinner=False), _own(binary_tree()), (4, 8, 12)),
    "binary_tree_thinning": Figure(_branches(thinner=True), _own(binary_tree()), (4, 8, 12)),
}
