"""Growth as stages of the search, for pictures that show no code."""

from __future__ import annotations

import math
from dataclasses import replace

from ....cameras.levels import may_be_density
from ....runtime.deadline import NO_DEADLINE, USUAL, Deadline
from ....runtime.seeds import derive
from ..state import Candidate, Grown, State, WeightedMaps
from .base import SearchProblem, Stage
from .growing import Grower

UNLIKE = 0.9    # likeness below which maps are grown and compared with what the search found
GAIN = 0.02     # minimum gain in likeness for each doubling of the number of maps: many maps also fit noise
TILES = 64      # number of maps that are grown first; if they are more like the picture, the search for few ends
SHORTENED = 0.5   # share of the steps that smaller numbers of maps take, beside the one that is asked for
SKETCH_ENDS = 0.6   # share of the time limit at which a sketch ends, and from which the most maps are grown first


class Growth(Stage):
    """Each move grows one number of maps on the curve of likeness. At the end, the stage chooses between the found and
    the grown sets. It is skipped if the search found the code."""

    name = "growth"
    is_last_word = True
    descent_ends = 1.0   # share of the time limit at which the descent of a set ends

    def __init__(self, problem: SearchProblem, number: int = 0, restart: float = 0):
        super().__init__(problem, number, restart)
        self.counts = self._counts()
        self.grower = Grower(problem, derive(problem.seed, "growth"))

    def _counts(self) -> list[int]:
        """The numbers of maps on the curve. Under a short time limit, it has one point alone."""
        hurried = (self.problem.deadline.seconds or USUAL) < USUAL
        return [*([] if hurried else [each for each in self.params.growth.counts if each < self._last]), self._last]

    @property
    def _last(self) -> int:
        """The largest number of maps: what is asked for, or the usual one."""
        params, growth = self.params, self.params.growth
        return params.maps or params.most_maps or (max(growth.counts) if params.likeness else growth.usual)

    @property
    def expected_moves(self) -> int:
        return len(self.counts) if self.params.grows_at_once else 0

    @property
    def most_moves(self) -> int:
        return len(self.counts)

    @property
    def deadline(self) -> Deadline:
        """No deadline: even if time is up, there is at least a plain paving. Its refinement ends in time."""
        return NO_DEADLINE

    def is_wanted(self, state: State) -> bool:
        found = state.searched
        if found is None or state.current is not None:
            return True
        asked, likeness = self.params.likeness or 0, self._likeness(found)
        is_doubtful = likeness < UNLIKE or bool(state.curve)
        return likeness < asked or (is_doubtful and not self.grower.is_explained_by(found))

    def open(self, state: State) -> State:
        return state.begun(lambda: state.result or self.grower.plain(self.counts[0]).candidate)

    def move(self, state: State) -> State:
        is_late = self.problem.deadline.until(SKETCH_ENDS).passed  # no time is left for more than one
        count = self._missing(state)[-1 if is_late else 0]
        share = 1.0 if count == self._last or self.params.likeness else SHORTENED
        grown = self.grower.grown(count, self.problem.deadline.until(self.descent_ends), share)
        return replace(state.moved(grown.candidate), curve=(*state.curve, grown))

    def is_settled(self, state: State) -> bool:
        """Whether the goal is reached, or nothing is left to grow after an earlier stage, or no time."""
        return not self._missing(state) or (
            bool(state.curve) and (self.problem.deadline.passed or state.curve[-1].likeness >= self._goal))

    def cut_short(self, state: State) -> State:
        if not state.result and (unfinished := self.grower.unfinished()):
            state = replace(state, curve=(unfinished,))
        elif not state.step:
            return state
        return self.close(state) if self._fitting(state.curve) else replace(state, current=None)

    def close(self, state: State) -> State:
        found, chosen = state.searched, self._chosen(state.curve)
        if found is not None and self.params.maps in (None, len(found.maps)) and (
                not is_worth_its_maps(chosen, found, self._likeness(found))):
            return replace(state, best=found, before=None)
        problem, seed = self.problem, derive(self.problem.seed, "grown")
        objective = problem.objective(len(problem.image), chosen.code, seed, camera=chosen.camera)
        best = objective.judge(chosen.maps, chosen.weights).candidate(chosen.camera)
        return replace(state, best=best, before=None,
                       stopped=f"{len(chosen.maps)} maps were grown, likeness {chosen.likeness:.3f}")

    def _likeness(self, found: Candidate) -> float:
        return self.grower.likeness(found, self.problem.camera_of(found))

    def _missing(self, state: State) -> list[int]:
        """The numbers of maps that are not on the curve yet."""
        there = {len(each.maps) for each in state.curve}
        return [count for count in self.counts if count not in there]

    def _fitting(self, curve: tuple[Grown, ...]) -> list[Grown]:
        """The sets with the given number of maps, if there is one."""
        return [each for each in curve if self.params.maps in (None, len(each.maps))]

    @property
    def _goal(self) -> float:
        """The likeness at which growth ends; infinite if the number of maps is given."""
        if self.params.maps or self.params.most_maps:
            return float("inf")
        return self.params.likeness or self.params.growth.enough

    def _chosen(self, curve: tuple[Grown, ...]) -> Grown:
        """The first set that reaches the goal, or else the one of highest likeness, of those that fit."""
        fitting = self._fitting(curve)
        reached = [each for each in fitting if each.likeness >= self._goal]
        return reached[0] if reached else max(fitting, key=lambda each: each.likeness)


class Sketch(Growth):
    """Growth at the start of a search, for a picture that is grey inside: most such pictures are photographs."""

    name = "sketch"
    is_last_word = False
    descent_ends = SKETCH_ENDS

    @staticmethod
    def may_help(problem: SearchProblem) -> bool:
        """Whether the image, which others drew, is grey inside."""
        return problem.params.growth.enabled and may_be_density(problem.image)

    def _counts(self) -> list[int]:
        """Those that `Promise` compares. The others are grown at the end, if the search finds no code."""
        return [min(TILES, self._last)]

    @property
    def expected_moves(self) -> int:
        return len(self.counts)

    @property
    def deadline(self) -> Deadline:
        return self.problem.deadline.until(SKETCH_ENDS)

    def is_wanted(self, state: State) -> bool:
        return True

    def close(self, state: State) -> State:
        return replace(state, current=None)


class Promise(Stage):
    """Compares the code that the search has found on the measure with `TILES` grown maps. If they are more like the
    picture, few maps do not explain it, and the search ends."""

    name = "promise"

    def is_wanted(self, state: State) -> bool:
        return bool(_tiles(state))

    def open(self, state: State) -> State:
        return state

    def close(self, state: State) -> State:
        grower, found = Grower(self.problem, derive(self.problem.seed, "growth")), state.leader
        likeness = grower.likeness(found, self.problem.camera_of(found))
        are_better = any(is_worth_its_maps(each, found, likeness) for each in _tiles(state))
        return replace(state, is_outgrown=are_better and not grower.is_explained_by(found))


def _tiles(state: State) -> list[Grown]:
    return [each for each in state.curve if len(each.maps) <= TILES]


def is_worth_its_maps(grown: Grown, found: WeightedMaps, likeness: float) -> bool:
    """Whether grown maps are more like the picture than what the search found, by `GAIN` for each doubling of the
    number of maps. likeness: of what was found."""
    doublings = max(1.0, math.log2(len(grown.maps) / len(found.maps)))
    return grown.likeness >= likeness + GAIN * doublings
