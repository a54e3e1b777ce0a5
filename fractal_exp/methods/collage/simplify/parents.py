"""Codes of fewer maps for the same shape, with parents in the place of some maps, or without contained maps.

A parent is a map g of which a code only holds compositions g∘f with its other maps, as for half of a dragon curve. A
contained map is such a g∘f beside g.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import max_pool2d

from ....cameras.points import attractor_points
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from .. import maps as affine
from ..image.gauss_newton import polished
from ..image.objective import ImageObjective, Rendered
from .flat import on_their_line
from .pruning import Price
from .symmetry import symmetries


def with_fewer_maps(objective: ImageObjective, shown: Rendered, price: Price, steps: int,
                    deadline: Deadline = NO_DEADLINE) -> Rendered:
    """Replace maps of the code by parents, one parent at a time, or remove all contained maps, as long as the score
    falls at this price per map. Each code that is tried is polished for `steps` steps."""
    while len(shown.maps) <= objective.params.moves.parent_maps and not deadline.passed:
        fewer = with_parents(objective, shown)
        if objective.params.moves.needless is not None:
            fewer.append(without_contained(objective, shown, least=2))
        tried = [polished(objective, each, steps, deadline=deadline) for each in fewer if each is not shown]
        best = min([shown, *tried], key=lambda each: price.score(each.error, len(each.maps)))
        if best is shown:
            break
        shown = best
    return shown


def with_parents(objective: ImageObjective, shown: Rendered) -> list[Rendered]:
    """One code for each parent, which replaces the maps whose images lie within its own. A parent is f∘h⁻¹ or f∘s∘h⁻¹,
    with maps f and h of the code and a symmetry s of the shape. It must be contractive and send the attractor to where
    the image is lit. At most the `MoveParams.parent_tried` largest are tried."""
    params, side = objective.params.moves, len(objective.image)
    points, maps = _points(objective, shown), flattened(objective, shown).cpu()
    found = _undone(maps, symmetries(objective.image.cpu(), objective.params.canonical),
                    objective.params.gauss_newton.largest)
    found = found[_inside(_images(found, points), objective.image.cpu() > 0) >= params.parent_inside]
    found = found[affine.volumes(found).argsort(descending=True, stable=True)][:params.parent_tried]
    images, judged = _images(maps, points), []
    for parent, own in zip(found, _images(found, points), strict=True):
        rest = _inside(images, _lit(own, side)) < params.parent_inside
        weights = None
        if shown.weights is not None:
            own_share = shown.weights[~rest.to(shown.weights.device)].sum()
            weights = torch.cat([own_share[None], shown.weights[rest.to(shown.weights.device)]])
        if bool(rest.any()):
            judged.append(objective.judge(torch.cat([parent[None], maps[rest]]).to(shown.maps), weights))
    return judged


def without_contained(objective: ImageObjective, shown: Rendered, least: int) -> Rendered:
    """The code without its contained maps, except that at least `least` maps stay. If all maps stay, `shown` itself.

    A map is contained if its image lies within the image of a larger map, as that of f∘g lies within that of f. Without
    it, the attractor is still the union of its images, so it is the same. The larger map gets its weight."""
    inside, side = objective.params.moves.parent_inside, len(objective.image)
    images, weights = _images(shown.maps.cpu(), _points(objective, shown)), shown.probabilities.cpu().clone()
    order = affine.volumes(shown.maps.cpu()).argsort(stable=True)
    shares = torch.stack([_inside(images, _lit(each, side)) for each in images], 1)   # of the rows in the columns
    kept = order.tolist()
    for place, number in enumerate(order[:-1].tolist()):
        larger = order[place + 1:]
        most = shares[number, larger].argmax()
        if shares[number, larger[most]] >= inside and len(kept) > least:
            weights[larger[most]] += weights[number]
            kept.remove(number)
    kept.sort()
    own = None if shown.weights is None else weights[kept].to(shown.weights)
    return objective.judge(shown.maps[kept], own) if len(kept) < len(order) else shown


def flattened(objective: ImageObjective, shown: Rendered) -> Tensor:
    """The maps (N,6) of a code after `on_their_line`."""
    thinnest = 2 / len(objective.image) * objective.params.moves.flat_px
    return on_their_line(shown.maps.cpu(), shown.probabilities.cpu(), thinnest).to(shown.maps)


def _points(objective: ImageObjective, shown: Rendered) -> Tensor:
    """Points (P,2) of the attractor; not by maps that hardly contract across a line, which reach it slowly."""
    return attractor_points(flattened(objective, shown), shown.probabilities, objective.params.moves.parent_points,
                            derive(objective.seed, "parents")).cpu()


def _undone(maps: Tensor, group: list[Tensor], largest: float) -> Tensor:
    """All contractive f∘s∘h⁻¹ (n,6), with f and h among the maps (N,6) and s in the group."""
    back = [each for each in map(affine.inverse, maps) if each is not None]
    found = [affine.composed(affine.composed(one, symmetry), each) for one in maps for symmetry in group
             for each in back]
    every = torch.stack(found) if found else maps[:0]
    return every[affine.largest_singular(every) < largest]


def _images(maps: Tensor, points: Tensor) -> Tensor:
    """Where maps (n,6) send points (P,2): (n,P,2)."""
    return points @ maps[:, :4].unflatten(1, (2, 2)).transpose(1, 2) + maps[:, None, 4:]


def _lit(points: Tensor, side: int) -> Tensor:
    """The pixels (R,R) of points (P,2)."""
    mask = torch.zeros(side, side, dtype=torch.bool)
    column, row = _pixels(points, side)
    mask[row.clamp(0, side - 1), column.clamp(0, side - 1)] = True
    return mask


def _inside(points: Tensor, mask: Tensor) -> Tensor:
    """The shares (n,) of points (n,P,2) within a pixel of a mask (R,R)."""
    side = len(mask)
    wide = max_pool2d(mask.float()[None], 3, 1, 1)[0]
    column, row = _pixels(points, side)
    known = (column >= 0) & (column < side) & (row >= 0) & (row < side)
    return (wide[row.clamp(0, side - 1), column.clamp(0, side - 1)] * known).mean(1)


def _pixels(points: Tensor, side: int) -> tuple[Tensor, Tensor]:
    column, row = ((points * points.new_tensor([1, -1]) + 1) * (side / 2)).long().unbind(-1)
    return column, row
