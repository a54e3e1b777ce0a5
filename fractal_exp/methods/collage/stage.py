"""What a stage of collage search is."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace

from ...runtime.deadline import Deadline
from . import maps as affine
from .image.crossing import Crossing
from .image.search import ImageSearch
from .measure.saturation import saturation_corrected
from .measure.search import MeasureSearch, Regime
from .problem import SearchProblem
from .state import Candidate, Key, State


class Stage(ABC):
    """One search of a round. name: as it is reported; order: the stages of a round in ascending order; ends_at: the
    parameter in `StageParams` that holds the share of a limited time at which the stage ends. A stage that has not
    begun by then is skipped."""

    name: str
    order: int
    ends_at: str
    search: MeasureSearch | ImageSearch | Crossing

    def __init__(self, problem: SearchProblem, number: int = 0, restart: int = 0):
        self.problem, self.params, self.round, self.restart = problem, problem.params, number, restart

    @property
    def key(self) -> Key:
        """Tells the stage from all others; later ones have higher keys."""
        return self.round, self.order, self.restart

    @property
    def expected_moves(self) -> int:
        """Moves that it is likely to make."""
        return 0

    @property
    def most_moves(self) -> int:
        """Moves at most."""
        return self.expected_moves

    @property
    def deadline(self) -> Deadline:
        """Rounds after the first share the time of the first one's last stage."""
        stages = self.params.stages
        return self.problem.deadline.until(stages.image_share if self.round else getattr(stages, self.ends_at))

    @abstractmethod
    def open(self, state: State) -> None:
        """Make ready; `state.current` is None when the stage begins, and not when it is resumed."""

    @abstractmethod
    def begin(self, state: State) -> Candidate:
        """The candidate to start with."""

    def is_wanted(self, state: State) -> bool:
        """Whether there is anything for it to do."""
        return True

    def step(self, now: Candidate, number: int) -> Candidate:
        """`now`, or a better one."""
        return self.search.step(now, number)

    def moved(self, state: State) -> State:
        """The state after one more move."""
        return state.moved(self.step(state.current, state.step))

    def is_settled(self, state: State) -> bool:
        """Whether there is nothing left to do, or no hope."""
        return False

    def close(self, state: State) -> State:
        """What the stage hands on."""
        return replace(state, best=state.current)

    def last_key(self, state: State) -> Key:
        """The last stage that is done with this one."""
        return self.key

    def _smaller_limit(self, state: State) -> float:
        """The most that the smaller singular value of a map may be. A symmetry of the shape explains its measure as
        well as the identity does: if a code with a near-isometry has failed, every other round keeps clear of them."""
        stages = self.params.stages
        if stages.avoid_isometries and not self.problem.levels.is_exact:
            return 1.0 if self.round % 2 else stages.contraction
        if not stages.avoid_isometries or state.before is None or not self.round % 2:
            return 1.0
        suspect = bool((affine.smaller_singular(state.before.maps) > stages.isometry).any())
        return stages.contraction if suspect else 1.0

    def _measure_search(self, state: State, found: Candidate | None, regime: Regime, seed: int) -> MeasureSearch:
        """On the image's measure, corrected for saturation by what was found."""
        problem, masses = self.problem, self.problem.masses_of(self.round)
        if found is not None:
            masses = saturation_corrected(masses, found.code, problem.levels, self.params.saturation, seed)
        return MeasureSearch(masses, regime, self.params, seed, self._smaller_limit(state))
