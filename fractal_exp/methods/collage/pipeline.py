"""Collage search from top to bottom: rounds, stages and moves, over one resumable state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from ..base import time_is_up
from .stages.base import Stage
from .stages.image import last_stages, stages_of
from .stages.problem import SearchProblem
from .state import Candidate, State

Tell = Callable[[Stage, State], None]


class Pipeline:
    """One search. `state` is its current state. A search that starts from another's state continues it bit for bit, as
    if it had never stopped. on_move and on_stage are called after each move and after each stage."""

    def __init__(self, problem: SearchProblem, state: State, *, on_move: Tell, on_stage: Tell):
        self.problem, self.state = problem, state
        self.on_move, self.on_stage = on_move, on_stage

    def run(self) -> Candidate:
        """Run the search; return the best code found."""
        first = self.state.done[0] if self.state.done else 0
        for number in range(first, self.problem.rounds):
            for stage in stages_of(self.problem, number):
                self._stage(stage)
            if self.state.best is not None:  # a round leaves no best code if another round is worth while
                break
        for stage in last_stages(self.problem):
            self._stage(stage)
        return self.state.found

    def _stage(self, stage: Stage) -> None:
        """Run or resume the stage, unless it is done or no time is left."""
        state, deadline = self.state, stage.deadline
        if state.has_done(stage.key) or not stage.is_wanted(state):
            return
        if state.current is None and state.result is not None and stage.latest_start.passed:
            self.state = replace(state.closed(stage.key), stopped=time_is_up(self.problem.deadline.seconds or 0))
            return
        stage.open(state)
        if state.current is None:
            self.state = replace(state, current=stage.begin(state))
        while self.state.step < stage.most_moves and not deadline.passed and not stage.is_settled(self.state):
            self.state = stage.moved(self.state)
            self.on_move(stage, self.state)
        self.state = stage.close(self.state).closed(stage.key)
        self.on_stage(stage, self.state)
