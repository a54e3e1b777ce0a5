"""Replace a large map by its square or cube root, and prune. The code {f∘f, g, f∘g} has the same attractor as {f, g}.
"""

from __future__ import annotations

from collections.abc import Iterator

import torch

from .. import maps as affine
from ..image.objective import Rendered
from ..simplify.loop import Draft
from .tools import Tools

ORDERS = 2, 3        # of the roots that are tried: square and cube roots
HOPEFUL = 30.0       # a root alone is tried with its company up to this factor on the error before, or on `LEAST`
LEAST = 0.5          # because a small error says nothing here: the company is missing
HOPELESS_MAPS = 10   # maximum number of maps of a hopeless code whose roots are tried: each takes 1.5 N² renderings
LARGEST = 2          # number of largest maps whose roots are tried at the start, and all of a code of
FEW = 5              # so few maps in a picture that others drew


def is_open(tools: Tools, shown: Rendered) -> bool:
    """True unless only two maps are left or their number is given."""
    return len(shown.maps) > 2 and not tools.params.maps


def neighbour(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with a root of one map, large ones preferred."""
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
    if alone.error > HOPEFUL * max(shown.error, LEAST):
        return shown
    both = objective.judge(torch.cat([root[None], others, affine.preceded(root, others)]))
    new = tools.pruned(both)
    return shown if len(new.maps) > (tools.params.most_maps or len(new.maps)) else tools.polished_all(new, shown)
