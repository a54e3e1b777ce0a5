"""Replace a large map by its square or cube root, and prune. The code {f∘f, g, f∘g} has the same attractor as {f, g}.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from .. import maps as affine
from ..image.objective import Rendered

if TYPE_CHECKING:
    from .search import ImageSearch


def is_open(search: ImageSearch, shown: Rendered) -> bool:
    """True unless only two maps are left or their number is given."""
    return len(shown.maps) > 2 and not search.params.maps


def neighbour(search: ImageSearch, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with a root of one map, large ones preferred."""
    orders = search.params.moves.root_orders
    chosen = int(torch.multinomial(affine.volumes(shown.maps).cpu(), 1, generator=g))
    return rooted(search, shown, chosen, orders[int(torch.randint(len(orders), (), generator=g))])


def rooted(search: ImageSearch, shown: Rendered, chosen: int, order: int) -> Rendered:
    """The code with the root f of one map; unchanged if there is none or it does not help. Maps found beside a power of
    f may be f∘g instead of g, so pruning chooses between both."""
    params, objective = search.params.moves, search.objective
    if len(shown.maps) > params.root_maps and objective.is_hopeless(shown.error):
        return shown
    root = affine.root(shown.maps[chosen], order)
    if root is None:
        return shown
    others = torch.cat([shown.maps[:chosen], shown.maps[chosen + 1:]])
    alone = objective.judge(torch.cat([root[None], others]))
    if alone.error > params.root_error * max(shown.error, params.root_least):
        return shown
    both = objective.judge(torch.cat([root[None], others, affine.preceded(root, others)]))
    new = search.pruned(both)
    return shown if len(new.maps) > (search.params.most_maps or len(new.maps)) else search.polished_all(new, shown)
