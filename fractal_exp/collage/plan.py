"""The stages of collage search in order."""

from __future__ import annotations

from .framing import Framing
from .stages import Approach, Closing, Detail, Full, Island, Problem, Retouch, Stage


def plan(problem: Problem, *, rounds: int, islands: int, moves: int, detail_moves: int, picture_moves: int
         ) -> list[Stage]:
    """The stages in order; half as many islands in rounds after the first."""
    stages, fewer = [], (islands + 1) // 2
    for number in range(rounds):
        count = fewer if number else islands
        stages += [Island(problem, moves, 1000 * number + island, count - 1 - island) for island in range(count)]
        stages += [Closing(problem, moves if islands > 1 else 0, number), Detail(problem, detail_moves, number)]
        approach = [Approach(problem, 0, number)] if problem.is_reduced else []
        others = (rounds - 1 - number) * (fewer + 3 + len(approach))
        stages += [*approach, Retouch(problem, picture_moves, number, others)]
        for stage in stages[-count - 3 - len(approach):] if number else []:
            stage.ends = Retouch.ends
    stages.append(Framing(problem, picture_moves // 2))
    return [*stages, *([Full(problem, 0)] if problem.full_side > len(problem.image) else [])]
