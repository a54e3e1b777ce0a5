"""The moves of stage 3, one file each: how a move makes a neighbour of a code, and when it makes sense.

`MOVES` maps names to moves; their odds in `MoveParams` have the same names. A new move is a module with both functions,
an entry here and its odds there.
"""

from __future__ import annotations

from types import ModuleType

from . import birth, remove, reorient, replace, root

MOVES: dict[str, ModuleType] = {"birth": birth, "reorient": reorient, "replace": replace, "remove": remove,
                                "root": root}
