"""Codes without maps that the image does not justify."""

from __future__ import annotations

from collections.abc import Iterable

from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.camera import may_be_sharpened
from ..image.objective import ImageObjective, Rendered
from ..params import CollageParams
from .loop import Fit, Price, Proposer, Way, any_of, camera_polished, maps_polished, simplified

TRIED = 2   # single maps that are left out on trial where each trial is a polish with the camera, which takes seconds


def fewest(params: CollageParams) -> int:
    """The number of maps that must stay."""
    return max(2, params.maps or 0)


def without_one(fit: Fit) -> Iterable[Fit]:
    """The code without one of its maps."""
    objective, shown = fit.objective, fit.shown
    gone = range(len(shown.maps)) if len(shown.maps) > fewest(objective.params) else ()
    return [Fit(objective, objective.without(shown, [i])) for i in gone]


def without_least(fit: Fit) -> Iterable[Fit]:
    """The code without one of those maps that are missed least."""
    return sorted(without_one(fit), key=lambda each: each.shown.error)[:TRIED]


def unseen(params: CollageParams) -> list[Proposer]:
    """Leave out maps that nobody sees. Such maps compensate for an imperfect camera, for instance for the widths of a
    tree's branches."""
    loss, steps = params.moves.unseen, params.rounding.polish
    return [] if loss is None else [Proposer(without_one, maps_polished(steps), loss=loss, early=True)]


def without_needless(fit: Fit, *ways: Way, deadline: Deadline = NO_DEADLINE) -> Fit:
    """Leave out maps whose absence the camera can make up for.

    A code of too many maps and its camera are made for each other. With this camera, the code without such a map looks
    worse than it is. So both codes are polished together with the camera before they are compared. If no map is left
    out, `fit` itself is returned, and it takes no time if there is none to try.
    """
    params = fit.objective.params
    if params.moves.needless is None or not may_be_sharpened(fit.objective, fit.shown) or \
            next(iter(any_of(*ways)(fit)), None) is None:
        return fit
    polish = camera_polished(params.rounding.polish)
    start = next(polish(fit, deadline))
    proposers = [Proposer(way, polish, loss=params.moves.needless) for way in ways]
    found = simplified(start, proposers, Price.of_drawn(start.objective), deadline)
    return fit if found is start else found


def pruning(params: CollageParams) -> list[Proposer]:
    """Leave out maps that are not worth their price."""
    return [Proposer(without_one)] if params.moves.pruning else []


def pruned(objective: ImageObjective, shown: Rendered, price: Price, deadline: Deadline = NO_DEADLINE) -> Rendered:
    """The code without maps that are not worth their price."""
    return simplified(Fit(objective, shown), pruning(objective.params), price, deadline).shown


def pruned_in_frame(objective: ImageObjective, shown: Rendered, price: Price, *, near: bool,
                    deadline: Deadline = NO_DEADLINE) -> Rendered:
    """Like `pruned`, for a polished code. In a nearly right code, even a map that nobody sees may decide the frame."""
    framed = objective.within(objective.own_frame() if near else None)
    fewer = pruned(framed, framed.judge(shown.maps, shown.weights), price, deadline)
    return shown if len(fewer.maps) == len(shown.maps) else objective.judge(fewer.maps, fewer.weights)
