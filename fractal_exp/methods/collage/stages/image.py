"""The stages of collage search. Each continues from what the stage before it found."""

from __future__ import annotations

from dataclasses import replace

from ....runtime.deadline import Deadline
from ....runtime.seeds import derive
from ...base import time_is_up
from ..camera.tones import seen_with
from ..image.frame import FAR, FIRM_ABOVE, FIRM_ONLY
from ..image.gauss_newton import firmly_framed, fitted_into_frame
from ..moves.search import ImageSearch
from ..simplify.loop import Price
from ..simplify.removal import pruned_in_frame
from ..state import Candidate, State
from .base import Stage
from .construction import Recursion, is_construction
from .growth import Growth
from .measure import Detail, FromMixture, Populations, Restart, Uncurved
from .problem import SearchProblem
from .rounding import DrawnRounding, Rounding

RECENT = 2 / 3   # share of the expected moves: the search goes on if the error was halved within so many


class Approach(Stage[ImageSearch]):
    """Polish the code on a shrunk image. The nearer the code, the more precisely this image can be computed."""

    name, ends_at = "approach", "approach_share"

    def open(self, state: State) -> None:
        self.search = self.problem.image_search(state.leader.code, self.deadline, "approach", self.round,
                                                measured_through=state.measured_through)

    def begin(self, state: State) -> Candidate:
        return self.search.resume(state.leader)


class ImageMoves(Stage[ImageSearch]):
    """Refinement and moves of single maps, judged by renderings; the last stage of a round. Moves go on beyond the
    number asked for as long as the error keeps being halved. If another round is worth while, `best` is None after it.
    """

    name, ends_at = "image", "image_share"
    reached = "the code renders the image as well as the true one would"

    @property
    def expected_moves(self) -> int:
        return self.params.population.moves if self.problem.is_crossed else self.params.moves.count

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
        parts = self.problem.full_rounds
        return self.problem.deadline.until((parts - 1 + self._share("image_share")) / parts)

    def open(self, state: State) -> None:
        self.measured_through = state.measured_through
        self._open(state.leader, state.current and state.current.camera)

    def _open(self, best: Candidate, camera: tuple[str | float, ...] | None = None) -> None:
        self.search = self.problem.image_search(best.code, self._part_until(1), "retouch", self.round, camera=camera,
                                                measured_through=self.measured_through)

    def begin(self, state: State) -> Candidate:
        return self.search.resume(state.leader)

    def step(self, now: Candidate, number: int) -> Candidate:
        more = number + 1 - self.expected_moves  # cleaning: small maps that compensate for a wrong one keep it in place
        due = self.params.moves.cleaning and more >= 0 and more % self.recent == 0
        return self.search.cleaned(now) if due else self.search.step(now, number)

    def is_settled(self, state: State) -> bool:
        idle = state.step - (state.halved[0] if state.halved else 0)
        stuck = state.step >= self.expected_moves and idle >= self.recent
        return stuck or self._is_late(state) or self.search.is_settled(state.now, state.step)

    def _is_late(self, state: State) -> bool:
        """Whether the remaining time is better spent on growth."""
        return self._grows_soon and self.search.objective.is_hopeless(state.now.error)

    @property
    def _grows_soon(self) -> bool:
        return self.params.growth.enabled and self.problem.deadline.until(self.params.stages.hopeless_share).passed

    def close(self, state: State) -> State:
        problem = self.problem
        state = replace(state, stopped=self._reason(state))
        if problem.is_reduced and not problem.deadline.passed:
            self.search = problem.image_search(state.now.code, self._part_until(1), "finish", self.round,
                                               measured_through=self.measured_through)
        found, before = self._finished(state.now), state.before and self._judged_again(state.before)
        best = found if before is None or self._is_better(found, before) else before
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

    def _is_better(self, found: Candidate, before: Candidate) -> bool:
        """By the framed score in a binary image, unless one of the codes is nearly right. Else by the errors as angles:
        an error counts subpixels, of which cameras have different numbers."""
        if self.problem.is_framed_firmly and not any(map(self._is_nearly_right, (found, before))):
            return self.search.framed_score(found) < self.search.framed_score(before)
        now, then = (seen_with(self.problem.levels, each.camera).supersample for each in (found, before))
        return found.score / now**2 < before.score / then**2

    def _is_nearly_right(self, candidate: Candidate) -> bool:
        """Whether a code needs no firm polish in the frame of a binary image."""
        return self.search.noise_ratio(candidate) < FIRM_ABOVE

    def _mended(self, wrong: Candidate) -> Candidate | None:
        """The code, if rounding alone corrects it; None if another round is worth while."""
        simple = self.search.simplified(wrong)
        return None if simple is None or self._is_wrong(simple) else simple

    def _reason(self, state: State) -> str:
        """Why the moves ended."""
        if self.deadline.passed:
            is_last = self.round + 1 >= self.problem.full_rounds
            return time_is_up(self.problem.deadline.seconds or 0) if is_last else "the time of its round was up"
        if self.search.is_settled(state.now, state.step):
            return self.reached
        return "all moves were made" if state.step == self.most_moves else "no move helped any more"

    def _is_wrong(self, candidate: Candidate) -> bool:
        """Whether a code is worth another round."""
        stages = self.params.stages
        worth = stages.later_rounds if self.round else stages.second_round
        if self.search.noise_ratio(candidate) <= worth:
            return False
        goes_on = self.problem.has_independent_rounds and not self._grows_soon
        return goes_on or not self.search.objective.is_hopeless(candidate.error)


class FullSize(Stage):
    """After a search on a shrunk image, polish the code at full resolution, or at `stages.full_side` if that is less.
    Grids are at most as fine as `image.finest`: a larger rendering only has less noise."""

    name, ends_at = "full size", "full_share"

    @property
    def deadline(self) -> Deadline:
        return self.problem.deadline.until(self.params.stages.full_share)

    def open(self, state: State) -> None:
        seed = derive(self.problem.seed, "full")
        self.objective = self.problem.objective(self.problem.full_side, state.found.code, seed,
                                                camera=state.found.camera)

    def begin(self, state: State) -> Candidate:
        objective, params = self.objective, self.params
        start = objective.judge(state.found.maps, state.found.weights)
        noise = objective.noise(start.code)
        near = start.error < FAR * noise
        if objective.firm_frame() is None or start.error <= FIRM_ONLY * noise:
            start = pruned_in_frame(objective, start, Price(params.moves.price * noise), near=near,
                                    deadline=self.deadline)
            start = fitted_into_frame(objective, start, params.stages.full_polish,
                                      objective.own_frame() if near else None, deadline=self.deadline)
        found = firmly_framed(objective, start, self.problem.deadline)
        weights = None if found.weights is None else found.probabilities
        return Candidate(found.maps, weights, found.error, found.error, state.found.camera)

    def close(self, state: State) -> State:
        return replace(state, best=state.current, before=None)


class DrawnMoves(ImageMoves):
    """`ImageMoves` for a picture that others drew. The camera is estimated for a code before the code is judged."""

    reached = "the code draws the shape to within a pixel"

    def is_wanted(self, state: State) -> bool:
        """False if `Recursion` has explained the picture by tiles or strokes."""
        tiled = self.params.camera.tiled_maps
        return state.best is None or self.problem.is_reduced or not is_construction(state.best, tiled)

    @property
    def expected_moves(self) -> int:
        return self.params.moves.drawn_count

    @property
    def most_moves(self) -> int:
        return self.expected_moves

    def begin(self, state: State) -> Candidate:
        search = self.search
        return self._seen_anew(search.resume(self._without_doubles(state.leader)))

    def _without_doubles(self, found: Candidate) -> Candidate:
        """The code without maps that only make lines thicker, if at least two others stay."""
        fewer = self.problem.without_doubles(found)
        if len(fewer.maps) == len(found.maps):
            return found
        return self._seen_anew(replace(found, maps=fewer.maps, weights=fewer.weights))

    def _seen_anew(self, found: Candidate) -> Candidate:
        self._open(found)
        return self.search.judged(found)

    def _finished(self, found: Candidate) -> Candidate:
        found = self._seen_anew(self._without_doubles(found))
        return self.search.finish(found)

    def _judged_again(self, before: Candidate) -> Candidate:
        return before  # by its own camera

    def _mended(self, wrong: Candidate) -> None:
        """None: it is too early for rounding."""

    def _is_wrong(self, candidate: Candidate) -> bool:
        objective = self.problem.objective(len(self.problem.image), candidate.code, self.problem.seed,
                                           camera=candidate.camera)
        shown = objective.judge(candidate.maps, candidate.weights)
        return self.params.stages.drawn_hopeless <= objective.likeness(shown.image) < self.params.stages.unlike


def stages_of(problem: SearchProblem, number: int) -> list[Stage]:
    """The stages of a round, in order."""
    if problem.params.grows_at_once:
        return []
    restarts = [Restart(problem, number, restart) for restart in range(problem.restarts(number))]
    if not number and Uncurved.may_help(problem):
        restarts.insert(1, Uncurved(problem))
    search = [*restarts, FromMixture(problem, number), Detail(problem, number)]
    approach = [Approach(problem, number)] if problem.is_reduced else []
    moves = ImageMoves if problem.levels.is_exact else DrawnMoves
    recursion = [Recursion(problem, number)] if Recursion.may_help(problem) and not number else []
    return [*([Populations(problem, number)] if problem.is_crossed else search), *approach, *recursion,
            moves(problem, number)]


def last_stages(problem: SearchProblem) -> list[Stage]:
    """The stages after all rounds."""
    growth: list[Stage] = [Growth(problem, problem.rounds)] if problem.params.growth.enabled else []
    if problem.params.grows_at_once:
        return growth
    full = [FullSize(problem, problem.rounds)] if problem.full_side > len(problem.image) else []
    rounding = Rounding if problem.levels.is_exact else DrawnRounding
    last = [rounding(problem, problem.rounds)] if problem.params.rounding.enabled else []
    return [*full, *last, *growth]
