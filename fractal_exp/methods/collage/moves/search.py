"""Large neighbourhood search again, one map at a time, judged by renderings of the code.

After the search on the measure, two kinds of errors are left: missing maps so small, thin or faint that they weigh next
to nothing but are still seen, and small copies in a wrong orientation. A rendering shows both at once.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import torch
from torch import Tensor

from ....likeness import ALIKE
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import generator
from ..image.frame import FAR, FIRM_ABOVE, FIRM_ONLY
from ..image.gauss_newton import firmly_framed, fitted_into_frame, polished
from ..image.jacobian import FromRenderings
from ..image.objective import ImageObjective, Rendered, error_of
from ..image.refine import refined
from ..simplify.loop import Draft, Proposer, maps_polished, simplified
from ..simplify.parents import fewer
from ..simplify.removal import pruned_in_frame
from ..simplify.rounding import begun, with_simple_numbers
from ..state import Candidate
from . import MOVES
from .root import with_roots
from .tools import Latest, Tools

ACCEPTED_STEPS = 1      # Gauss-Newton steps of all maps after an accepted move
SETTLED = 1.05          # noise ratio below which a code counts as the true one, and how much it rises
SETTLED_MORE = 0.005    # with each move: further moves hardly ever help then
DRAWN_LEAST = 8         # moves after which the code of a picture that others drew may be settled
OTHER_OWN_WEIGHTS = 1.0   # `MoveParams.own_weights` of such a picture and of linear grey levels, which show weights
RENDERED_RATIO = 1.1, 6.0   # noise ratios between which a Jacobian from renderings helps: above noise, and nearly right


class ImageSearch(Tools):
    """The search on an `ImageObjective`, from a candidate. Every random number derives from the seed and the move's
    number."""

    def __init__(self, objective: ImageObjective, masses: Tensor, *, noise: float, seed: int = 0,
                 deadline: Deadline = NO_DEADLINE):
        super().__init__(objective, masses, noise=noise, seed=seed, deadline=deadline)
        self.shown = Latest(lambda code: objective.judge(code.maps, code.weights))
        self.noise = Latest(lambda code: objective.noise(code.code))

    # -- steps of the stage -------------------------------------------------------------------------------------------

    def resume(self, found: Candidate) -> Candidate:
        """The best rendering among the candidate and its refinements, with free weights or weights |det| + 0.01."""
        steps = self.params.moves.polish_starts
        free = found.probabilities if found.weights is None else found.weights
        tried = (None, free) if self.params.moves.own_weights else (None,)
        tried = tried[-1:] if self.objective.levels.is_linear else tried  # linear levels determine the weights
        shown = [self.polished(refined(self.objective, self.masses, found.maps, weights, self.seed), steps)
                 for weights in tried]
        roots = Proposer(partial(with_roots, self), maps_polished(steps), early=True, repeats=False)
        parents = Proposer(fewer, maps_polished(steps))
        first = self._tied_if_as_good(shown[0], shown[-1])
        best = self.polished(self.pruned(first), steps)
        if not self.objective.levels.is_exact:  # at this price, pruning may remove maps that a root needs
            best = min(best, self._simpler(first, roots), self._simpler(first, parents), key=self.score)
        return self.candidate(self._simpler(best, roots))

    def _simpler(self, shown: Rendered, way: Proposer) -> Rendered:
        return simplified(Draft(self.objective, shown), [way], self.price, self.deadline).shown

    def step(self, now: Candidate, number: int) -> Candidate:
        """`now`, or a better neighbour."""
        g, shown = generator(self.seed, "picture step", number), self.shown(now)
        odds = [float(getattr(self.params.moves, name) * move.is_open(self, shown)) for name, move in MOVES.items()]
        if not any(odds):
            return now
        chosen = list(MOVES.values())[int(torch.multinomial(torch.tensor(odds), 1, generator=g))]
        new = chosen.neighbour(self, shown, g)
        if self.score(new) >= self.score(shown):
            return now
        return self.candidate(self.polished(new, ACCEPTED_STEPS))

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
            return self._polished_last(now)
        now = self._firmly_framed(self.pruned(self.shown(now)))
        if min(before, self.noise_ratio(now)) > FIRM_ONLY:
            return now
        return self._firmly_framed(self.shown(self._polished_last(now)))

    def _firmly_framed(self, shown: Rendered) -> Candidate:
        return self.candidate(firmly_framed(self.objective, shown, self.deadline))

    def _polished_last(self, now: Candidate) -> Candidate:
        """The code cleaned, and then polished on the mean of several renderings, which has less noise. The polish is
        left out for pictures that others drew and for hopeless codes."""
        cleaned = self.cleaned(now)
        if not self.objective.levels.is_exact or self.objective.is_hopeless(cleaned.error):
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
        if not self.objective.levels.is_exact:
            enough = moves >= DRAWN_LEAST and len(now.maps) >= (self.params.maps or 0)
            return enough and self.likeness(now) >= ALIKE
        worth = SETTLED + SETTLED_MORE * moves
        return self.noise_ratio(now) < worth and len(now.maps) >= (self.params.maps or 0)

    def likeness(self, now: Candidate) -> float:
        """The likeness of the code's rendering to the image, see `ImageObjective`."""
        return self.objective.likeness(self.shown(now).image)

    def noise_ratio(self, now: Candidate) -> float:
        """The error, relative to the error between two renderings of the same code."""
        shown = self.shown(now)
        return shown.error / self.noise(shown)

    # -- the last polish ----------------------------------------------------------------------------------------------

    def _last_judged(self, found: Rendered) -> Rendered:
        """The code after the last polish, judged by one rendering."""
        last = self._last_polish(found)
        return self.objective.judge(last.maps, last.weights)

    def _last_polish(self, found: Rendered) -> Rendered:
        """Polish the code on the mean of several renderings, which has less noise, and into the frame. If more than
        noise is left, polish it with a Jacobian from renderings."""
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
        return best

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
        weights = None if rendered.weights is None else rendered.probabilities
        rendered = replace(rendered, weights=weights)
        self.shown.keep(rendered, rendered)
        return Candidate(rendered.maps, weights, rendered.error, self.score(rendered), self.objective.levels.camera)
