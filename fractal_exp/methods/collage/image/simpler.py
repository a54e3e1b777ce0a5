"""Codes without needless maps for a picture that others drew, each with a camera that moves along."""

from __future__ import annotations

from collections.abc import Iterator

from ....runtime.deadline import NO_DEADLINE, Deadline
from .camera import Seen
from .gauss_newton import polished
from .jacobian import FromPoints, FromRenderings
from .likeness import likeness_of_attractor, worst_error
from .objective import ImageObjective, Rendered, error_of
from .parents import without_contained


def without_needless(seen: Seen, least: int, deadline: Deadline = NO_DEADLINE) -> Seen:
    """Remove maps whose absence the camera can make up for, and polish the others together with the camera.

    A code of too many maps and its camera are made for each other. With this camera, the code without such a map looks
    worse than it is. Maps are removed if the error then stays within `worst_error`, the likeness of the drawing within
    `MoveParams.unseen` of the initial one, and that of the attractor above `StageParams.unlike`, or also within
    `unseen`. At least `least` maps stay.
    """
    objective, shown = seen
    params = objective.params
    if params.moves.unseen is None or not objective.levels.values:
        return seen
    worst = worst_error(objective, shown)
    drawing, attractor = (each - params.moves.unseen for each in _likenesses(objective, shown))
    goals = drawing, min(attractor, params.stages.unlike)

    def is_alike(other: Rendered) -> bool:
        likenesses = _likenesses(objective.seen_with(other.levels), other)
        return all(each >= goal for each, goal in zip(likenesses, goals, strict=True))

    def fewer() -> Rendered | None:
        for tried in _with_fewer_maps(objective, shown, max(2, least)):
            for jacobian in FromPoints, FromRenderings:
                tried = polished(objective, tried, params.canonical.polish, deadline=deadline, jacobian=jacobian,
                                 camera=True)
                if not is_alike(tried):
                    break
                if tried.error <= worst:
                    return tried
        return None

    while not deadline.passed and (found := fewer()):
        objective, shown = objective.seen_with(found.levels), found
    return objective, shown


def _with_fewer_maps(objective: ImageObjective, shown: Rendered, least: int) -> Iterator[Rendered]:
    """The code without all contained maps, and then without single maps, those with the lowest errors first."""
    number = len(shown.maps)
    if number <= least:
        return
    bare = without_contained(objective, shown, least)
    if len(bare.maps) < number:
        yield bare
    single = (objective.without(shown, [i]) for i in range(number))
    yield from sorted(single, key=error_of)[:objective.params.moves.needless_tried]


def _likenesses(objective: ImageObjective, shown: Rendered) -> tuple[float, float]:
    """The likeness of the drawing (F1 within a pixel), and that of the attractor."""
    return objective.likeness(shown.image), likeness_of_attractor(shown.code, objective.image, objective.levels)
