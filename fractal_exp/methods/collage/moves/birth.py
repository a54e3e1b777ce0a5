"""Add a map."""

from __future__ import annotations

import torch

from ..image.objective import Rendered
from .new_map import with_new_map
from .tools import Tools


def is_open(tools: Tools, shown: Rendered) -> bool:
    """True unless the code has as many maps as allowed."""
    n, params = len(shown.maps), tools.params
    return n < (params.maps or params.most_maps or n + 1)


def neighbour(tools: Tools, shown: Rendered, g: torch.Generator) -> Rendered:
    """The code with a new map where mass is missing."""
    return tools.polished_last(with_new_map(tools, shown, shown, None, g), shown)
