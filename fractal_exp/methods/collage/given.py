"""A search that begins with a code that somebody made, in place of its own search on the measure."""

from __future__ import annotations

from ...ifs.affine import from_code
from ...ifs.code import IFS
from ...runtime.checkpoint import Snapshot
from .stages.measure import Detail
from .state import Candidate, Key, State

# Another round, growth, and the search for the few maps of a construction would begin without the code.
OPTIONS = {"rounds": 1, "growth": {"enabled": False}, "camera": {"constructions": False}}


def found_already(code: IFS) -> Snapshot:
    """What a checkpoint holds of a search whose first round has found `code`, and has yet to judge it by renderings.

    A search that is resumed from it with `OPTIONS` improves the code.
    """
    best = Candidate(from_code(code).float(), code.probabilities, float("inf"))
    return State(done=Key(0, Detail.name), best=best).snapshot()
