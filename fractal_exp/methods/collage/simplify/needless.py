"""Codes without needless maps, for a picture that others drew. The camera moves along."""

from __future__ import annotations

from collections.abc import Iterator

from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.camera import Fit, may_be_sharpened
from ..image.gauss_newton import polished
from ..image.jacobian import FromPoints, FromRenderings
from ..image.objective import ImageObjective, Rendered, error_of
from .likeness import likeness_of_attractor, worst_error
from .parents import without_contained


def without_needless(seen: Fit, least: int, deadline: Deadline = NO_DEADLINE, *, contained: bool = False) -> Fit:
    """Remove maps whose absence the camera can make up for, and polish the others together with the camera.

    A code of too many maps and its camera are made for each other. With this camera, the code without such a map looks
    worse than it is. So both codes are polished together with the camera before they are compared. A removal may raise
    the error to `worst_error`. It may lower the likeness of the drawing by `MoveParams.needless`. The likeness of the
    attractor may fall as far, or to `StageParams.unlike` if that is lower. At least `least` maps stay, and at least
    two. contained: whether to try no more than the removal of all contained maps, which takes no time if there are
    none. If no map is removed, `seen` is returned.
    """
    objective, shown = seen
    params, least = objective.params, max(2, least)
    if params.moves.needless is None or len(shown.maps) <= least or not may_be_sharpened(objective, shown):
        return seen
    if contained and without_contained(objective, shown, least) is shown:
        return seen

    def polished_with_camera(tried: Rendered, **options) -> Rendered:
        return polished(objective, tried, params.canonical.polish, deadline=deadline, camera=True, **options)

    shown = polished_with_camera(shown)
    objective, before = objective.seen_with(shown.levels), len(shown.maps)
    worst = worst_error(objective, shown)
    drawing, attractor = (each - params.moves.needless for each in _likenesses(objective, shown))
    goals = drawing, min(attractor, params.stages.unlike)

    def is_alike(other: Rendered) -> bool:
        likenesses = _likenesses(objective.seen_with(other.levels), other)
        return all(each >= goal for each, goal in zip(likenesses, goals, strict=True))

    def fewer() -> Rendered | None:
        for tried in _trials(objective, shown, least, single=not contained):
            for jacobian in FromPoints, FromRenderings:
                if deadline.passed:
                    return None
                tried = polished_with_camera(tried, jacobian=jacobian)
                if not is_alike(tried):
                    break
                if tried.error <= worst:
                    return tried
        return None

    while found := fewer():
        objective, shown = objective.seen_with(found.levels), found
    return seen if len(shown.maps) == before else (objective, shown)


def _trials(objective: ImageObjective, shown: Rendered, least: int, *, single: bool) -> Iterator[Rendered]:
    """The code without all contained maps, and then without one map, those with the lowest errors first."""
    if len(shown.maps) <= least:
        return
    bare = without_contained(objective, shown, least)
    if bare is not shown:
        yield bare
    if single:
        fewer = (objective.without(shown, [i]) for i in range(len(shown.maps)))
        yield from sorted(fewer, key=error_of)[:objective.params.moves.needless_tried]


def _likenesses(objective: ImageObjective, shown: Rendered) -> tuple[float, float]:
    """The likeness of the drawing (F1 within a pixel), and that of the attractor."""
    return objective.likeness(shown.image), likeness_of_attractor(shown.code, objective.image, objective.levels)
