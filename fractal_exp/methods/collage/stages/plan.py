"""Which stages a search has, in order."""

from __future__ import annotations

from itertools import chain

from .base import SearchProblem, Stage
from .image import Approach, FullSize, ImageMoves, Rounding
from .measure import Detail, FromMixture, Restart


class Plan:
    """All stages that a search may have, one instance of each: `rounds` of them, and the `last` ones, after all rounds.

    Images of other kinds have a subclass, see `stages.plan_of`.
    """

    rounding: type[Stage] = Rounding

    def __init__(self, problem: SearchProblem):
        self.problem, searches = problem, not problem.params.grows_at_once
        self.rounds = [self.round(number) for number in range(problem.rounds)] if searches else []
        self.last = self.polish() if searches else []
        if problem.params.growth.enabled:
            from .growth import Growth

            self.last.append(Growth(problem, problem.rounds))

    @property
    def stages(self) -> list[Stage]:
        return [*chain(*self.rounds), *self.last]

    def round(self, number: int) -> list[Stage]:
        approach = [Approach(self.problem, number)] if self.problem.is_reduced else []
        return [*self.search(number), *approach, *self.moves(number)]

    def search(self, number: int) -> list[Stage]:
        restarts = [Restart(self.problem, number, restart) for restart in range(self.problem.restarts(number))]
        return [*restarts, FromMixture(self.problem, number), Detail(self.problem, number)]

    def moves(self, number: int) -> list[Stage]:
        """Those that move single maps of a nearly right code."""
        return [ImageMoves(self.problem, number)]

    def polish(self) -> list[Stage]:
        """Those that polish the best code of all rounds."""
        problem = self.problem
        full = [FullSize(problem, problem.rounds)] if problem.full_side > len(problem.image) else []
        return [*full, *([self.rounding(problem, problem.rounds)] if problem.params.rounding.enabled else [])]
