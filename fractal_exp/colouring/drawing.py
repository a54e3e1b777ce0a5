"""Drawings of a code in its colours."""

from __future__ import annotations

import torch
from scipy.ndimage import distance_transform_edt
from torch import Tensor

from ..ifs.code import IFS
from ..images.painted import cover_of
from ..rendering.colour import on_ground
from ..rendering.still import points_per_view, render_with_info

POINTS_AT_MOST = points_per_view(1024)


def mean_colours(code: IFS, side: int, seed: int = 0) -> Tensor:
    """The mean colour of a code's points in each pixel of its canvas, and 1 where there are any: (side,side,4). Raises
    `InputError` if the code has no colours."""
    return render_with_info(code, resolution=side, supersample=1, seed=seed, mode="colour",
                            points_in_view=min(points_per_view(side), POINTS_AT_MOST))[0]


def in_colours(levels: Tensor, code: IFS, ground: tuple[float, float, float], seed: int = 0) -> Tensor:
    """A drawing of a code (R,R) in [0,1], white on black, in the code's colours on a ground: (R,R,3) in [0,1].

    A pixel that a pen or a blur lights beside the points has the colour of the nearest pixel with points. What it
    covers of the ground is estimated as for the picture that colours are fitted to. Raises `InputError` if the code has
    no colours.
    """
    drawn = mean_colours(code, len(levels), seed)
    rows, columns = distance_transform_edt(drawn[..., 3] == 0, return_distances=False, return_indices=True)
    cover = torch.from_numpy(cover_of(levels.numpy())).to(drawn.dtype)
    return on_ground(torch.cat([drawn[rows, columns, :3], cover[..., None]], -1), ground)
