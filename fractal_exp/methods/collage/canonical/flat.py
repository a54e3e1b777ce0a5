"""Attractors that lie on a line, Cantor's set for one: what a map does across the line cannot be seen."""

from __future__ import annotations

import torch
from torch import Tensor


def on_their_line(maps: Tensor, points: Tensor, thinnest: float) -> Tensor:
    """The maps (N,6) as similarities that keep the line on which the points (P,2) of their attractor lie, each with the
    same effect along the line; the maps themselves unless the points are thinner than `thinnest`, the standard
    deviation across, canvas units.

    Without this the part of a map that nobody sees is arbitrary, and products and inverses of maps mean nothing.
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
