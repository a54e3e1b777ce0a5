"""Large neighbourhood search again, one map at a time, judged by renderings of the code.

After the search on the measure, two kinds of errors are left: missing maps so small, thin or faint that they weigh next
to nothing but are still seen, and small copies in a wrong orientation. A rendering shows both at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import torch

from ....runtime.seeds import generator
from ..image.gauss_newton import firmly_framed, fitted_into_frame, polished
from ..image.jacobian import FromRenderings
from ..image.objective import FAR, FIRM_ABOVE, FIRM_ONLY, ImageObjective, Rendered, error_of
from ..simplify.loop import Draft, Proposer, Way, maps_polished, pruned_in_frame, simplified
from ..simplify.rounding import begun, with_simple_numbers
from ..state import Candidate
from .reorient import with_reorientation
from .single import with_birth, with_removal, with_replacement, with_root, with_roots
from .tools import Tools

ACCEPTED_STEPS = 1      # Gauss-Newton steps of all maps after an accepted move
SETTLED = 1.05          # noise ratio below which a code counts as the true one, and how much it rises
SETTLED_MORE = 0.005    # with each move: further moves hardly ever help then
OTHER_OWN_WEIGHTS = 1.0   # `MoveParams.own_weights` of linear grey levels, which show weights, and of others' pictures
RENDERED_RATIO = 1.1, 6.0   # noise ratios between which a Jacobian from renderings helps: above noise, and nearly right


class Move(NamedTuple):
    """neighbour: another code, from a code and a random stream; least: how many maps the code must have; more: 1 if the
    other code has more maps, 0 if it has as many, -1 if it has fewer."""

    neighbour: Callable[[Tools, Rendered, torch.Generator], Rendered]
    least: int
    more: int


# The odds of a move in `MoveParams` have its name. A new move is a function, an entry here and its odds there.
MOVES = {"birth": Move(with_birth, 1, 1), "reorient": Move(with_reorientation, 2, 0),
         "replace": Move(with_replacement, 2, 0), "remove": Move(with_removal, 3, -1), "root": Move(with_root, 3, -1)}


class ImageSearch(Tools):
    """The search on an `ImageObjective`, from a candidate. Every random number derives from the seed and the move's
    number."""

    # -- steps of the stage -------------------------------------------------------------------------------------------

    def resume(self, found: Candidate) -> Candidate:
        """The best rendering among the candidate and its refinements, with free weights or weights |det| + 0.01."""
        free = found.probabilities if found.weights is None else found.weights
        tried = (None, free) if self.params.moves.own_weights else (None,)
        tried = tried[-1:] if self.objective.levels.is_linear else tried  # linear levels determine the weights
        shown = [self.polished(self.refined(found.maps, weights), self.params.moves.polish_starts) for weights in tried]
        return self.candidate(self.rooted(self.first_pruned(self._tied_if_as_good(shown[0], shown[-1]))))

    def first_pruned(self, first: Rendered) -> Rendered:
        """The code that the search starts with, pruned and polished."""
        return self.polished(self.pruned(first), self.params.moves.polish_starts)

    def rooted(self, shown: Rendered) -> Rendered:
        """The code with roots of its largest maps, if that is simpler."""
        return self.simpler(shown, partial(with_roots, self), early=True, repeats=False)

    def simpler(self, shown: Rendered, way: Way, **exceptions: bool) -> Rendered:
        """The code simplified in this way, if that is worth it. exceptions: fields of the `Proposer`."""
        proposer = Proposer(way, maps_polished(self.params.moves.polish_starts), **exceptions)
        return simplified(Draft(self.objective, shown), [proposer], self.price, self.deadline).shown

    def step(self, now: Candidate, number: int) -> Candidate:
        """`now`, or a better neighbour."""
        g, shown = generator(self.seed, "picture step", number), self.shown(now)
        odds = self.odds(len(shown.maps))
        if not any(odds):
            return now
        chosen = list(MOVES.values())[int(torch.multinomial(torch.tensor(odds), 1, generator=g))]
        new = chosen.neighbour(self, shown, g)
        if self.score(new) >= self.score(shown):
            return now
        return self.candidate(self.polished(new, ACCEPTED_STEPS))

    def odds(self, maps: int) -> list[float]:
        """Of each move; 0 of those that a code of so many maps does not admit."""
        asked, moves = self.params.maps, self.params.moves
        admits = {1: maps < (asked or self.params.most_maps or maps + 1), 0: True, -1: not asked}
        return [getattr(moves, name) if maps >= move.least and admits[move.more] else 0.0
                for name, move in MOVES.items()]

    def cleaned(self, now: Candidate) -> Candidate:
        """Prune and polish the code for many steps; keep the result if it is better."""
        shown = self.shown(now)
        new = self.polished(self.pruned(shown), self.params.moves.polish_ends)
        return self.candidate(new) if self.score(new) < self.score(shown) else now

    def finish(self, now: Candidate) -> Candidate:
        """Clean and polish the code. On a binary image, polish it firmly in the frame as well, before and after that.
        If it is still far from right after the first firm polish, stop there: parts of a pixel do not matter yet."""
        before = self.noise_ratio(now)
        if self.objective.firm_frame() is None or before < FIRM_ABOVE:
            return self.last_polished(now)
        now = self.firmly_polished(self.pruned(self.shown(now)))
        if min(before, self.noise_ratio(now)) > FIRM_ONLY:
            return now
        return self.firmly_polished(self.shown(self.last_polished(now)))

    def firmly_polished(self, shown: Rendered) -> Candidate:
        """The code polished firmly in the frame of a binary image."""
        return self.candidate(firmly_framed(self.objective, shown, self.deadline))

    def last_polished(self, now: Candidate) -> Candidate:
        """The code cleaned, and then polished on the mean of several renderings, which has less noise. The polish is
        left out for hopeless codes."""
        cleaned = self.cleaned(now)
        if self.objective.is_hopeless(cleaned.error):
            return cleaned
        found = self.shown(cleaned)
        if found.weights is not None and not self.objective.levels.is_linear:
            tied = self.polished(self.objective.judge(found.maps), self.params.moves.polish_ends)
            found = self._tied_if_as_good(tied, found)
        last = self._last_judged(found)
        near = self.noise_ratio(self.candidate(last)) < FAR
        pruned = pruned_in_frame(self.objective, last, self.price, near=near, deadline=self.deadline)
        if len(pruned.maps) < len(last.maps):
            last = min(last, self._last_judged(pruned), key=self.score)
        return self.candidate(last)

    def simplified(self, now: Candidate) -> Candidate | None:
        """The code with simple numbers rounded, or None if there are none."""
        if not self.params.rounding.enabled:
            return None
        careful = self._careful()
        found = with_simple_numbers(begun(careful, careful.judge(now.maps, now.weights)), self.deadline)
        return self.candidate(self.objective.judge(found.shown.maps, found.shown.weights)) if found.fixed else None

    def judged(self, candidate: Candidate) -> Candidate:
        """The candidate with its error and score by this objective."""
        return self.candidate(self.objective.judge(candidate.maps, candidate.weights))

    def is_settled(self, now: Candidate, moves: int) -> bool:
        """Whether the code's rendering is as close to the image as the true code's would be, or nearly so after many
        moves."""
        worth = SETTLED + SETTLED_MORE * moves
        return self.noise_ratio(now) < worth and len(now.maps) >= (self.params.maps or 0)

    def noise_ratio(self, now: Candidate) -> float:
        """The error, relative to the error between two renderings of the same code."""
        shown = self.shown(now)
        return shown.error / self.noise(shown)

    # -- the last polish ----------------------------------------------------------------------------------------------

    def _last_judged(self, found: Rendered) -> Rendered:
        """Polish the code on the mean of several renderings, which has less noise, and into the frame. If more than
        noise is left, polish it with a Jacobian from renderings. It is then judged by one rendering."""
        careful, params = self._careful(), self.params.gauss_newton
        near = self.noise_ratio(self.candidate(found)) < FAR
        best = fitted_into_frame(careful, careful.judge(found.maps, found.weights), self.params.moves.polish_ends,
                                 self.objective.own_frame() if near else None, deadline=self.deadline)
        ratio = self.noise_ratio(self.candidate(self.objective.judge(best.maps, best.weights)))
        is_open = params.rendered_steps and not self.objective.levels.is_linear and not self.deadline.passed
        if is_open and RENDERED_RATIO[0] < ratio < RENDERED_RATIO[1]:
            once = self.objective.within(self.objective.own_frame())
            last = polished(once, once.judge(best.maps, best.weights), params.rendered_steps, deadline=self.deadline,
                            jacobian=FromRenderings, alone=True)
            best = min(best, careful.judge(last.maps, last.weights), key=error_of)
        return self.objective.judge(best.maps, best.weights)

    def _careful(self) -> ImageObjective:
        return ImageObjective(self.objective.image, self.objective.levels, self.params, self.seed,
                              self.params.image.last_renderings)

    def _tied_if_as_good(self, tied: Rendered, own: Rendered) -> Rendered:
        """The code with free weights only if its error is much lower. Free weights also fit noise, and lag behind when
        maps move."""
        levels, moves = self.objective.levels, self.params.moves
        is_other = levels.is_linear or not levels.is_exact
        worth = OTHER_OWN_WEIGHTS if moves.own_weights and is_other else moves.own_weights
        return own if own.error < worth * tied.error else tied

    # -- candidates ---------------------------------------------------------------------------------------------------

    def framed_score(self, now: Candidate) -> float:
        """The score, with `framed_error` as the error; lower is better."""
        shown = self.shown(now)
        return self.score(replace(shown, error=self.objective.framed_error(shown)))

    def candidate(self, rendered: Rendered) -> Candidate:
        """What the search keeps of a rendering."""
        found = rendered.candidate(self.objective.levels.camera)
        self.shown.keep(found, replace(rendered, weights=found.weights))
        return replace(found, score=self.score(rendered))
