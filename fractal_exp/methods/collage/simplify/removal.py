"""Codes without maps that the image does not justify."""

from __future__ import annotations

from collections.abc import Iterable

from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.camera import may_be_sharpened
from ..image.objective import ImageObjective, Rendered
from ..params import CollageParams
from .loop import Draft, Price, Proposer, Way, camera_polished, maps_polished, simplified

TRIED = 2   # single maps that are left out on trial where each trial is a polish with the camera, which takes seconds


def fewest(params: CollageParams) -> int:
    """The number of maps that must stay."""
    return max(2, params.maps or 0)


def without_one(draft: Draft) -> Iterable[Draft]:
    """The code without one of its maps."""
    objective, shown = draft.objective, draft.shown
    gone = range(len(shown.maps)) if len(shown.maps) > fewest(objective.params) else ()
    return [Draft(objective, objective.without(shown, [i])) for i in gone]


def without_least(draft: Draft) -> Iterable[Draft]:
    """The code without one of those maps that are missed least."""
    return sorted(without_one(draft), key=lambda each: each.shown.error)[:TRIED]


def unseen(params: CollageParams) -> list[Proposer]:
    """Leave out maps that nobody sees. Such maps compensate for an imperfect camera, for instance for the widths of a
    tree's branches."""
    loss, steps = params.moves.unseen, params.rounding.polish
    return [] if loss is None else [Proposer(without_one, maps_polished(steps), loss=loss, early=True)]


def without_needless(draft: Draft, *ways: Way, deadline: Deadline = NO_DEADLINE) -> Draft:
    """Leave out maps whose absence the camera can make up for.

    A code of too many maps and its camera are made for each other. With this camera, the code without such a map looks
    worse than it is. So both codes are polished together with the camera before they are compared. If no map is left
    out, `draft` itself is returned, and it takes no time if there is none to try.
    """
    params = draft.objective.params
    is_open = params.moves.needless is not None and may_be_sharpened(draft.objective, draft.shown)
    if not is_open or not any(True for way in ways for _ in way(draft)):
        return draft
    polish = camera_polished(params.rounding.polish)
    start = next(polish(draft, deadline))
    proposers = [Proposer(way, polish, loss=params.moves.needless) for way in ways]
    found = simplified(start, proposers, Price.of_drawn(start.objective), deadline)
    return draft if found is start else found


def pruning(params: CollageParams) -> list[Proposer]:
    """Leave out maps that are not worth their price."""
    return [Proposer(without_one)] if params.moves.pruning else []


def pruned(objective: ImageObjective, shown: Rendered, price: Price, deadline: Deadline = NO_DEADLINE) -> Rendered:
    """The code without maps that are not worth their price."""
    return simplified(Draft(objective, shown), pruning(objective.params), price, deadline).shown


def pruned_in_frame(objective: ImageObjective, shown: Rendered, price: Price, *, near: bool,
                    deadline: Deadline = NO_DEADLINE) -> Rendered:
    """Like `pruned`, for a polished code. In a nearly right code, even a map that nobody sees may decide the frame."""
    framed = objective.within(objective.own_frame() if near else None)
    fewer = pruned(framed, framed.judge(shown.maps, shown.weights), price, deadline)
    return shown if len(fewer.maps) == len(shown.maps) else objective.judge(fewer.maps, fewer.weights)
