"""Remove one to three maps, small ones preferred: small maps that make up for what is wrong in another hold it where it
is."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch

from ..objective import Rendered
from .growth import small_maps

if TYPE_CHECKING:
    from ..search import ImageSearch


def is_open(search: ImageSearch, shown: Rendered) -> bool:
    """Unless two are left, or the number is given."""
    return len(shown.maps) > 2 and not search.params.maps


def neighbour(search: ImageSearch, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code without the maps, the others polished."""
    most = min(len(shown.maps) - 2, search.params.moves.remove_most)
    gone = small_maps(shown, g, 1 + int(torch.randint(most, (), generator=g)))
    return search.polished_all(search.objective.without(shown, gone), shown)
