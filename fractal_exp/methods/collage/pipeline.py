"""Collage search from top to bottom: rounds, stages and moves, over one resumable state; and what it tells of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from torch import Tensor

from ...ifs.code import IFS
from ...runtime.deadline import NO_DEADLINE, TimeIsUp, ending
from ..base import OnStep, Progress, time_is_up
from .stages.base import Stage
from .stages.plan import Plan
from .state import Candidate, Key, State

ANOTHER_ROUND = 0.5   # probability that another round follows, assumed for the progress bar
Tell = Callable[[Stage, State], None]


class Pipeline:
    """One search. A search that starts from another's state continues it bit for bit, as if it had never stopped.

    state: the one that was told last; after an interruption, the search goes on from it and tells nothing twice.
    on_move and on_stage are called after each move and after each stage, save once the end of a stage was told.
    """

    def __init__(self, plan: Plan, state: State, *, on_move: Tell, on_stage: Tell,
                 save: Callable[[State], None] = lambda state: None):
        self.plan, self.state = plan, state
        self.at_work: Stage | None = None
        self.on_move, self.on_stage, self.save = on_move, on_stage, save

    def run(self) -> Candidate:
        """Run the search; return the best code found."""
        first = self.state.done.round if self.state.done else 0
        for stages in self.plan.rounds[first:]:
            for stage in stages:
                self._stage(stage)
            if self.state.best is not None:  # a round leaves no best code if another round is worth while
                break
        for stage in self.plan.last:
            self._stage(stage)
        return self.state.found

    def _stage(self, stage: Stage) -> None:
        """Run or resume the stage, unless it is done or no time is left. It is cut short when time is up."""
        state, self.at_work = self.state, stage
        if state.has_done(stage.key) or (state.is_outgrown and not stage.is_last_word) or not stage.is_wanted(state):
            return
        if state.current is None and state.result is not None and stage.latest_start.passed:
            self._skip(stage, state)
            return
        try:
            with ending(self.plan.problem.deadline if stage.ends_at_once and state.result else NO_DEADLINE):
                self._run(stage, state)
        except TimeIsUp:
            self._skip(stage, stage.cut_short(self.state))
            self.on_stage(stage, self.state)

    def hand_over(self) -> None:
        """Tell, after an interruption, what the stage at work has found so far, if that is anything to hand on."""
        if self.at_work and (state := self.at_work.cut_short(self.state)) is not self.state:
            self.on_stage(self.at_work, state)

    def _skip(self, stage: Stage, state: State) -> None:
        self.state = replace(state.closed(stage.key), stopped=time_is_up(self.plan.problem.deadline))

    def _run(self, stage: Stage, state: State) -> None:
        state, deadline = stage.open(state), stage.deadline
        while state.step < stage.most_moves and not deadline.passed and not stage.is_settled(state):
            state = stage.move(state)
            self.on_move(stage, state)
            self.state = state
        state = stage.close(state).closed(stage.key)
        self.on_stage(stage, state)
        self.state = state
        self.save(state)


class Place(NamedTuple):
    """A stage's place in a search: its number, from 0; the maximum number of moves before it; and how many moves are
    expected before it and in it."""

    number: int
    moves_before: int
    before: float
    expected: float


class Teller:
    """Reports to `on_step`: scores and the number of moves after each move, sometimes a preview, the candidate as long
    as no stage has ended, and the code at the end of each stage."""

    def __init__(self, on_step: OnStep | None, plan: Plan, previews: int, render: Callable[[IFS], Tensor]):
        self.on_step, self.deadline, self.render = on_step, plan.problem.deadline, render
        self.places: dict[Key, Place] = {}
        moves, expected = 0, 0.0
        for number, stage in enumerate(plan.stages):
            place = Place(number, moves, expected, ANOTHER_ROUND**stage.round * stage.expected_moves)
            self.places[stage.key] = place
            moves, expected = moves + stage.most_moves, expected + place.expected
        self.expected = max(1.0, expected)
        self.every = max(1, int(self.expected) // previews) if previews else 0

    def move(self, stage: Stage, state: State) -> None:
        """Report a move."""
        if self.on_step:
            step = self.places[stage.key].moves_before + state.step
            wanted = self.every and step % self.every == 0
            preview = self.render(state.now.code) if wanted else None
            first = state.now.code if state.result is None else None  # later stages may begin with a worse one
            self._tell(self.on_step, stage, state.step, state.now, preview=preview, candidate=first)

    def stage(self, stage: Stage, state: State) -> None:
        """Report the end of a stage, unless time was up before anything was found."""
        if self.on_step and state.result:
            self._tell(self.on_step, stage, stage.most_moves, state.result, code=state.result.code)

    def fraction(self, stage: Stage, step: int) -> float:
        """The share that is done after `step` moves of a stage: of all expected moves, or of the time if that is
        more."""
        place = self.places[stage.key]
        done = place.before + min(step / max(stage.expected_moves, 1), 1) * place.expected
        return min(1.0, max(done / self.expected, self.deadline.used))

    def _tell(self, on_step: OnStep, stage: Stage, step: int, now: Candidate, *, preview: Tensor | None = None,
              code: IFS | None = None, candidate: IFS | None = None) -> None:
        place = self.places[stage.key]
        scalars = {"score": now.score, "error": now.error, "maps": float(len(now.maps)), "stage": float(place.number)}
        on_step(Progress(place.moves_before + step, self.fraction(stage, step), scalars, stage=stage.name,
                         preview=preview, code=code, candidate=candidate, camera=now.camera))
