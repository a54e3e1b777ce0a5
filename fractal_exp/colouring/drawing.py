"""Drawings of a code in its colours."""

from __future__ import annotations

import numpy as np
import torch
from scipy.ndimage import distance_transform_edt
from torch import Tensor

from ..ifs.code import IFS
from ..images.painted import cover_of
from ..rendering.colour import on_ground
from ..rendering.still import points_per_view, render_with_info
from ..rendering.toned import COLOUR, Toned

POINTS_AT_MOST = points_per_view(1024)


def mean_colours(code: IFS, side: int, seed: int = 0) -> Tensor:
    """The mean colour of a code's points in each pixel of its canvas, and their density: (side,side,4). Raises
    `InputError` if the code has no colours."""
    return render_with_info(code, resolution=side, seed=seed, mode="tinted",
                            points_in_view=min(points_per_view(side), POINTS_AT_MOST))[0]


def in_colours(levels: Tensor, code: IFS, ground: tuple[float, float, float], seed: int = 0) -> Tensor:
    """A drawing of a code (R,R) in [0,1], white on black, in the code's colours on a ground: (R,R,3) in [0,1].

    A pixel that a pen or a blur lights beside the points has the colour of the nearest pixel with points. What it
    covers of the ground is estimated as for the picture that colours are fitted to. A code with a tone of its cover is
    drawn by that instead. Raises `InputError` if the code has no colours.
    """
    if Toned.of(code, COLOUR):
        return on_ground(render_with_info(code, resolution=len(levels), seed=seed, mode=COLOUR)[0], ground)
    drawn = mean_colours(code, len(levels), seed)
    bare = drawn[..., 3] == 0
    rows, columns = np.asarray(distance_transform_edt(bare, return_distances=False, return_indices=True))
    cover = torch.from_numpy(cover_of(levels.numpy())).to(drawn.dtype)
    return on_ground(torch.cat([drawn[rows, columns, :3], cover[..., None]], -1), ground)
