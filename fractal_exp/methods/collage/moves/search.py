"""Large neighbourhood search again, one map at a time, judged by renderings of the code.

After the search on the measure, two kinds of errors are left: missing maps so small, thin or faint that they weigh next
to nothing but are still seen, and small copies in a wrong orientation. A rendering shows both at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive, generator
from .. import maps as affine
from ..image.gauss_newton import firmly_framed, fitted_into_frame, polished
from ..image.jacobian import FromRenderings
from ..image.objective import ImageObjective, Rendered, error_of
from ..image.refine import refined
from ..simplify.parents import with_fewer_maps
from ..simplify.pruning import Price, pruned, pruned_in_frame
from ..simplify.rounding import Rounding
from ..state import Candidate
from . import MOVES
from .new_map import CorrectedMeasure
from .root import rooted


class ImageSearch:
    """The search on an `ImageObjective`, from a candidate. masses (R,R): of the image; noise: error between two
    renderings of one code. Every random number derives from the seed and the move's number."""

    def __init__(self, objective: ImageObjective, masses: Tensor, *, noise: float, seed: int = 0,
                 deadline: Deadline = NO_DEADLINE):
        self.objective, self.params, self.masses, self.seed = objective, objective.params, masses, seed
        levels = objective.levels  # without greys, small maps gather around a wrong one and hardly raise the error
        worth = 0.0 if levels.is_exact and levels.is_graded else self.params.moves.worth
        self.price, self.deadline = Price(self.params.moves.price * noise, worth), deadline
        self._shown: Rendered | None = None
        self._corrected: CorrectedMeasure | None = None
        self._noise: tuple[Tensor, float] | None = None

    # -- steps of the stage -------------------------------------------------------------------------------------------

    def resume(self, found: Candidate) -> Candidate:
        """The best rendering among the candidate and its refinements, with free weights or weights |det| + 0.01."""
        steps = self.params.moves.polish_starts
        free = found.probabilities if found.weights is None else found.weights
        tried = (None, free) if self.params.moves.own_weights else (None,)
        tried = tried[-1:] if self.objective.levels.is_linear else tried  # linear levels determine the weights
        shown = [self.polished(refined(self.objective, self.masses, found.maps, weights, self.seed), steps)
                 for weights in tried]
        first = self._simpler(shown[0], shown[-1])
        best = self.polished(self.pruned(first), steps)
        if not self.objective.levels.is_exact:  # at this price, pruning may remove maps that a root needs
            best = min(best, self._with_root(first) or best, self._with_parents(first), key=self.score)
        return self.candidate(self._with_root(best) or best)

    def _with_root(self, best: Rendered) -> Rendered | None:
        """The code with the root of one of its largest maps, or None if no root is better."""
        moves = self.params.moves
        tried = moves.root_largest if self.objective.levels.is_exact or len(best.maps) > moves.root_all \
            else len(best.maps)
        tried = 0 if self.params.maps or not moves.root else tried
        for chosen in affine.volumes(best.maps).argsort(descending=True)[:tried].tolist():
            if self.deadline.passed:
                break
            new = min((rooted(self, best, chosen, order) for order in moves.root_orders), key=self.score)
            if self.score(new) < self.score(best):
                return self.polished(new, moves.polish_starts)
        return None

    def _with_parents(self, now: Rendered) -> Rendered:
        """The code with parents in the place of some maps, if that is better."""
        if self.params.maps:
            return now
        return with_fewer_maps(self.objective, now, self.price, self.params.moves.polish_starts, self.deadline)

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
        return self.candidate(self.polished(new, self.params.moves.polish_accepted))

    def cleaned(self, now: Candidate) -> Candidate:
        """Prune and polish the code for many steps; keep the result if it is better."""
        shown = self.shown(now)
        new = self.polished(self.pruned(shown), self.params.moves.polish_ends)
        return self.candidate(new) if self.score(new) < self.score(shown) else now

    def finish(self, now: Candidate) -> Candidate:
        """Clean and polish the code. On a binary image, polish it firmly in the frame as well, before and after that.
        If it is still far from right after the first firm polish, stop there: parts of a pixel do not matter yet."""
        before = self.noise_ratio(now)
        if self.objective.firm_frame() is None or before < self.params.frame.firm_above:
            return self._polished_last(now)
        now = self._firmly_framed(self.pruned(self.shown(now)))
        if min(before, self.noise_ratio(now)) > self.params.frame.firm_only:
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
            found = self._simpler(tied, found)
        last = self._last_judged(found)
        near = self.noise_ratio(self.candidate(last)) < self.params.frame.far
        fewer = pruned_in_frame(self.objective, last, self.price, self.params.maps or 0, near=near,
                                deadline=self.deadline)
        if len(fewer.maps) < len(last.maps):
            last = min(last, self._last_judged(fewer), key=self.score)
        return self.candidate(last)

    def simplified(self, now: Candidate) -> Candidate | None:
        """The code with simple numbers rounded, or None if there are none."""
        if not self.params.canonical.enabled:
            return None
        careful = self._careful()
        found, fixed = Rounding(careful, self.deadline).simplified(careful.judge(now.maps, now.weights))
        return self.candidate(self.objective.judge(found.maps, found.weights)) if fixed else None

    def judged(self, candidate: Candidate) -> Candidate:
        """The candidate with its error and score by this objective."""
        return self.candidate(self.objective.judge(candidate.maps, candidate.weights))

    def is_settled(self, now: Candidate, moves: int) -> bool:
        """Whether the code's rendering is as close to the image as the true code's would be, or nearly so after many
        moves."""
        if not self.objective.levels.is_exact:
            enough = moves >= self.params.moves.drawn_least and len(now.maps) >= (self.params.maps or 0)
            return enough and self.likeness(now) >= self.params.moves.alike
        worth = self.params.moves.settled + self.params.moves.settled_more * moves
        return self.noise_ratio(now) < worth and len(now.maps) >= (self.params.maps or 0)

    def likeness(self, now: Candidate) -> float:
        """The likeness of the code's rendering to the image, see `ImageObjective`."""
        return self.objective.likeness(self.shown(now).image)

    def noise_ratio(self, now: Candidate) -> float:
        """The error, relative to the error between two renderings of the same code."""
        shown = self.shown(now)
        if self._noise is None or self._noise[0] is not shown.maps:
            self._noise = shown.maps, self.objective.noise(shown.code)
        return shown.error / self._noise[1]

    # -- the last polish ----------------------------------------------------------------------------------------------

    def _last_judged(self, found: Rendered) -> Rendered:
        """The code after the last polish, judged by one rendering."""
        last = self._last_polish(found)
        return self.objective.judge(last.maps, last.weights)

    def _last_polish(self, found: Rendered) -> Rendered:
        """Polish the code on the mean of several renderings, which has less noise, and into the frame. If more than
        noise is left, polish it with a Jacobian from renderings."""
        careful, params = self._careful(), self.params.gauss_newton
        near = self.noise_ratio(self.candidate(found)) < self.params.frame.far
        best = fitted_into_frame(careful, careful.judge(found.maps, found.weights), self.params.moves.polish_ends,
                                 self.objective.own_frame() if near else None, deadline=self.deadline)
        ratio = self.noise_ratio(self.candidate(self.objective.judge(best.maps, best.weights)))
        is_open = params.rendered_steps and not self.objective.levels.is_linear and not self.deadline.passed
        if is_open and params.rendered_above < ratio < params.rendered_below:
            once = self.objective.within(self.objective.own_frame())
            last = polished(once, once.judge(best.maps, best.weights), params.rendered_steps, deadline=self.deadline,
                            jacobian=FromRenderings, alone=True)
            best = min(best, careful.judge(last.maps, last.weights), key=error_of)
        return best

    def _careful(self) -> ImageObjective:
        return ImageObjective(self.objective.image, self.objective.levels, self.params, self.seed,
                              self.params.image.last_renderings)

    def _simpler(self, tied: Rendered, own: Rendered) -> Rendered:
        """The code with free weights only if its error is much lower. Free weights also fit noise, and lag behind when
        maps move."""
        levels, moves = self.objective.levels, self.params.moves
        is_other = levels.is_linear or not levels.is_exact
        worth = moves.drawn_own_weights if moves.own_weights and is_other else moves.own_weights
        return own if own.error < worth * tied.error else tied

    # -- what moves are made of ---------------------------------------------------------------------------------------

    def pruned(self, rendered: Rendered) -> Rendered:
        """The code without maps that are not worth their price."""
        return pruned(self.objective, rendered, self.price, self.params.maps or 0, deadline=self.deadline)

    def polished(self, rendered: Rendered, steps: int, moving: Sequence[int] | None = None) -> Rendered:
        """The code after at most `steps` Gauss-Newton steps."""
        return polished(self.objective, rendered, steps, moving, deadline=self.deadline)

    def polished_last(self, new: Rendered, shown: Rendered, steps: int) -> Rendered:
        """The new code with its last map polished, if the code is promising."""
        if new.error > self.params.moves.promising * shown.error:
            return new
        return self.polished(new, steps, [len(new.maps) - 1])

    def polished_all(self, new: Rendered, shown: Rendered) -> Rendered:
        """The new code with all maps polished, if the code is hopeful."""
        hopeful = new.error < self.params.moves.hopeful * shown.error
        return self.polished(new, self.params.moves.polish_rest) if hopeful else new

    def corrected_measure(self, shown: Rendered) -> CorrectedMeasure:
        """The image's measure, corrected for saturation with the code `shown`."""
        if self._corrected is None or self._corrected.maps is not shown.maps:
            self._corrected = CorrectedMeasure.of(self.masses, shown, self.objective, derive(self.seed, "correct"))
        return self._corrected

    def score(self, rendered: Rendered) -> float:
        """The error plus the price of the maps; lower is better."""
        missing = max(0, (self.params.maps or 0) - len(rendered.maps))
        return self.price.score(rendered.error, len(rendered.maps)) + self.params.moves.missing * missing

    def framed_score(self, now: Candidate) -> float:
        """The score, with `framed_error` as the error; lower is better."""
        shown = self.shown(now)
        return self.score(replace(shown, error=self.objective.framed_error(shown)))

    def candidate(self, rendered: Rendered) -> Candidate:
        """What the search keeps of a rendering."""
        weights = None if rendered.weights is None else rendered.probabilities
        self._shown = replace(rendered, weights=weights)  # the same weights as in a resumed search
        return Candidate(rendered.maps, weights, rendered.error, self.score(rendered), self.objective.levels.camera)

    def shown(self, now: Candidate) -> Rendered:
        """The candidate's rendering."""
        if self._shown is None or self._shown.maps is not now.maps:
            self._shown = self.objective.judge(now.maps, now.weights)
        return self._shown
