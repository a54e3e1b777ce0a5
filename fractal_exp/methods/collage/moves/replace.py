"""Replace a map, small ones preferred, by a new one."""

from __future__ import annotations

import torch

from ..image.objective import Rendered
from .new_map import small_maps, with_new_map
from .tools import Tools


def is_open(tools: Tools, shown: Rendered) -> bool:
    """True if another map stays."""
    return len(shown.maps) > 1


def neighbour(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with one map replaced by a new one."""
    rest = tools.objective.without(shown, small_maps(shown, g))
    return tools.polished_last(with_new_map(tools, rest, shown, None, g), shown)
