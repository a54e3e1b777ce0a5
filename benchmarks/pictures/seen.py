"""A picture of a drawing whose shape alone is known as well."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.images.bands import Bands
from fractal_exp.images.reading import ReadImage
from fractal_exp.images.sampling import resample

from . import judging

POINTS = 20_000        # of an attractor, to which an affine map is fitted


@dataclass(frozen=True)
class Seen:
    """source: the pixels (H,W,3) or the file, as `invert` takes them; alone: the shape alone at its place in them,
    (H,W) in [0,1], white on black; code: the true one; onto: takes the code's coordinates (…,2) to pixels."""

    source: np.ndarray | Path
    alone: np.ndarray
    code: IFS
    onto: Callable[[np.ndarray], np.ndarray]

    def truth(self, read: ReadImage) -> IFS:
        """The true code on the canvas on which the picture was read; a perspective is replaced by the affine map that
        moves the attractor's points alike, as nearly as any does."""
        points = attractor.random_points(self.code, POINTS)[0]
        placed = read.placement.to_canvas(self.onto(points))
        affine, *_ = np.linalg.lstsq(np.column_stack([points, np.ones(len(points))]), placed, rcond=None)
        matrix, shift = torch.from_numpy(affine[:2].T.copy()), torch.from_numpy(affine[2].copy())
        linear = matrix @ self.code.linear.double() @ torch.linalg.inv(matrix)
        return replace(self.code, linear=linear, offset=self.code.offset.double() @ matrix.T + shift - linear @ shift)

    def shown(self, read: ReadImage) -> np.ndarray:
        """The shape alone on that canvas, (R,R)."""
        x0, y0, x1, _ = read.crop_box
        return resample(Bands.of_array(self.alone.astype(np.float32)), x0, y0, x1 - x0, read.image.shape[-1], 0.0)


def score(kind: str, seen: Seen, code: IFS, read: ReadImage) -> dict[str, float | bool | str | int]:
    """How well a code of a picture of a kind is recovered: F1 within a pixel of the code's drawing and the true one's,
    and the scores of `judging.against_code`."""
    true, side = seen.truth(read), read.image.shape[-1]
    f1 = judging.f1_within_a_pixel(*(judging.drawing(each, side) for each in (code, true)))
    return {"kind": kind, "f1_truth": f1, "true_maps": len(true), **judging.against_code(code, true, f1, side)}
