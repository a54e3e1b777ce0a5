"""Remove some maps, small ones preferred. Small maps that compensate for a wrong map hold it in place."""

from __future__ import annotations

import torch

from ..image.objective import Rendered
from .new_map import small_maps
from .tools import Tools

MOST = 3   # maps that one move removes


def is_open(tools: Tools, shown: Rendered) -> bool:
    """True unless only two maps are left or their number is given."""
    return len(shown.maps) > 2 and not tools.params.maps


def neighbour(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code without the removed maps, with the others polished."""
    most = min(len(shown.maps) - 2, MOST)
    gone = small_maps(shown, g, 1 + int(torch.randint(most, (), generator=g)))
    return tools.polished_all(tools.objective.without(shown, gone), shown)
