"""What all stages of collage search have in common."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Any

from ....runtime.deadline import Deadline
from ..state import Key, State
from .problem import SearchProblem


class Stage(ABC):
    """One stage of a search.

    It is asked whether it is wanted, opened, moved as long as it has moves and time and is not settled, and closed.
    Asking changes nothing. What is opened, moved or closed returns the search's next state; `state.current` is its
    candidate. A stage whose `current` is there already when it is opened is resumed.

    name: shown in reports; part: its name in `STAGES`, where it is not the same; ends_at: the share of its time at
    which it ends, see `Timetable.stage_end`. A stage that has not begun by `latest_start` is skipped.
    """

    name: str
    part: str = ""
    ends_at: float | None = None
    search: Any

    def __init__(self, problem: SearchProblem, number: int = 0, restart: float = 0):
        self.problem, self.params, self.round, self.restart = problem, problem.params, number, restart

    @property
    def key(self) -> Key:
        """Unique key of the stage."""
        return Key(self.round, self.part or self.name, self.restart)

    @property
    def expected_moves(self) -> int:
        """Expected number of moves."""
        return 0

    @property
    def most_moves(self) -> int:
        """Maximum number of moves."""
        return self.expected_moves

    @property
    def deadline(self) -> Deadline:
        """When the stage ends."""
        return self.problem.times.stage_end(self.round, self.ends_at)

    @property
    def latest_start(self) -> Deadline:
        """When it is too late for the stage to begin."""
        return self.deadline

    def is_wanted(self, state: State) -> bool:
        """Whether the stage has anything to do, after what the stages before it have found."""
        return True

    @abstractmethod
    def open(self, state: State) -> State:
        """Prepare the stage; the state with the candidate that it starts with."""

    def move(self, state: State) -> State:
        """The state after one more move: a step of the stage's search, where it has one."""
        return state.moved(self.search.step(state.now, state.step))

    def is_settled(self, state: State) -> bool:
        """Whether further moves are unnecessary or hopeless."""
        return False

    def close(self, state: State) -> State:
        """The state that the stage hands on."""
        return replace(state, best=state.current)
