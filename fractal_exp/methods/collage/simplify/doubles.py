"""Codes without maps that only make lines thicker, which is the pen's job."""

from __future__ import annotations

import torch

from ....cameras.points import attractor_points
from ....ifs import affine
from ..params import CollageParams
from ..state import WeightedMaps

NEAR_PX = 2.0     # distance (rms, pixels) below which two maps count as one: a pen is rarely thinner
POINTS = 20_000   # of the attractor, that measure this distance


def without_doubles(found: WeightedMaps, params: CollageParams, side: int, seed: int) -> WeightedMaps:
    """The code without its doubles in an image of `side` pixels, if at least two maps stay and no number of maps is
    asked for. A map is a double if it sends the attractor to nearly where a heavier map sends it, which gets its
    weight. No error is compared: until a camera is known, the error of a thicker line says nothing."""
    if params.maps:
        return found
    points = attractor_points(found.maps, found.probabilities, POINTS, seed)
    images, weights = affine.images(found.maps, points), found.probabilities
    apart = (images[:, None] - images[None]).square().sum(-1).mean(-1).sqrt()
    kept: list[int] = []
    for i in weights.argsort(descending=True, stable=True).tolist():
        same = [k for k in kept if float(apart[i, k]) < 2 / side * NEAR_PX]
        if same:
            weights = weights.index_add(0, torch.tensor(same[:1], device=weights.device), weights[i:i + 1])
        else:
            kept.append(i)
    kept.sort()
    alone = len(kept) < 2 or len(kept) == len(found.maps)
    return found if alone else WeightedMaps(found.maps[kept], weights[kept])
