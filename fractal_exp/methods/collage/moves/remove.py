"""Remove some maps, small ones preferred. Small maps that compensate for a wrong map hold it in place."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from ..image.objective import Rendered
from .new_map import small_maps

if TYPE_CHECKING:
    from .search import ImageSearch


def is_open(search: ImageSearch, shown: Rendered) -> bool:
    """True unless only two maps are left or their number is given."""
    return len(shown.maps) > 2 and not search.params.maps


def neighbour(search: ImageSearch, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code without the removed maps, with the others polished."""
    most = min(len(shown.maps) - 2, search.params.moves.remove_most)
    gone = small_maps(shown, g, 1 + int(torch.randint(most, (), generator=g)))
    return search.polished_all(search.objective.without(shown, gone), shown)
