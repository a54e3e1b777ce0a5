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

from ..ifs import affine, attractor
from ..ifs.code import IFS
from .blur import blurred
from .camera import Camera
from .pens import PEN_SUPERSAMPLE, PENS_PX, Inked, given, inked
from .stroke_kernels import outline

STROKE = 0.06          # greatest width, canvas units, of the image of a map that draws a stroke
TWIGS_PX = 0.4, 24.0   # least and greatest length, pixels, of the last strokes of a recursion that are tried
DEEPEST = 24           # depth that is tried: how many maps copy a stroke
MOST_STROKES = 40_000  # that are copied by equally many maps; drawings with more are not tried
STROKE_BLURS_PX = 0.35, 0.7   # that are tried: from less blur, a polish does not find a larger one


class Strokes(Inked):
    """Segments drawn with a round pen. A map whose image is at most `STROKE` wide draws a stroke; all others copy the
    drawing."""

    kind = "strokes"
    beside = Inked.kind
    is_whole = False
    values = "depth", "thinning", "pen", "blur"

    def smallest_part(self, code: IFS, resolution: int) -> float:
        found = self._generations(code, resolution, int(self.camera.depth)) if self.camera.depth is not None else []
        return found[-1].length if found else 0.0

    @property
    def shows_attractor(self) -> bool:
        return False

    def what_is_drawn(self, camera: Camera) -> tuple[float | None, ...]:
        """The depth, and whether the pen shrinks."""
        return camera.depth, camera.thinning

    def render(self, code: IFS, resolution: int, seed: int, *, independent: bool = False) -> Tensor:
        camera = self.camera
        if camera.depth is None:
            return super().render(code, resolution, seed, independent=independent)
        off = _blank(resolution)
        for each in self._generations(code, resolution, int(camera.depth)):
            _draw(each, _width(each, bool(camera.thinning), self.pen * resolution / 2), off)
        return blurred(inked(off, 0.0), (camera.blur or 0.0) * resolution / 2)

    def candidates(self, code: IFS, resolution: int, seed: int) -> Iterator[tuple[Camera, Tensor]]:
        """Pairs of a camera and the rendering (R,R) of the code with it; none for a code without strokes."""
        params, depth, pixel = self.params, self.camera.depth, 2 / resolution
        if not params.strokes:
            return
        generations = self._generations(code, resolution, DEEPEST if depth is None else int(depth))
        first = 0 if depth is None else len(generations) - 1
        pens, blurs = given(params.pen_px, PENS_PX), given(params.blur_px, STROKE_BLURS_PX)
        for thinning, radius in product((False, True) if depth is None else (bool(self.camera.thinning),), pens):
            off = _blank(resolution)
            for deep, each in enumerate(generations):
                _draw(each, _width(each, thinning, radius), off)
                if deep < first or each.length * resolution / 2 > TWIGS_PX[1]:
                    continue
                drawn = inked(off, 0.0)
                yield from ((Camera(self.kind, depth=float(deep), thinning=float(thinning), pen=radius * pixel,
                                    blur=sigma * pixel), blurred(drawn, sigma)) for sigma in blurs)

    def _generations(self, code: IFS, resolution: int, depth: int) -> list[_Generation]:
        """The strokes that 0, 1, … maps copy, down to this depth or until they are too short to see."""
        segments, copies = parts_of(code)
        found: list[_Generation] = []
        words = copies.new_tensor([[1.0, 0, 0, 1, 0, 0]])
        while len(segments) and len(words) * len(segments) <= MOST_STROKES:
            ends = segments @ words[:, None, :4].unflatten(-1, (2, 2)).transpose(-1, -2) + words[:, None, None, 4:]
            strokes = ends.flatten(0, 1)
            length = float((strokes[:, 1] - strokes[:, 0]).norm(dim=-1).max())
            found.append(_Generation(strokes, float(affine.largest_singular(words).mean()), length))
            if len(found) > depth or not len(copies) or length * resolution / 2 < TWIGS_PX[0]:
                break
            words = affine.compositions(words, copies)
        return found


class _Generation(NamedTuple):
    """The strokes (S,2,2) that equally many maps copy, as pairs of ends. scale: their mean size relative to strokes
    that no map copies; length: of the longest, canvas units."""

    strokes: Tensor
    scale: float
    length: float


def _width(generation: _Generation, thinning: bool, radius: float) -> float:
    """The pen's radius in a generation, in the unit of `radius`."""
    return max(min(radius, *PENS_PX), radius * generation.scale) if thinning else radius


def _blank(resolution: int) -> Tensor:
    """The distances (3R,3R) to the outline of what is drawn, pixels, before anything is."""
    return torch.full((resolution * PEN_SUPERSAMPLE,) * 2, torch.inf)


def _draw(generation: _Generation, radius: float, off: Tensor) -> None:
    """Lower the distances (3R,3R) to the outline, pixels, by the strokes of a generation."""
    outline(generation.strokes.double().numpy(), radius, PEN_SUPERSAMPLE, off.numpy())


def parts_of(code: IFS) -> tuple[Tensor, Tensor]:
    """The segments (S,2,2) that a code's flat maps draw, as pairs of ends, and its maps (N,6) that are not flat."""
    flat, segments = _images(code)
    return segments[flat], affine.from_code(code.to("cpu"))[~flat]


def flat_maps(code: IFS) -> Tensor:
    """Which maps (N,) of a code flatten its attractor to a stroke: those with an image of width `STROKE` or less."""
    return _images(code)[0]


def as_lines(code: IFS) -> Tensor:
    """The maps (N,6) of a code, those that draw strokes without width: each sends the attractor to the segment that is
    drawn of it."""
    code = code.to("cpu")
    flat, segments = _images(code)
    reach, axes = attractor.support_function(code), torch.linalg.svd(code.linear)[2][:, 0]
    lines = [onto_segment(axis, *extent(reach, axis), *ends) for axis, ends in zip(axes, segments, strict=True)]
    return torch.where(flat[:, None], torch.stack(lines), affine.from_code(code))


def onto_segment(axis: Tensor, low: float, high: float, first: Tensor, last: Tensor) -> Tensor:
    """The map (6,) that takes the places from `low` to `high` on an axis (2,) to the segment between two ends (2,)."""
    linear = torch.outer((last - first) / (high - low), axis)
    return affine.sending(linear[None], (axis * low)[None], first[None])[0]


def _images(code: IFS) -> tuple[Tensor, Tensor]:
    """Which maps (N,) are flat, and the ends (N,2,2) of each map's image along its longer axis."""
    code = code.to("cpu")
    reach = attractor.support_function(code)
    axes, sizes, sources = torch.linalg.svd(code.linear)
    flat, segments = [], []
    for offset, (along, across), size, (first, second) in zip(code.offset, axes.transpose(1, 2), sizes, sources,
                                                              strict=True):
        low, high = extent(reach, second)
        flat.append(bool(size[1] * (high - low) <= STROKE))
        middle = offset + across * size[1] * (low + high) / 2
        segments.append(torch.stack([middle + along * size[0] * end for end in extent(reach, first)]))
    return torch.tensor(flat), torch.stack(segments)


def extent(reach: np.ndarray, direction: Tensor) -> tuple[float, float]:
    """Minimum and maximum of u·x over an attractor, for a unit vector u (2,), from its support function (K,)."""
    x, y = direction.tolist()
    turn = math.atan2(y, x) / (2 * math.pi) * len(reach)
    low, high = np.interp([turn + len(reach) / 2, turn], np.arange(len(reach)), reach, period=len(reach))
    return -float(low), float(high)
