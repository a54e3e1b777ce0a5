"""Add a map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from ..image.objective import Rendered
from .new_map import with_new_map

if TYPE_CHECKING:
    from .search import ImageSearch


def is_open(search: ImageSearch, shown: Rendered) -> bool:
    """True unless the code has as many maps as allowed."""
    n, params = len(shown.maps), search.params
    return n < (params.maps or params.most_maps or n + 1)


def neighbour(search: ImageSearch, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with a new map where mass is missing."""
    return search.polished_last(with_new_map(search, shown, shown, None, g), shown, search.params.moves.polish_new)
