"""Attractors on a line, such as the Cantor set: what their maps do across the line cannot be seen."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from ..image.objective import ImageObjective, Rendered
from .loop import Draft

FLAT_PX = 0.75   # standard deviation across a line, pixels, below which a shape is assumed to lie on the line


def on_line(draft: Draft) -> Iterator[Draft]:
    """Similarities in the place of the maps, if the shape lies on a line."""
    flat = flattened(draft.objective, draft.shown)
    if not torch.equal(flat, draft.shown.maps):
        yield draft.judged(flat, draft.shown.weights)


def flattened(objective: ImageObjective, shown: Rendered) -> Tensor:
    """The maps (N,6) of a code after `on_their_line`."""
    thinnest = 2 / len(objective.image) * FLAT_PX
    return on_their_line(shown.maps.cpu(), shown.probabilities.cpu(), thinnest).to(shown.maps)


def on_their_line(maps: Tensor, probabilities: Tensor, thinnest: float) -> Tensor:
    """Replace contractive maps (N,6) whose attractor lies on a line by similarities with the same effect along it.

    Without this, the invisible part of a map is arbitrary, and products and inverses of maps mean nothing.
    probabilities (N,): of the maps; thinnest: the maps stay as they are unless the standard deviation of the attractor
    across the line is below this, canvas units.
    """
    centre, covariance = _moments(maps.double(), probabilities.double())
    spread, axes = torch.linalg.eigh(covariance)
    if float(spread[0].clamp_min(0).sqrt()) >= thinnest:
        return maps
    across, along = axes.T.to(maps)
    centre, linear = centre.to(maps), maps[:, :4].unflatten(1, (2, 2))
    factor = torch.einsum("i,nij,j->n", along, linear, along)
    shift = (linear @ centre + maps[:, 4:] - centre) @ along
    new = factor[:, None, None] * torch.outer(along, along) + factor.abs()[:, None, None] * torch.outer(across, across)
    return torch.cat([new.flatten(1), centre + shift[:, None] * along - new @ centre], 1)


def _moments(maps: Tensor, probabilities: Tensor) -> tuple[Tensor, Tensor]:
    """Mean (2,) and covariance (2,2) of the invariant measure, which the maps send to itself. Both solve a linear
    equation. Points of the chaos game would not do: those of a near isometry take long to reach a line."""
    share, linear, offset = probabilities / probabilities.sum(), maps[:, :4].unflatten(1, (2, 2)), maps[:, 4:]
    identity = torch.eye(4).to(maps)
    mean = torch.linalg.solve(identity[:2, :2] - torch.einsum("n,nij->ij", share, linear), share @ offset)
    away = linear @ mean + offset - mean
    squares = torch.einsum("n,nij,nkl->ikjl", share, linear, linear).reshape(4, 4)
    between = torch.einsum("n,ni,nk->ik", share, away, away).flatten()
    return mean, torch.linalg.solve(identity - squares, between).view(2, 2)
