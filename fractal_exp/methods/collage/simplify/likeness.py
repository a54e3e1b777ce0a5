"""The likeness of a code to a picture that others drew, whatever the camera."""

from __future__ import annotations

from ....likeness import likeness_of_attractor
from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.gauss_newton import polished
from ..image.objective import ImageObjective, Rendered, error_of


def likeness_of(shown: Rendered, objective: ImageObjective) -> float:
    """The likeness of a code's drawing (F1 within a pixel), or of its attractor if that is lower and the image shows
    the whole attractor."""
    drawing = objective.likeness(shown.image)
    if not objective.levels.is_whole:
        return drawing
    return min(drawing, likeness_of_attractor(shown.code, objective.image, objective.levels))


def without_unseen(objective: ImageObjective, shown: Rendered, least: int, deadline: Deadline = NO_DEADLINE
                   ) -> Rendered:
    """Remove maps that nobody sees, one at a time, and polish the others.

    Such maps compensate for an imperfect camera, for instance for the widths of a tree's branches. A map is removed if
    the likeness stays within `MoveParams.unseen` of the initial one, and the error within `worst_error`. At least
    `least` maps stay.
    """
    params, worst = objective.params, worst_error(objective, shown)
    if params.moves.unseen is None:
        return shown
    goal = likeness_of(shown, objective) - params.moves.unseen
    while len(shown.maps) > max(2, least) and not deadline.passed:
        fewer = [objective.without(shown, [i]) for i in range(len(shown.maps))]
        alike = [each for each in fewer if each.error <= worst and likeness_of(each, objective) >= goal]
        if not alike:
            break
        shown = polished(objective, min(alike, key=error_of), params.canonical.polish, deadline=deadline)
    return shown


def worst_error(objective: ImageObjective, shown: Rendered) -> float:
    """The highest error with which a simpler code may replace a code of a picture that others drew."""
    canonical = objective.params.canonical
    return canonical.drawn_worse * max(shown.error, objective.error_at(canonical.drawn_noise))
