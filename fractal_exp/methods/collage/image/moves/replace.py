"""Replace a map, small ones preferred, by a new one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from ..objective import Rendered
from .growth import grown, small_maps

if TYPE_CHECKING:
    from ..search import ImageSearch


def is_open(search: ImageSearch, shown: Rendered) -> bool:
    """If a map is left to stay."""
    return len(shown.maps) > 1


def neighbour(search: ImageSearch, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with a new map instead of one."""
    rest = search.objective.without(shown, small_maps(shown, g))
    return search.polished_last(grown(search, rest, shown, None, g), shown, search.params.moves.polish_new)
