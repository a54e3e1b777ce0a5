"""Drawings of a recursion that ended: a stroke, and smaller copies of it under every word of some maps.

This is how programs draw trees: a trunk, then each branch as a smaller tree, down to some depth. The trunk is the image
of a map that flattens the whole shape to a segment. The last twigs end before the attractor does.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ....ifs import attractor
from ....ifs.code import IFS
from .. import maps as affine
from .blur import blurred
from .pens import Drawn, given, inked


class Strokes(Drawn):
    """Segments drawn with a round pen. A map whose image is at most `camera.stroke` wide draws a stroke; all others
    copy the drawing. values: the depth, which is how many maps copy a stroke at most; 1 if the pen shrinks with the
    copies, else 0; the pen's radius and the standard deviation of the blur, canvas units."""

    is_whole = False
    numbers, lengths = ("depth", "thinning"), ("pen_px", "blur_px")

    def smallest_part(self, code: IFS, resolution: int) -> float:
        found = self._generations(code, resolution, int(self.values[0])) if self.values else []
        return found[-1].length if found else 0.0

    @property
    def shows_attractor(self) -> bool:
        return False

    def drawn(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """The depth, and whether the pen shrinks."""
        return values[:2]

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        if not self.values:
            return super().render(code, resolution, seed, independent=independent)
        depth, thinning, radius, sigma = self.values
        generations = self._generations(code, resolution, int(depth))
        widths = self._widths(generations, bool(thinning), radius * resolution / 2)
        same = {}  # strokes of equal width are drawn together
        for generation, width in zip(generations, widths, strict=True):
            same.setdefault(width, []).append(generation.places)
        lit = [(self._distance_of(torch.cat(places), resolution), width) for width, places in same.items()]
        return blurred(self._inked(lit, resolution), sigma * resolution / 2, self.camera)

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[tuple[float, ...], Tensor]]:
        """Pairs of camera values and the rendering (R,R) of the code with them; none for a code without strokes."""
        camera, pixel = self.camera, 2 / resolution
        if not camera.strokes:
            return
        generations = self._generations(code, resolution, int(self.values[0]) if self.values else camera.deepest)
        distances = [self._distance_of(each.places, resolution) for each in generations]
        depths = [k for k, each in enumerate(generations) if each.length * resolution / 2 <= camera.twigs_px[1]]
        pens = given(camera.pen_px, camera.pens_px)
        for depth in depths[-1:] if self.values else depths:  # what is drawn is known if the values are
            for thinning, radius in product((bool(self.values[1]),) if self.values else (False, True), pens):
                widths = self._widths(generations[:depth + 1], thinning, radius)
                drawn = self._inked(list(zip(distances, widths, strict=False)), resolution)
                yield from (((float(depth), float(thinning), radius * pixel, sigma * pixel),
                             blurred(drawn, sigma, camera)) for sigma in given(camera.blur_px, camera.blurs_px))

    def _generations(self, code: IFS, resolution: int, depth: int) -> list[_Generation]:
        """The strokes that 0, 1, … maps copy, down to this depth or until they are too short to see."""
        camera, (segments, copies) = self.camera, self._parts(code)
        found: list[_Generation] = []
        words = copies.new_tensor([[1.0, 0, 0, 1, 0, 0]])
        while len(segments) and len(words) * len(segments) <= camera.most_strokes:
            ends = segments @ words[:, None, :4].unflatten(-1, (2, 2)).transpose(-1, -2) + words[:, None, None, 4:]
            places, length = _along(ends.flatten(0, 1), 2 / (resolution * self.fine), camera.stroke_points)
            found.append(_Generation(places, float(affine.largest_singular(words).mean()), length))
            if len(found) > depth or not len(copies) or length * resolution / 2 < camera.twigs_px[0]:
                break
            words = affine.compositions(words, copies)
        return found

    def _parts(self, code: IFS) -> tuple[Tensor, Tensor]:
        """The segments (S,2,2) that flat maps draw, as pairs of ends, and the maps (N,6) that are not flat."""
        code = code.to("cpu")
        maps, reach = affine.from_code(code), attractor.support_function(code)
        axes, sizes, sources = torch.linalg.svd(code.linear)
        segments, flat = [], []
        for offset, (along, across), size, (first, second) in zip(code.offset, axes.transpose(1, 2), sizes, sources,
                                                                  strict=True):
            low, high = _extent(reach, second)
            flat.append(bool(size[1] * (high - low) <= self.camera.stroke))
            middle = offset + across * size[1] * (low + high) / 2
            segments.append(torch.stack([middle + along * size[0] * end for end in _extent(reach, first)]))
        return torch.stack(segments)[flat], maps[~torch.tensor(flat)]

    def _widths(self, generations: list[_Generation], thinning: bool, radius: float) -> list[float]:
        """The pen's radius in each generation, in the unit of `radius`."""
        least = min(radius, *self.camera.pens_px)
        return [max(least, radius * each.scale) if thinning else radius for each in generations]

    def _distance_of(self, places: Tensor, resolution: int) -> Tensor:
        """Distance (R·fine, R·fine) from each subpixel to the nearest of the points (P,2), pixels."""
        side = resolution * self.fine
        lit = torch.zeros(side * side)
        column, row = ((places * places.new_tensor([1, -1]) + 1) * (side / 2)).floor().long().unbind(1)
        inside = (column >= 0) & (column < side) & (row >= 0) & (row < side)
        lit[row[inside] * side + column[inside]] = 1
        return self.distance_to(lit.view(side, side))

    def _inked(self, drawn: list[tuple[Tensor, float]], resolution: int) -> Tensor:
        """The share (R,R) of each pixel that some pen covers, from pairs of distances and radii in pixels."""
        if not drawn:
            return torch.zeros(resolution, resolution)
        return inked(torch.stack([distance - radius for distance, radius in drawn]).amin(0), 0.0, self.fine)


class _Generation(NamedTuple):
    """The strokes that equally many maps copy: points (P,2) on them, their mean size relative to strokes that no map
    copies, and the length of the longest, canvas units."""

    places: Tensor
    scale: float
    length: float


def _extent(reach: np.ndarray, direction: Tensor) -> tuple[float, float]:
    """Minimum and maximum of u·x over an attractor, for a unit vector u (2,), from its support function (K,)."""
    x, y = direction.tolist()
    turn = math.atan2(y, x) / (2 * math.pi) * len(reach)
    low, high = np.interp([turn + len(reach) / 2, turn], np.arange(len(reach)), reach, period=len(reach))
    return -float(low), float(high)


def _along(ends: Tensor, step: float, most: int) -> tuple[Tensor, float]:
    """Points (P,2) on segments (S,2,2), at most `step` apart unless that takes more than `most` points, and the length
    of the longest segment."""
    length = float((ends[:, 1] - ends[:, 0]).norm(dim=-1).max())
    count = min(max(2, most // len(ends)), math.ceil(length / step) + 1)
    part = torch.linspace(0, 1, count)[None, :, None]
    return (ends[:, :1] * (1 - part) + ends[:, 1:] * part).flatten(0, 1), length
