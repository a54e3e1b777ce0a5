"""Report the progress of a search."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import takewhile

from torch import Tensor

from ...ifs.code import IFS
from ..base import OnStep, Progress
from .stages.base import Stage
from .stages.image import last_stages, stages_of
from .stages.problem import SearchProblem
from .state import Candidate, State

ANOTHER_ROUND = 0.5   # probability that another round follows, assumed for the progress bar


class Course:
    """All stages that a search may have, their numbers, and how many moves each is expected to take."""

    def __init__(self, problem: SearchProblem):
        rounds = [stage for number in range(problem.rounds) for stage in stages_of(problem, number)]
        self.stages = {stage.key: stage for stage in [*rounds, *last_stages(problem)]}
        self.total = max(1.0, sum(map(self._expected, self.stages.values())))

    @staticmethod
    def _expected(stage: Stage) -> float:
        return ANOTHER_ROUND**stage.round * stage.expected_moves

    def _before(self, stage: Stage) -> Iterator[Stage]:
        """All earlier stages."""
        return takewhile(lambda each: each.key != stage.key, self.stages.values())

    def number(self, stage: Stage) -> int:
        """The stage's number, from 0."""
        return list(self.stages).index(stage.key)

    def moves_before(self, stage: Stage) -> int:
        """Maximum number of moves of all earlier stages."""
        return sum(each.most_moves for each in self._before(stage))

    def fraction(self, stage: Stage, step: int) -> float:
        """The share of all expected moves that is done after `step` moves of a stage."""
        before = sum(map(self._expected, self._before(stage)))
        return (before + min(step / max(stage.expected_moves, 1), 1) * self._expected(stage)) / self.total


class Teller:
    """Reports to `on_step`: scores and the number of moves after each move, sometimes a preview, the candidate as long
    as no stage has ended, and the code at the end of each stage."""

    def __init__(self, on_step: OnStep | None, problem: SearchProblem, previews: int, render: Callable[[IFS], Tensor]):
        self.on_step, self.problem, self.render, self.course = on_step, problem, render, Course(problem)
        self.every = max(1, int(self.course.total) // previews) if previews else 0

    def move(self, stage: Stage, state: State) -> None:
        """Report a move."""
        if self.on_step:
            step = self.course.moves_before(stage) + state.step
            wanted = self.every and step % self.every == 0
            preview = self.render(state.now.code) if wanted else None
            first = state.now.code if state.result is None else None  # later stages may begin with a worse one
            self._tell(self.on_step, stage, state.step, state.now, preview=preview, candidate=first)

    def stage(self, stage: Stage, state: State) -> None:
        """Report the end of a stage."""
        if self.on_step:
            self._tell(self.on_step, stage, stage.most_moves, state.found, code=state.found.code)

    def _tell(self, on_step: OnStep, stage: Stage, step: int, now: Candidate, *, preview: Tensor | None = None,
              code: IFS | None = None, candidate: IFS | None = None) -> None:
        scalars = {"score": now.score, "error": now.error, "maps": float(len(now.maps)),
                   "stage": float(self.course.number(stage))}
        done = max(self.course.fraction(stage, step), self.problem.deadline.used)
        on_step(Progress(self.course.moves_before(stage) + step, min(1.0, done), scalars, stage=stage.name,
                         preview=preview, code=code, candidate=candidate))
