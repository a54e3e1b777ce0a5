"""One loop for simpler codes: propose some, polish each, accept by one rule.

A code is simpler if it has fewer maps, or more numbers that are simple. Each way to simpler codes is a function from a
`Fit` to others, in a `Proposer` that says how they are polished. A new way is such a function, an entry where codes are
`simplified`, and a test.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain

from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.frame import Frame
from ..image.gauss_newton import polished
from ..image.jacobian import FromPoints, FromRenderings
from ..image.objective import ImageObjective, Rendered
from .likeness import likenesses

DRAWN_WORSE = 1.5     # factor on the error: a picture that others drew tells less precisely which code is right
DRAWN_NOISE = 0.06    # error, radians rms, that counts as noise in such a picture, as no camera draws quite like it

Fixed = frozenset[tuple[int, int]]   # entries (map, column) of a code


@dataclass(frozen=True)
class Fit:
    """A code as a camera sees it. objective: the image, with this camera; fixed: the entries that are simple and stay
    as they are; frame: what polishes of the others must fill, if anything."""

    objective: ImageObjective
    shown: Rendered
    fixed: Fixed = frozenset()
    frame: Frame | None = None

    def judged(self, maps: Tensor, weights: Tensor | None) -> Fit:
        """Other maps with the same camera."""
        return Fit(self.objective, self.objective.judge(maps, weights))


Way = Callable[[Fit], Iterable[Fit]]
Polish = Callable[[Fit, Deadline], Iterator[Fit]]   # ever better versions, of which the first that is accepted is taken


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


def unpolished(fit: Fit, deadline: Deadline) -> Iterator[Fit]:
    """The code as it is."""
    yield fit


def maps_polished(steps: int) -> Polish:
    """Polish all maps for so many steps."""
    def polish(fit: Fit, deadline: Deadline) -> Iterator[Fit]:
        yield Fit(fit.objective, polished(fit.objective, fit.shown, steps, deadline=deadline))
    return polish


def camera_polished(steps: int) -> Polish:
    """Polish all maps together with the camera. If that does not suffice, do it again with the slower Jacobian."""
    def polish(fit: Fit, deadline: Deadline) -> Iterator[Fit]:
        for jacobian in FromPoints, FromRenderings:
            shown = polished(fit.objective, fit.shown, steps, deadline=deadline, jacobian=jacobian, camera=True)
            fit = Fit(fit.objective.seen_with(shown.levels), shown)
            yield fit
    return polish


@dataclass(frozen=True)
class Proposer:
    """A way to simpler codes, and the exceptions that it needs.

    worse: in the place of `Price.worse`; loss: by how much a code may lose likeness, None: likeness does not count;
    early: whether a code must be accepted before it is polished, to save time; repeats: whether it proposes again once
    it was accepted.
    """

    way: Way
    polish: Polish = unpolished
    worse: float | None = None
    loss: float | None = None
    early: bool = False
    repeats: bool = True


def any_of(*ways: Way) -> Way:
    """All that several ways propose."""
    return lambda fit: chain.from_iterable(way(fit) for way in ways)


def simplified(start: Fit, proposers: Iterable[Proposer], price: Price, deadline: Deadline = NO_DEADLINE) -> Fit:
    """The code after all changes that the rule accepts; `start` itself if there are none.

    Each proposer has its turn, which lasts as long as any of its codes is accepted. Of several, the one of lowest score
    is taken. A code is accepted if its score is at most `worse` times the lowest so far. If the proposer names a loss,
    its drawing must be as like the picture as that of `start`, less this loss, and its attractor must be so too, or
    like it to `StageParams.unlike`.
    """
    rule, now, asked = _Rule(start, price), start, dict[Proposer, Fit]()
    for proposer in proposers:
        while not deadline.passed and asked.get(proposer) is not now:
            asked[proposer] = now
            accepted = [fit for each in proposer.way(now) if (fit := rule.accepted(each, proposer, deadline))]
            if accepted:
                now = min(accepted, key=rule.score)
                rule.least = min(rule.least, rule.score(now))
            if not proposer.repeats:
                break
    return now


class _Rule:
    """Which codes may take the place of `start`. least: the lowest score so far."""

    def __init__(self, start: Fit, price: Price):
        self.start, self.price = start, price
        self.least = self.score(start)

    def score(self, fit: Fit) -> float:
        """An error counts subpixels, of which cameras have different numbers."""
        error = fit.shown.error * (self.start.objective.subpixels / fit.objective.subpixels)
        return self.price.score(error, len(fit.shown.maps))

    def accepted(self, proposed: Fit, proposer: Proposer, deadline: Deadline) -> Fit | None:
        """What is proposed, after a polish that makes it acceptable; None if none does."""
        if proposer.early and not (self._is_worth(proposed, proposer) and self._is_alike(proposed, proposer)):
            return None
        for tried in proposer.polish(proposed, deadline):
            if not self._is_alike(tried, proposer):
                return None
            if self._is_worth(tried, proposer):
                return tried
        return None

    def _is_worth(self, fit: Fit, proposer: Proposer) -> bool:
        return self.score(fit) <= (self.price.worse if proposer.worse is None else proposer.worse) * self.least

    def _is_alike(self, fit: Fit, proposer: Proposer) -> bool:
        if proposer.loss is None:
            return True
        drawing, attractor = (each - proposer.loss for each in self._likenesses)
        found = likenesses(fit.shown, fit.objective)
        return found[0] >= drawing and found[1] >= min(attractor, fit.objective.params.stages.unlike)

    @cached_property
    def _likenesses(self) -> tuple[float, float]:
        return likenesses(self.start.shown, self.start.objective)
