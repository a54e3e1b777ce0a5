"""A drawing of a recursion that ended after few steps: found as few maps, and seen as strokes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ...runtime.seeds import derive
from .image.camera import as_seen, in_turns
from .image.likeness import likeness_of
from .image.objective import ImageObjective, Rendered
from .maps import WeightedMaps
from .measure.pens import Drawn
from .measure.search import MeasureSearch, Regime
from .measure.tones import camera_of, seen_with
from .problem import SearchProblem
from .stage import Stage
from .state import Candidate, State


class Recursion(Stage[Any]):
    """Searches for few maps, each looked at as strokes.

    A tree of four levels is a lattice of lines. Many maps explain it better than its trunk and two branches do, unless
    it is known that the twigs end. So few maps are searched for, and seen as strokes of the depth that suits them. The
    code is taken if it draws the picture; the moves by renderings are then left out. A move is a search.
    """

    name, ends_at = "strokes", "approach_share"

    def __init__(self, problem: SearchProblem, number: int = 0, restart: int = 0):
        super().__init__(problem, number, restart)
        self._objective: ImageObjective | None = None

    @property
    def objective(self) -> ImageObjective:
        """The picture as it is seen with the camera that suits the code so far; there once the stage is open."""
        assert self._objective is not None
        return self._objective

    @staticmethod
    def may_help(problem: SearchProblem) -> bool:
        """Whether an image may show strokes: lines and areas that others drew, not too many pixels of them."""
        camera = problem.params.camera
        sought = camera.estimate and camera.strokes and camera.recursion_maps and isinstance(problem.levels, Drawn)
        return bool(sought) and not problem.is_reduced and not problem.params.maps

    @property
    def expected_moves(self) -> int:
        return len(self.params.camera.recursion_maps)

    def is_wanted(self, state: State) -> bool:
        if state.current is not None:
            return True
        if state.measured_through:  # a density: no strokes
            return False
        self.open(state)
        return self._likeness(state.leader) < self.params.stages.unlike

    def open(self, state: State) -> None:
        if self._objective is None:
            problem, seed = self.problem, derive(self.problem.seed, "recursion")
            camera = problem.camera(state.leader.code, seed)
            self._objective = problem.objective(len(problem.image), state.leader.code, seed, camera=camera)

    def begin(self, state: State) -> Candidate:
        return _candidate(self.objective, self.objective.judge(state.leader.maps, state.leader.weights))

    def step(self, now: Candidate, number: int) -> Candidate:
        few = self._few_maps(number)
        found = next(iter(as_seen(self.objective, few, "strokes", self.deadline)), None)
        enough = float("inf") if self._has_tiles(few) else self.params.camera.recursion_gain * few.error
        if found is None or found[1].error >= enough:
            return now
        best = _candidate(*in_turns(*found, self.deadline))
        return best if best.error < self._error_to_beat(now) and self._is_explained(best) else now

    def is_settled(self, state: State) -> bool:
        return self._is_explained(state.now)

    def close(self, state: State) -> State:
        return replace(state, best=state.current) if self._is_explained(state.now) else state

    def _few_maps(self, number: int) -> Rendered:
        """What a search for few maps finds."""
        most = self.params.camera.recursion_maps[number]
        most = min(most, self.params.most_maps or most)
        few = self.params.updated(at_most=most, bytes=None, likeness=None)
        search = MeasureSearch(self.problem.masses_of(self.round), Regime.whole(few), few,
                               derive(self.problem.seed, "recursion", number), few.camera.recursion_contraction)
        found = search.start()
        for move in range(few.search.moves):
            if self.deadline.passed:
                break
            found = search.step(found, move)
        return self.objective.judge(found.maps)

    def _error_to_beat(self, now: Candidate) -> float:
        if has_strokes(now):
            return now.error
        return float("inf") if self._has_tiles(now) else self.params.camera.stroked * now.error

    def _has_tiles(self, found: WeightedMaps) -> bool:
        """Whether a code is drawn by tiles, which show the picture itself, so that its error says nothing."""
        return self.objective.levels.smallest_part(found.code, len(self.objective.image)) > 0

    def _is_explained(self, found: Candidate) -> bool:
        return has_strokes(found) and self._likeness(found) >= self.params.stages.unlike

    def _likeness(self, found: Candidate) -> float:
        """How like the picture a code is, with its own camera or the one that suits the code so far."""
        objective = self.objective
        if found.camera:
            objective = objective.seen_with(seen_with(objective.levels, found.camera))
        return likeness_of(objective.judge(found.maps, found.weights), objective)


def _candidate(objective: ImageObjective, shown: Rendered) -> Candidate:
    return Candidate(shown.maps, shown.weights, shown.error, shown.error, camera_of(objective.levels))


def has_strokes(found: Candidate) -> bool:
    """Whether a code was last judged by what it draws as strokes."""
    return found.camera[:1] == ("strokes",)
