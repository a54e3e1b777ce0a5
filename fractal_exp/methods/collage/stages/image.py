"""The stages that work by renderings: moves, and the last polishes. Each continues from what the stage before found."""

from __future__ import annotations

from dataclasses import replace

from ....cameras.camera import Camera
from ....cameras.kinds import with_camera
from ....runtime.deadline import Deadline
from ....runtime.seeds import derive
from ...base import time_is_up
from ..image.gauss_newton import firmly_framed, fitted_into_frame
from ..image.objective import FAR, FIRM_ABOVE, FIRM_ONLY, ImageObjective
from ..moves.search import ImageSearch
from ..simplify.loop import Draft, Price, pruned_in_frame
from ..simplify.rounding import begun, rounded
from ..state import Candidate, State
from .base import Stage

APPROACH_ENDS = 0.75   # share of a round's part of the time
HOPELESS_ENDS = 0.75   # share of the time limit at which moves end if the code is hopeless: this leaves time for growth
FULL_ENDS = 0.98       # share of the time limit at which the polish at full size ends
ROUNDING_ENDS = 0.99   # share of the time limit from which codes are not rounded
FULL_POLISH = 4        # Gauss-Newton steps at full size: the code is nearly right
CROSSED_MOVES = 6      # moves after populations, instead of `moves.count`
SECOND_ROUND = 1.2     # noise ratio above which a second round begins: a nearly right code needs none
LATER_ROUNDS = 2.0     # the same for a third or fourth round
NEAR_ERROR = 0.5       # error up to which codes are rounded whatever the noise ratio: noise is low in large images
RECENT = 2 / 3         # share of the expected moves: the search goes on if the error was halved within so many


class Approach(Stage):
    """Polish the code on a shrunk image. The nearer the code, the more precisely this image can be computed."""

    name, ends_at = "approach", APPROACH_ENDS
    ends_at_once = True

    def open(self, state: State) -> State:
        self.search = self.problem.image_search(state.leader.code, self.deadline, "approach", self.round,
                                                measured_through=state.measured_through)
        return state.begun(lambda: self.search.resume(state.leader))


class ImageMoves(Stage):
    """Refinement and moves of single maps, judged by renderings; the last stage of a round. Moves go on beyond the
    number asked for as long as the error keeps being halved. If another round is worth while, `best` is None after it.
    """

    name = "image"
    ends_at_once = True
    search: ImageSearch
    reached = "the code renders the image as well as the true one would"

    @property
    def expected_moves(self) -> int:
        return CROSSED_MOVES if self.problem.is_crossed else self.params.moves.count

    @property
    def most_moves(self) -> int:
        return self.params.moves.longest * self.expected_moves

    @property
    def recent(self) -> int:
        """The search goes on if the error was halved within this many moves."""
        return max(1, round(RECENT * self.expected_moves))

    @property
    def latest_start(self) -> Deadline:
        """The end of the moves of the last full round. A round whose code is not judged would end the search."""
        return self.problem.times.round_end(self.problem.full_rounds - 1)

    def open(self, state: State) -> State:
        self.measured_through = state.measured_through
        self._search_from(state.leader, state.current and state.current.camera)
        return state.begun(lambda: self._first(state.leader))

    def _search_from(self, best: Candidate, camera: Camera | None = None) -> None:
        self.search = self.problem.image_search(best.code, self.problem.times.part_end(self.round), "retouch",
                                                self.round, camera=camera, measured_through=self.measured_through)

    def _first(self, best: Candidate) -> Candidate:
        return self.search.resume(best)

    def move(self, state: State) -> State:
        # cleaning: small maps that compensate for a wrong one keep it in place
        more = state.step + 1 - self.expected_moves
        due = self.params.moves.cleaning and more >= 0 and more % self.recent == 0
        return state.moved(self.search.cleaned(state.now)) if due else super().move(state)

    def is_settled(self, state: State) -> bool:
        idle = state.step - (state.halved[0] if state.halved else 0)
        stuck = state.step >= self.expected_moves and idle >= self.recent
        is_late = self._grows_soon and self.search.objective.is_hopeless(state.now.error)  # growth needs the time
        return stuck or is_late or self.search.is_settled(state.now, state.step)

    @property
    def _grows_soon(self) -> bool:
        return self.params.growth.enabled and self.problem.deadline.until(HOPELESS_ENDS).passed

    def cut_short(self, state: State) -> State:
        return state if state.current is None else replace(state, best=state.current)

    def close(self, state: State) -> State:
        problem = self.problem
        state = replace(state, stopped=self._reason(state))
        if problem.is_reduced and not problem.deadline.passed:
            self.search = problem.image_search(state.now.code, problem.times.part_end(self.round), "finish",
                                               self.round, measured_through=self.measured_through)
        found, before = self._finished(state.now), state.before and self._judged_again(state.before)
        best = found if before is None or self.is_better(found, before) else before
        if self.round + 1 < problem.rounds and self._is_wrong(best):
            mended = self._mended(best)
            if mended is None:
                pool = None if problem.has_independent_rounds else state.pool_with(found.maps)
                return replace(state, pool=pool, best=None, before=best, scores=())
            best = mended
        return replace(state, best=best, before=None)

    def _finished(self, found: Candidate) -> Candidate:
        return self.search.finish(found)

    def _judged_again(self, before: Candidate) -> Candidate:
        """The best of earlier rounds. It is judged again if the image is reduced, as it was judged by a smaller one."""
        return self.search.judged(before) if self.problem.is_reduced else before

    def is_better(self, found: Candidate, before: Candidate) -> bool:
        """Whether a code is better than that of an earlier round: by the framed score in a binary image, unless one of
        the codes is nearly right. Else by the errors as angles: an error counts subpixels, of which cameras have
        different numbers."""
        if self.problem.is_framed_firmly and not any(
                self.search.noise_ratio(each) < FIRM_ABOVE for each in (found, before)):
            return self.search.framed_score(found) < self.search.framed_score(before)
        now, then = (with_camera(self.problem.levels, each.camera).supersample for each in (found, before))
        return found.score / now**2 < before.score / then**2

    def _mended(self, wrong: Candidate) -> Candidate | None:
        """The code, if rounding alone corrects it; None if another round is worth while."""
        simple = self.search.simplified(wrong)
        return None if simple is None or self._is_wrong(simple) else simple

    def _reason(self, state: State) -> str:
        """Why the moves ended."""
        if self.deadline.passed:
            is_last = self.round + 1 >= self.problem.full_rounds
            return time_is_up(self.problem.deadline) if is_last else "the time of its round was up"
        if self.search.is_settled(state.now, state.step):
            return self.reached
        return "all moves were made" if state.step == self.most_moves else "no move helped any more"

    def _is_wrong(self, candidate: Candidate) -> bool:
        """Whether a code is worth another round."""
        worth = LATER_ROUNDS if self.round else SECOND_ROUND
        if self.search.noise_ratio(candidate) <= worth:
            return False
        goes_on = self.problem.has_independent_rounds and not self._grows_soon
        return goes_on or not self.search.objective.is_hopeless(candidate.error)


class LastStage(Stage):
    """A stage after all rounds. Its code takes the place of all that they have found."""

    ends_at_once = True

    def close(self, state: State) -> State:
        return replace(state, best=state.current, before=None)


class FullSize(LastStage):
    """After a search on a shrunk image, polish the code at full resolution, or at `stages.full_side` if that is less.
    Grids are at most as fine as `image.finest`: a larger rendering only has less noise."""

    name, ends_at = "full size", FULL_ENDS

    def open(self, state: State) -> State:
        return state.begun(lambda: self._polished(state.found))

    def _polished(self, best: Candidate) -> Candidate:
        params = self.params
        objective = self.problem.objective(self.problem.full_side, best.code, derive(self.problem.seed, "full"),
                                           camera=best.camera)
        start = objective.judge(best.maps, best.weights)
        noise = objective.noise(start.code)
        near = start.error < FAR * noise
        if objective.firm_frame() is None or start.error <= FIRM_ONLY * noise:
            start = pruned_in_frame(objective, start, Price(params.moves.price * noise), near=near,
                                    deadline=self.deadline)
            start = fitted_into_frame(objective, start, FULL_POLISH,
                                      objective.own_frame() if near else None, deadline=self.deadline)
        return firmly_framed(objective, start, self.problem.deadline).candidate(best.camera)


class Rounding(LastStage):
    """Round a nearly right code to simple numbers and make it fill the frame exactly."""

    name, ends_at = "rounding", ROUNDING_ENDS

    def open(self, state: State) -> State:
        self.objective = self._objective_for(state.found)
        return state.begun(lambda: self._unless_far(state.found))

    def _objective_for(self, found: Candidate) -> ImageObjective:
        large = self.problem.full_side > self.params.stages.largest_side
        renderings = 1 if large else self.params.image.last_renderings
        return self.problem.objective(self.problem.full_side, found.code, derive(self.problem.seed, "last digits"),
                                      renderings, found.camera)

    def _unless_far(self, found: Candidate) -> Candidate:
        if self._is_far(found):
            return found
        last = self._rounded(Draft(self.objective, self.objective.judge(found.maps, found.weights)))
        return last.shown.candidate(last.objective.levels.camera)

    def _rounded(self, start: Draft) -> Draft:
        return rounded(begun(start.objective, start.shown), self.problem.deadline)

    def _is_far(self, found: Candidate) -> bool:
        """Whether the code is too far off for simple numbers to mean anything."""
        hasty = self.objective.hasty()
        shown = hasty.judge(found.maps, found.weights)
        return shown.error > max(FAR * hasty.noise(found.code), NEAR_ERROR)
