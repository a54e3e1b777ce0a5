"""Attractors on a line, such as the Cantor set: what their maps do across the line cannot be seen."""

from __future__ import annotations

import torch
from torch import Tensor


def on_their_line(maps: Tensor, points: Tensor, thinnest: float) -> Tensor:
    """Replace maps (N,6) whose attractor lies on a line by similarities with the same effect along the line.

    Without this, the invisible part of a map is arbitrary, and products and inverses of maps mean nothing. points
    (P,2): of the attractor; thinnest: the maps stay as they are unless the standard deviation of the points across the
    line is below this, canvas units.
    """
    centre = points.mean(0)
    spread, axes = torch.linalg.eigh(torch.cov((points - centre).double().T))
    if float(spread[0].clamp_min(0).sqrt()) >= thinnest:
        return maps
    across, along = axes.T.to(maps)
    linear = maps[:, :4].unflatten(1, (2, 2))
    factor = torch.einsum("i,nij,j->n", along, linear, along)
    shift = (linear @ centre + maps[:, 4:] - centre) @ along
    new = factor[:, None, None] * torch.outer(along, along) + factor.abs()[:, None, None] * torch.outer(across, across)
    return torch.cat([new.flatten(1), centre + shift[:, None] * along - new @ centre], 1)
