"""The moves of stage 3, a file each: how a neighbour of a code is got, and when the move makes sense.

`MOVES` holds them by the name that their odds have in `MoveParams`. A new move is a module with both functions, an
entry here and its odds there.
"""

from __future__ import annotations

from types import ModuleType

from . import birth, remove, reorient, replace, root

MOVES: dict[str, ModuleType] = {"birth": birth, "reorient": reorient, "replace": replace, "remove": remove,
                                "root": root}
