"""One loop for simpler codes: propose some, polish each, accept by one rule.

A code is simpler if it has fewer maps, or more numbers that are simple. Each way to simpler codes is a function from a
`Draft` to others, in a `Proposer` that says how they are polished. A new way is such a function, an entry where codes
are `simplified`, a parameter that switches it off, with its file in `conf/without`, and a test. A way that is switched
off proposes nothing. One that `repeats` proposes codes of fewer maps, or of more fixed entries, than the draft's, so
that the loop ends.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property

from torch import Tensor

from ....likeness import UNLIKE
from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.gauss_newton import polished
from ..image.jacobian import FromPoints, FromRenderings
from ..image.objective import Frame, ImageObjective, Rendered
from ..params import CollageParams

NEEDED = 1.5          # factor on the score above which a map whose absence raises it so is not tried again
DRAWN_WORSE = 1.5     # factor on the error: a picture that others drew tells less precisely which code is right
DRAWN_NOISE = 0.06    # error, radians rms, that counts as noise in such a picture, as no camera draws quite like it


@dataclass(frozen=True)
class Draft:
    """A code as a camera sees it. objective: the image, with this camera; fixed: the entries (map, column) that are
    simple and stay as they are; frame: what polishes of the others must fill, if anything."""

    objective: ImageObjective
    shown: Rendered
    fixed: frozenset[tuple[int, int]] = frozenset()
    frame: Frame | None = None

    def judged(self, maps: Tensor, weights: Tensor | None) -> Draft:
        """Other maps with the same camera."""
        return Draft(self.objective, self.objective.judge(maps, weights))


Way = Callable[[Draft], Iterable[Draft]]
Polish = Callable[[Draft, Deadline], Iterator[Draft]]


@dataclass(frozen=True)
class Price:
    """What a map, or a number that is not simple, is worth. The score of a code is its error, or `noise` if that is
    more, times 1 + `share` for each map, plus `error` for each map. The share counts where even the true code's error
    is more than noise. A simpler code may have `worse` times the lowest score so far."""

    error: float = 0.0
    share: float = 0.0
    worse: float = 1.0
    noise: float = 0.0

    @classmethod
    def of_drawn(cls, objective: ImageObjective) -> Price:
        """The price in a picture that others drew."""
        return cls(worse=DRAWN_WORSE, noise=objective.error_at(DRAWN_NOISE))

    def score(self, error: float, maps: int) -> float:
        """The score of a code with this error and number of maps; lower is better."""
        return max(error, self.noise) * (1 + self.share) ** maps + self.error * maps


def unpolished(draft: Draft, deadline: Deadline) -> Iterator[Draft]:
    """The code as it is."""
    yield draft


def maps_polished(steps: int) -> Polish:
    """Polish all maps for so many steps."""
    def polish(draft: Draft, deadline: Deadline) -> Iterator[Draft]:
        yield Draft(draft.objective, polished(draft.objective, draft.shown, steps, deadline=deadline))
    return polish


def camera_polished(steps: int) -> Polish:
    """Polish all maps together with the camera; then do it again with the slower Jacobian."""
    def polish(draft: Draft, deadline: Deadline) -> Iterator[Draft]:
        for jacobian in FromPoints, FromRenderings:
            shown = polished(draft.objective, draft.shown, steps, deadline=deadline, jacobian=jacobian, camera=True)
            draft = Draft(draft.objective.seen_with(shown.levels), shown)
            yield draft
    return polish


@dataclass(frozen=True)
class Proposer:
    """A way to simpler codes, and the exceptions that it needs.

    polish: yields ever better versions of a proposed code, until one is accepted; worse: in the place of `Price.worse`;
    loss: by how much a code may lose likeness, None: likeness does not count; early: whether a code must be acceptable
    before it is polished, to save time; repeats: whether it proposes again once it was accepted.
    """

    way: Way
    polish: Polish = unpolished
    worse: float | None = None
    loss: float | None = None
    early: bool = False
    repeats: bool = True


def simplified(start: Draft, proposers: Iterable[Proposer], price: Price, deadline: Deadline = NO_DEADLINE) -> Draft:
    """The code after all changes that the rule accepts; `start` itself if there are none.

    Each proposer has its turn, which lasts as long as any of its codes is accepted. Of several, the one of lowest score
    is taken. A code is accepted if its score is at most `worse` times the lowest so far. If the proposer names a loss,
    its drawing must also be as like the picture as that of `start`, less this loss. So must its attractor, or it must
    be like the picture to `UNLIKE`.
    """
    rule, now, asked = _Rule(start, price), start, dict[Proposer, Draft]()
    for proposer in proposers:
        while not deadline.passed and asked.get(proposer) is not now:
            asked[proposer] = now
            accepted = [found for each in proposer.way(now) if (found := rule.accepted(each, proposer, deadline))]
            if accepted:
                now = min(accepted, key=rule.score)
                rule.least = min(rule.least, rule.score(now))
            if not proposer.repeats:
                break
    return now


class _Rule:
    """Which codes may take the place of `start`. least: the lowest score so far."""

    def __init__(self, start: Draft, price: Price):
        self.start, self.price = start, price
        self.least = self.score(start)

    def score(self, draft: Draft) -> float:
        """An error counts subpixels, of which cameras have different numbers."""
        error = draft.shown.error * (self.start.objective.subpixels / draft.objective.subpixels)
        return self.price.score(error, len(draft.shown.maps))

    def accepted(self, proposed: Draft, proposer: Proposer, deadline: Deadline) -> Draft | None:
        """What is proposed, polished until it is acceptable; None if it never is."""
        most = (self.price.worse if proposer.worse is None else proposer.worse) * self.least
        if proposer.early and not (self.score(proposed) <= most and self._is_alike(proposed, proposer.loss)):
            return None
        for tried in proposer.polish(proposed, deadline):
            if not self._is_alike(tried, proposer.loss):
                return None
            if self.score(tried) <= most:
                return tried
        return None

    def _is_alike(self, draft: Draft, loss: float | None) -> bool:
        if loss is None:
            return True
        drawing, attractor = (each - loss for each in self._likenesses)
        found = draft.objective.likenesses(draft.shown)
        return found[0] >= drawing and found[1] >= min(attractor, UNLIKE)

    @cached_property
    def _likenesses(self) -> tuple[float, float]:
        return self.start.objective.likenesses(self.start.shown)


def fewest(params: CollageParams) -> int:
    """The number of maps that must stay."""
    return max(2, params.maps or 0)


def without_one(draft: Draft) -> Iterable[Draft]:
    """The code without one of its maps."""
    objective, shown = draft.objective, draft.shown
    gone = range(len(shown.maps)) if len(shown.maps) > fewest(objective.params) else ()
    return [Draft(objective, objective.without(shown, [i])) for i in gone]


class Pruning:
    """The way to a code without one of its maps, unless pruning is switched off. A map without which the score is more
    than `NEEDED` times as high is not tried again: it hardly becomes needless while others go. Roots bring so many maps
    that every trial counts."""

    def __init__(self, price: Price):
        self.price, self.needed = price, set[tuple[float, ...]]()

    def __call__(self, draft: Draft) -> list[Draft]:
        objective, maps = draft.objective, draft.shown.maps
        if not objective.params.moves.pruning or len(maps) <= fewest(objective.params):
            return []
        now, rows, found = self._score(draft), [tuple(one) for one in maps.tolist()], []
        for i, one in enumerate(rows):
            if one not in self.needed:
                found.append(Draft(objective, objective.without(draft.shown, [i])))
                if self._score(found[-1]) > NEEDED * now and rows.count(one) == 1:  # its double may be needless
                    self.needed.add(one)
        return found

    def _score(self, draft: Draft) -> float:
        return self.price.score(draft.shown.error, len(draft.shown.maps))


def pruned(objective: ImageObjective, shown: Rendered, price: Price, deadline: Deadline = NO_DEADLINE) -> Rendered:
    """The code without maps that are not worth their price."""
    return simplified(Draft(objective, shown), [Proposer(Pruning(price))], price, deadline).shown


def pruned_in_frame(objective: ImageObjective, shown: Rendered, price: Price, *, near: bool,
                    deadline: Deadline = NO_DEADLINE) -> Rendered:
    """Like `pruned`, for a polished code. In a nearly right code, even a map that nobody sees may decide the frame."""
    framed = objective.within(objective.own_frame() if near else None)
    fewer = pruned(framed, framed.judge(shown.maps, shown.weights), price, deadline)
    return shown if len(fewer.maps) == len(shown.maps) else objective.judge(fewer.maps, fewer.weights)
