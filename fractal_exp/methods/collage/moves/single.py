"""Add a map, replace one, remove some, or take the root of one. Small maps are preferred, save for roots.

A new map is the best of many candidates, judged first by the measure and finally by renderings.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from ....ifs import affine
from ....ops.collage import BinnedMeasure, Descent
from ..bins import halve
from ..image.objective import ImageObjective, Rendered, error_of
from ..limits import SMALLER
from ..measure.births import candidates, mirrored, narrowed, raced, reoriented, thinness, visible_weights
from ..simplify.loop import Draft
from .tools import Tools

CANDIDATES = 24      # per birth
BLOBS = CANDIDATES // 2   # candidates that take the shape of the uncovered blob; the others are random
THIN = 0.1           # ratio of width to length below which a map's image is a line
SIZES = 0.02, 0.95   # range of the larger singular value at birth
WIDTHS = 1.0, 0.25, 0.03   # factors on the width of a new map's image that are rendered; the last, of a reoriented line
VISIBLE_SHARES = 1.0, 0.5, 0.25, 0.1, 0.04, 0.015, 0.006   # of a map's weight that are tried: a thin image shows little
HEATS = (Descent(40, rate=0.02, prior=0.0), 6), (Descent(20, rate=0.005, prior=0.0), 3)   # see `births.HEATS`
REMOVED = 3          # maps, at most, that one move removes: small maps that compensate for a wrong map hold it in place
ORDERS = 2, 3        # of the roots that are tried: square and cube roots
ROOT_HOPEFUL = 30.0  # a root alone is tried with its company up to this factor on the error before, or on `ROOT_LEAST`
ROOT_LEAST = 0.5     # because a small error says nothing here: the company is missing
HOPELESS_MAPS = 10   # maximum number of maps of a hopeless code whose roots are tried: each takes 1.5 N² renderings
LARGEST = 2          # number of largest maps whose roots are tried at the start, and all of a code of
FEW = 5              # so few maps in a picture that others drew


def with_birth(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with a new map where mass is missing."""
    return tools.polished_last(with_new_map(tools, shown, shown, None, g), shown)


def with_replacement(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with one map replaced by a new one."""
    rest = tools.objective.without(shown, small_maps(shown, g))
    return tools.polished_last(with_new_map(tools, rest, shown, None, g), shown)


def with_removal(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code without some maps, with the others polished."""
    most = min(len(shown.maps) - 2, REMOVED)
    gone = small_maps(shown, g, 1 + int(torch.randint(most, (), generator=g)))
    return tools.polished_all(tools.objective.without(shown, gone), shown)


def with_root(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with a root of one map, large ones preferred. {f∘f, g, f∘g} has the same attractor as {f, g}."""
    chosen = int(torch.multinomial(affine.volumes(shown.maps).cpu(), 1, generator=g))
    return rooted(tools, shown, chosen, ORDERS[int(torch.randint(len(ORDERS), (), generator=g))])


def with_roots(tools: Tools, draft: Draft) -> Iterator[Draft]:
    """Codes with the root of one of the largest maps, for the start of the search."""
    params, shown = tools.params, draft.shown
    has_all = len(shown.maps) <= FEW and not tools.objective.levels.is_exact
    count = 0 if params.maps or not params.moves.root else len(shown.maps) if has_all else LARGEST
    for chosen in affine.volumes(shown.maps).argsort(descending=True)[:count].tolist():
        new = min((rooted(tools, shown, chosen, order) for order in ORDERS), key=tools.score)
        if new is not shown and not tools.deadline.passed:
            yield Draft(draft.objective, new)


def rooted(tools: Tools, shown: Rendered, chosen: int, order: int) -> Rendered:
    """The code with the root f of one map; unchanged if there is none or it does not help. Maps found beside a power of
    f may be f∘g instead of g, so pruning chooses between both."""
    objective = tools.objective
    if len(shown.maps) > HOPELESS_MAPS and objective.is_hopeless(shown.error):
        return shown
    root = affine.root(shown.maps[chosen], order)
    if root is None:
        return shown
    others = torch.cat([shown.maps[:chosen], shown.maps[chosen + 1:]])
    alone = objective.judge(torch.cat([root[None], others]))
    if alone.error > ROOT_HOPEFUL * max(shown.error, ROOT_LEAST):
        return shown
    both = objective.judge(torch.cat([root[None], others, affine.preceded(root, others)]))
    new = tools.pruned(both)
    return shown if len(new.maps) > (tools.params.most_maps or len(new.maps)) else tools.polished_all(new, shown)


def with_new_map(tools: Tools, rest: Rendered, shown: Rendered, old: Tensor | None, g: torch.Generator
                 ) -> Rendered:
    """`rest`, a part of the code `shown`, with the best of many new maps. They are born where mass is missing or, if
    the map `old` (6,) is given, which `rest` lacks, they are `old` in other orientations."""
    objective = tools.objective
    corrected = tools.corrected_measure(shown)
    measure, coarse = corrected.fine, corrected.coarse
    volume = affine.volumes(shown.maps).sum()
    explained = corrected.explained(rest, volume, objective)
    renderings = []
    if old is not None:
        born = reoriented(old, measure, CANDIDATES, g, reflections=tools.params.births.reflections)
        if thinness(old, measure) < THIN:  # no grid shows how a line was projected
            lines = narrowed(born, measure, WIDTHS[-1])
            renderings += [with_map(objective, rest, each, affine.volumes(each[None])[0] / volume) for each in lines]
    else:
        births = tools.params.births
        wanted = (measure.bins.clamp_min(0).sqrt() - explained.clamp_min(0).sqrt()).square() + 1e-12
        place = wanted if births.residual else measure.bins
        born = candidates(place, wanted, measure, SIZES, CANDIDATES, BLOBS, births, g)
    lacking = (measure.bins - explained).clamp_min(0).sum()
    weights = (affine.volumes(born) / volume).clamp_max(lacking).clamp_min(1e-6)
    weights = visible_weights(born, weights, coarse, halve(explained[None], coarse.size), VISIBLE_SHARES)
    (born,), (weights,) = raced(born[None], weights[None], (measure, coarse), HEATS, explained[None],
                                (objective.largest, SMALLER))
    renderings += _rendered(tools, rest, measure, born, weights)
    likeliest = min(renderings, key=error_of).maps[-1]
    models = [model for model in (likeliest, old) if model is not None] if tools.params.moves.mirrored else []
    for model in models:
        renderings += [with_map(objective, rest, each, weights[0]) for each in mirrored(model, measure)]
    return min(renderings, key=error_of)


def with_map(objective: ImageObjective, rest: Rendered, born: Tensor, weight: Tensor) -> Rendered:
    """The code with one map (6,) more."""
    return objective.judge(torch.cat([rest.maps, born[None]]),
                           None if rest.weights is None else torch.cat([rest.weights, weight[None]]))


def small_maps(shown: Rendered, g: torch.Generator, count: int = 1) -> list[int]:
    """Indices of random maps, small ones preferred."""
    return torch.multinomial(1 / affine.volumes(shown.maps).cpu(), count, generator=g).tolist()


def _rendered(tools: Tools, rest: Rendered, measure: BinnedMeasure, born: Tensor, weights: Tensor
              ) -> list[Rendered]:
    """The code with each of these maps (n,6): the first at several widths, the others at the width that suits it."""
    first = torch.cat([narrowed(born[:1], measure, width) for width in WIDTHS])
    tried = [with_map(tools.objective, rest, each, weights[0]) for each in first]
    width = min(range(len(WIDTHS)), key=lambda k: tried[k].error)
    return [*tried, *(with_map(tools.objective, rest, each, weight) for each, weight in
                      zip(narrowed(born[1:], measure, WIDTHS[width]), weights[1:], strict=True))]
