"""A code and the camera of a picture that others drew, polished together."""

from __future__ import annotations

from ....cameras.estimate import is_of_a_density, nearest
from ....cameras.kinds import beside, kind_of, with_camera
from ....runtime.deadline import NO_DEADLINE, Deadline
from .gauss_newton import polished
from .jacobian import FromRenderings
from .objective import ImageObjective, Rendered

LIKELIEST = 3      # cameras of each kind with which a code is polished first
PLAUSIBLE = 0.7    # only cameras whose error is at most the least one divided by this are polished further
STROKED = 0.9      # strokes must have an error below this factor times that of the best pen or tiles
TURNS = 3          # most times that a code is polished by its renderings and its camera is estimated again
STEPS = 8          # of Gauss-Newton each time
MOST_MAPS, MOST_PIXELS = 12, 512   # maps of a code, and pixels a side, that are polished like this in seconds

Fit = tuple[ImageObjective, Rendered]   # a code as a camera sees it; the objective has this camera


def sharpened(objective: ImageObjective, found: Rendered, deadline: Deadline = NO_DEADLINE) -> Fit:
    """Polish the code together with its camera, starting from the likeliest cameras of each open kind, or, with a tone
    curve or the dots of what may be a scatter plot, from this camera alone. Return the code and the objective with the
    best of these cameras, or both as they are if none is better. A code of many maps or for a large image stays as it
    is, because this would take too long.

    Both are polished together because one makes up for the other: with a pen that is too thin, the best attractor is
    too large.
    """
    levels = objective.levels
    if deadline.passed or not may_be_sharpened(objective, found):
        return objective, found
    if is_of_a_density(objective.image, levels):
        return in_turns(objective, found, deadline)
    kinds = [kind for kind in levels.kinds if not kind_of(kind).is_curved]
    starts = [start for kind in kinds for start in _starts(objective, found, kind, deadline)]
    least = min(map(angle_of, starts), default=0.0)
    likely = [start for start in starts if angle_of(start) ** 2 <= least**2 / PLAUSIBLE]
    return min([(objective, found), *(in_turns(*start, deadline) for start in likely)], key=angle_of)


def may_be_sharpened(objective: ImageObjective, found: Rendered) -> bool:
    """Whether a code has a camera, and so few maps and pixels that polishing both together takes seconds."""
    levels = objective.levels
    return (not levels.is_exact and levels.camera.is_known and len(found.maps) <= MOST_MAPS
            and len(objective.image) <= MOST_PIXELS)


def _starts(objective: ImageObjective, found: Rendered, kind: str, deadline: Deadline) -> list[Fit]:
    """The code as the likeliest cameras of a kind see it, or those of one that is tried beside it and explains the
    picture much better: strokes beside pens and tiles."""
    starts = polish_under(objective, found, kind, deadline)
    for other in beside(kind) if starts else ():
        others = polish_under(objective, found, other, deadline)
        if others and others[0][1].error <= STROKED * starts[0][1].error:
            starts = others
    return starts


def in_turns(objective: ImageObjective, found: Rendered, deadline: Deadline) -> Fit:
    """Polish the code with its camera and estimate this camera again, of the same kind, in turns."""
    for _ in deadline.during(range(TURNS)):
        found = polished(objective, found, STEPS, deadline=deadline, jacobian=FromRenderings, camera=True)
        objective = objective.seen_with(found.levels)
        tried = nearest(objective.image, objective.levels, found.code, objective.seed)
        if not tried:
            break
        other = objective.seen_with(with_camera(objective.levels, tried[0][1]))
        again = other.judge(found.maps, found.weights)
        if again.error >= found.error:
            break
        objective, found = other, again
    return objective, found


def polish_under(objective: ImageObjective, found: Rendered, kind: str, deadline: Deadline) -> list[Fit]:
    """The code polished together with each of the likeliest cameras of a kind, the best first; empty if no such camera
    can draw it."""
    image, params, fits = objective.image, objective.params, []
    levels = kind_of(kind)(params.camera, image, kinds=objective.levels.kinds).within(objective.levels.known)
    for _, camera in deadline.during(nearest(image, levels, found.code, objective.seed)[:LIKELIEST]):
        other = ImageObjective(image, with_camera(levels, camera), params, objective.seed)
        shown = polished(other, other.judge(found.maps, found.weights), STEPS, deadline=deadline, camera=True)
        fits.append((other.seen_with(shown.levels), shown))
    return sorted(fits, key=angle_of)


def angle_of(fit: Fit) -> float:
    """The angle of error, by which cameras of all kinds can be compared."""
    objective, shown = fit
    return objective.angle(shown.error)
