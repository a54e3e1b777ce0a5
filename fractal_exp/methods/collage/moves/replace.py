"""Replace a map, small ones preferred, by a new one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from ..image.objective import Rendered
from .new_map import small_maps, with_new_map

if TYPE_CHECKING:
    from .search import ImageSearch


def is_open(search: ImageSearch, shown: Rendered) -> bool:
    """True if another map stays."""
    return len(shown.maps) > 1


def neighbour(search: ImageSearch, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with one map replaced by a new one."""
    rest = search.objective.without(shown, small_maps(shown, g))
    return search.polished_last(with_new_map(search, rest, shown, None, g), shown, search.params.moves.polish_new)
