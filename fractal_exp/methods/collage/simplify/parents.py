"""Codes of fewer maps for the same shape, with parents in the place of some maps, or without contained maps.

A parent is a map g of which a code only holds compositions g∘f with its other maps, as for half of a dragon curve. A
contained map is such a g∘f beside g.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d

from ....cameras.points import attractor_points
from ....ifs import affine
from ....ifs.canvas import canvas_to_pixel
from ....runtime.seeds import derive
from ..image.objective import ImageObjective, Rendered
from ..limits import SMALLER
from .flat import flattened
from .loop import Draft, fewest
from .symmetry import symmetries

TRIED = 6         # parents, the largest ones: each is polished
INSIDE = 0.97     # share of points: of the attractor's that a parent must send to lit pixels, and of a map's image that
#                   lie within that of a larger map if the map is contained. Some points miss it by chance.
POINTS = 20_000   # of the attractor, in this test


def fewer(draft: Draft) -> Iterator[Draft]:
    """Parents in the place of maps, or no contained maps, for a code of few maps whose number was not asked for."""
    params = draft.objective.params
    if not params.maps and len(draft.shown.maps) <= params.simplify.parent_maps:
        yield from parents(draft)
        yield from uncontained(draft)


def parents(draft: Draft) -> Iterator[Draft]:
    """One code for each parent, which replaces the maps whose images lie within its own. A parent is f∘h⁻¹ or f∘s∘h⁻¹,
    with maps f and h of the code and a symmetry s of the shape. It must be contractive and send the attractor to where
    the image is lit."""
    objective, shown = draft.objective, draft.shown
    params, image, side = objective.params, objective.image.cpu(), len(objective.image)
    points, maps = _points(objective, shown), flattened(objective, shown).cpu()
    found = _undone(maps, symmetries(image, params.rounding))
    found = found[_inside(affine.images(found, points), image > 0) >= INSIDE]
    found = found[affine.volumes(found).argsort(descending=True, stable=True)][:TRIED]
    images = affine.images(maps, points)
    for parent, own in zip(found, affine.images(found, points), strict=True):
        rest = _inside(images, _lit(own, side)) < INSIDE
        weights = None
        if shown.weights is not None:
            own_share = shown.weights[~rest.to(shown.weights.device)].sum()
            weights = torch.cat([own_share[None], shown.weights[rest.to(shown.weights.device)]])
        if bool(rest.any()):
            yield draft.judged(torch.cat([parent[None], maps[rest]]).to(shown.maps), weights)


def uncontained(draft: Draft) -> Iterator[Draft]:
    """The code without its contained maps, if there are any, except for as many as must stay.

    A map is contained if its image lies within the image of a larger map, as that of f∘g lies within that of f. Without
    it, the attractor is still the union of its images, so it is the same. The larger map gets its weight."""
    objective, shown = draft.objective, draft.shown
    if objective.params.simplify.needless is None:
        return
    images, weights = affine.images(shown.maps.cpu(), _points(objective, shown)), shown.probabilities.cpu().clone()
    order = affine.volumes(shown.maps.cpu()).argsort(stable=True)
    lit = [_lit(each, len(objective.image)) for each in images]
    shares = torch.stack([_inside(images, each) for each in lit], 1)   # of the rows in the columns
    kept = order.tolist()
    for place, number in enumerate(order[:-1].tolist()):
        larger = order[place + 1:]
        most = shares[number, larger].argmax()
        if shares[number, larger[most]] >= INSIDE and len(kept) > fewest(objective.params):
            weights[larger[most]] += weights[number]
            kept.remove(number)
    kept.sort()
    if len(kept) < len(order):
        yield draft.judged(shown.maps[kept], None if shown.weights is None else weights[kept].to(shown.weights))


def _points(objective: ImageObjective, shown: Rendered) -> Tensor:
    """Points (P,2) of the attractor; not by maps that hardly contract across a line, which reach it slowly."""
    return attractor_points(flattened(objective, shown), shown.probabilities, POINTS,
                            derive(objective.seed, "parents")).cpu()


def _undone(maps: Tensor, group: list[Tensor]) -> Tensor:
    """All contractive f∘s∘h⁻¹ (n,6), with f and h among the maps (N,6) and s in the group."""
    back = [each for each in map(affine.inverse, maps) if each is not None]
    found = [affine.composed(affine.composed(one, symmetry), each) for one in maps for symmetry in group
             for each in back]
    every = torch.stack(found) if found else maps[:0]
    return every[affine.largest_singular(every) < SMALLER]


def _lit(points: Tensor, side: int) -> Tensor:
    """The pixels (R,R) of points (P,2)."""
    mask = torch.zeros(side, side, dtype=torch.bool)
    row, column = canvas_to_pixel(points, side).long().clamp(0, side - 1).unbind(-1)
    mask[row, column] = True
    return mask


def _inside(points: Tensor, mask: Tensor) -> Tensor:
    """The shares (n,) of points (n,P,2) within a pixel of a mask (R,R)."""
    side = len(mask)
    wide = max_pool2d(mask.float()[None], 3, 1, 1)[0]
    place = canvas_to_pixel(points, side).long()
    known = ((place >= 0) & (place < side)).all(-1)
    row, column = place.clamp(0, side - 1).unbind(-1)
    return (wide[row, column] * known).mean(1)
