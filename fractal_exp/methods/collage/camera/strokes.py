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
from ..params.camera import CameraParams
from .blur import blurred
from .pens import Drawn, given, inked
from .stroke_kernels import outline


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
        off = self._blank(resolution)
        for each in self._generations(code, resolution, int(depth)):
            self._draw(each, self._width(each, bool(thinning), radius * resolution / 2), off)
        return blurred(inked(off, 0.0, self.fine), sigma * resolution / 2, self.camera)

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[tuple[float, ...], Tensor]]:
        """Pairs of camera values and the rendering (R,R) of the code with them; none for a code without strokes."""
        camera, pixel = self.camera, 2 / resolution
        if not camera.strokes:
            return
        generations = self._generations(code, resolution, int(self.values[0]) if self.values else camera.deepest)
        first = len(generations) - 1 if self.values else 0  # what is drawn is known if the values are
        pens, blurs = given(camera.pen_px, camera.pens_px), given(camera.blur_px, camera.stroke_blurs_px)
        for thinning, radius in product((bool(self.values[1]),) if self.values else (False, True), pens):
            off = self._blank(resolution)
            for depth, each in enumerate(generations):
                self._draw(each, self._width(each, thinning, radius), off)
                if depth < first or each.length * resolution / 2 > camera.twigs_px[1]:
                    continue
                drawn = inked(off, 0.0, self.fine)
                yield from (((float(depth), float(thinning), radius * pixel, sigma * pixel),
                             blurred(drawn, sigma, camera)) for sigma in blurs)

    def _generations(self, code: IFS, resolution: int, depth: int) -> list[_Generation]:
        """The strokes that 0, 1, … maps copy, down to this depth or until they are too short to see."""
        camera, (segments, copies) = self.camera, parts_of(code, self.camera)
        found: list[_Generation] = []
        words = copies.new_tensor([[1.0, 0, 0, 1, 0, 0]])
        while len(segments) and len(words) * len(segments) <= camera.most_strokes:
            ends = segments @ words[:, None, :4].unflatten(-1, (2, 2)).transpose(-1, -2) + words[:, None, None, 4:]
            strokes = ends.flatten(0, 1)
            length = float((strokes[:, 1] - strokes[:, 0]).norm(dim=-1).max())
            found.append(_Generation(strokes, float(affine.largest_singular(words).mean()), length))
            if len(found) > depth or not len(copies) or length * resolution / 2 < camera.twigs_px[0]:
                break
            words = affine.compositions(words, copies)
        return found

    def _width(self, generation: _Generation, thinning: bool, radius: float) -> float:
        """The pen's radius in a generation, in the unit of `radius`."""
        return max(min(radius, *self.camera.pens_px), radius * generation.scale) if thinning else radius

    def _blank(self, resolution: int) -> Tensor:
        """The distances (R·fine, R·fine) to the outline of what is drawn, pixels, before anything is."""
        return torch.full((resolution * self.fine,) * 2, torch.inf)

    def _draw(self, generation: _Generation, radius: float, off: Tensor) -> None:
        """Lower the distances (R·fine, R·fine) to the outline, pixels, by the strokes of a generation."""
        outline(generation.strokes.double().numpy(), radius, self.fine, off.numpy())

class _Generation(NamedTuple):
    """The strokes (S,2,2) that equally many maps copy, as pairs of ends. scale: their mean size relative to strokes
    that no map copies; length: of the longest, canvas units."""

    strokes: Tensor
    scale: float
    length: float


def parts_of(code: IFS, camera: CameraParams) -> tuple[Tensor, Tensor]:
    """The segments (S,2,2) that a code's flat maps draw, as pairs of ends, and its maps (N,6) that are not flat."""
    flat, segments = _images(code, camera)
    return segments[flat], affine.from_code(code.to("cpu"))[~flat]


def flat_maps(code: IFS, camera: CameraParams) -> Tensor:
    """Which maps (N,) of a code flatten its attractor to a stroke: those with an image of width `camera.stroke` or
    less."""
    return _images(code, camera)[0]


def as_lines(code: IFS, camera: CameraParams) -> Tensor:
    """The maps (N,6) of a code, those that draw strokes without width: each sends the attractor to the segment that is
    drawn of it."""
    code = code.to("cpu")
    flat, segments = _images(code, camera)
    reach, axes = attractor.support_function(code), torch.linalg.svd(code.linear)[2][:, 0]
    lines = [onto_segment(axis, *extent(reach, axis), *ends) for axis, ends in zip(axes, segments, strict=True)]
    return torch.where(flat[:, None], torch.stack(lines), affine.from_code(code))


def onto_segment(axis: Tensor, low: float, high: float, first: Tensor, last: Tensor) -> Tensor:
    """The map (6,) that takes the places from `low` to `high` on an axis (2,) to the segment between two ends (2,)."""
    linear = torch.outer((last - first) / (high - low), axis)
    return affine.sending(linear[None], (axis * low)[None], first[None])[0]


def _images(code: IFS, camera: CameraParams) -> tuple[Tensor, Tensor]:
    """Which maps (N,) are flat, and the ends (N,2,2) of each map's image along its longer axis."""
    code = code.to("cpu")
    reach = attractor.support_function(code)
    axes, sizes, sources = torch.linalg.svd(code.linear)
    flat, segments = [], []
    for offset, (along, across), size, (first, second) in zip(code.offset, axes.transpose(1, 2), sizes, sources,
                                                              strict=True):
        low, high = extent(reach, second)
        flat.append(bool(size[1] * (high - low) <= camera.stroke))
        middle = offset + across * size[1] * (low + high) / 2
        segments.append(torch.stack([middle + along * size[0] * end for end in extent(reach, first)]))
    return torch.tensor(flat), torch.stack(segments)


def extent(reach: np.ndarray, direction: Tensor) -> tuple[float, float]:
    """Minimum and maximum of u·x over an attractor, for a unit vector u (2,), from its support function (K,)."""
    x, y = direction.tolist()
    turn = math.atan2(y, x) / (2 * math.pi) * len(reach)
    low, high = np.interp([turn + len(reach) / 2, turn], np.arange(len(reach)), reach, period=len(reach))
    return -float(low), float(high)
