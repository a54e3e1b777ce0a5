"""PLY: points of the attractor, for programs that show point clouds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..code import IFS
from .base import CodeFormat, only_one, plain
from .colours import of_points

POINTS = 200_000
VERTEX = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1")])
NAMES = {"<f4": "float", "|u1": "uchar"}


class Ply(CodeFormat):
    """200 000 points of the chaos game in the plane z = 0, binary little-endian. They have the code's own colours, or
    without these are coloured by their last map.

    Coordinates are the code's own. The maps are lost and the file cannot be read back, so keep the JSON file.
    """

    key, suffixes = "ply", (".ply",)

    def write(self, codes: Sequence[IFS]) -> bytes:
        from .. import attractor  # imports numba, which reading does not need

        code = only_one(codes, self.key)
        points, maps = attractor.random_points(code, POINTS)
        vertices = np.zeros(POINTS, VERTEX)
        vertices["x"], vertices["y"] = points.T
        vertices["red"], vertices["green"], vertices["blue"] = of_points(code, maps).T
        name = plain(code.meta.get("name")).encode("ascii", "replace").decode()
        header = ["ply", "format binary_little_endian 1.0", f"comment {name or 'attractor'}, by fractal-exp",
                  f"element vertex {POINTS}",
                  *(f"property {NAMES[VERTEX[key].str]} {key}" for key in VERTEX.names or ()), "end_header", ""]
        return "\n".join(header).encode("ascii") + vertices.tobytes()
