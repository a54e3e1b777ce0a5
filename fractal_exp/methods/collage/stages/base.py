"""The base class of all stages of collage search."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import Generic, TypeVar

from ....cameras.kinds import with_camera
from ....runtime.deadline import Deadline
from .. import maps as affine
from ..measure.saturation import saturation_corrected
from ..measure.search import MeasureSearch, Regime
from ..moves.search import ImageSearch
from ..state import Candidate, Key, State
from .crossing import Crossing
from .problem import SearchProblem

Search = TypeVar("Search", MeasureSearch, ImageSearch, Crossing)


class Stage(ABC, Generic[Search]):
    """One stage of a round. name: shown in reports; part: its name in `STAGES`, where it is not the same; ends_at: the
    parameter in `StageParams` with the share of the time limit at which the stage ends. A stage that has not begun by
    then is skipped."""

    name: str
    part: str = ""
    ends_at: str
    search: Search

    def __init__(self, problem: SearchProblem, number: int = 0, restart: int = 0):
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
        """When the stage ends. All stages after the full rounds have the time of stage 3 of the last full round."""
        return self._until("image_share" if self.round >= self.problem.full_rounds else self.ends_at)

    @property
    def latest_start(self) -> Deadline:
        """When it is too late for the stage to begin."""
        return self.deadline

    def _until(self, share: str) -> Deadline:
        """The end of a share, named in `StageParams`, of the round's part of the time limit."""
        return self._part_until(self._share(share))

    def _share(self, name: str) -> float:
        return getattr(self.params.stages, self.problem.image_share_name if name == "image_share" else name)

    def _part_until(self, share: float) -> Deadline:
        parts = self.problem.full_rounds
        return self.problem.deadline.until((min(self.round, parts - 1) + share) / parts)

    @abstractmethod
    def open(self, state: State) -> None:
        """Prepare the stage. `state.current` is None at its beginning, but not when it is resumed."""

    @abstractmethod
    def begin(self, state: State) -> Candidate:
        """The candidate to start with."""

    def is_wanted(self, state: State) -> bool:
        """Whether the stage has anything to do, after what the stages before it have found."""
        return True

    def step(self, now: Candidate, number: int) -> Candidate:
        """`now`, or a better candidate."""
        return self.search.step(now, number)

    def moved(self, state: State) -> State:
        """The state after one more move."""
        return state.moved(self.step(state.now, state.step))

    def is_settled(self, state: State) -> bool:
        """Whether further moves are unnecessary or hopeless."""
        return False

    def close(self, state: State) -> State:
        """The state that the stage hands on."""
        return replace(state, best=state.current)

    def _smaller_limit(self, state: State) -> float:
        """Upper limit of a map's smaller singular value. A symmetry of the shape explains its measure as well as the
        identity does, so after a code with a near-isometry has failed, every other round avoids near-isometries. The
        first and third rounds avoid them in pictures that others drew, and in binary images that may have several
        rounds."""
        stages, levels = self.params.stages, self.problem.levels
        if not levels.is_exact:
            avoided = self.round % 2 == 0
        elif not levels.is_graded:
            avoided = self.round % 2 == 0 and self.problem.rounds > 1
        else:
            avoided = self.round % 2 == 1 and self._has_failed_with_isometry(state)
        return stages.contraction if stages.avoid_isometries and avoided else 1.0

    def _has_failed_with_isometry(self, state: State) -> bool:
        """Whether the code of an earlier round has a near-isometry."""
        earlier = state.before
        return earlier is not None and bool((affine.smaller_singular(earlier.maps) > self.params.stages.isometry).any())

    def _measure_search(self, state: State, found: Candidate | None, regime: Regime, seed: int) -> MeasureSearch:
        """The search on the image's measure, which `found` corrects for saturation."""
        masses = self.problem.masses_of(self.round, state.measured_through)
        if found is not None:
            levels = with_camera(self.problem.levels, state.measured_through)
            masses = saturation_corrected(masses, found.code, levels, self.params.saturation, seed)
        return MeasureSearch(masses, regime, self.params, seed, self._smaller_limit(state))
