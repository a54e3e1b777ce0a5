"""The camera of a picture that others drew, estimated from a code that is nearly right."""

from __future__ import annotations

from torch import Tensor

from ....ifs.code import IFS
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from ..measure.levels import Levels
from ..measure.pens import Drawn
from ..measure.tones import LEVELS, Camera, camera_of, seen_with
from ..params import CollageParams
from .gauss_newton import polished
from .jacobian import FromRenderings
from .objective import ImageObjective, Rendered

DRAWN = "coverage", "dots"   # what a picture that others drew may be, the likelier first


def estimated(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> Camera:
    """The camera with which the rendering of a code comes nearest to the image (R,R); none where the levels are exact.

    All values that the parameters list are tried. Dots are taken only if they explain the image much better than a pen.
    """
    if levels.is_exact:
        return ()
    found = [nearest(image, LEVELS[name].of(image, levels.camera), code, params, seed)[0]
             for name in (DRAWN if params.levels == "auto" else (params.levels,))]
    (likely, camera), *others = found
    return next((other for angle, other in others if angle < levels.camera.dotted * likely), camera)


def nearest(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> list[tuple[float, Camera]]:
    """The cameras of the kind of these levels with which a code comes nearest to the image (R,R), one for each of what
    they draw (see `Levels.drawn`), each with its angle of error, the least first; none if the code shows nothing by
    this kind of camera."""
    judge, found = ImageObjective(image, levels, params), {}
    for values, rendering in levels.candidates(code, len(image), derive(seed, "camera")):
        tried = judge.angle(judge.error(rendering)), camera_of(levels, values)
        key = levels.drawn(values)
        found[key] = min(tried, found.get(key, tried))
    return sorted(found.values())


def sharpened(objective: ImageObjective, found: Rendered, deadline: Deadline = NO_DEADLINE
              ) -> tuple[ImageObjective, Rendered]:
    """The code polished by its renderings and the camera estimated anew, in turns while both bring it nearer to the
    image; with the objective that has the last camera. Strokes are tried where a pen drew lines. A code of many maps or
    in a large image stays as it is: it would take too long."""
    camera, levels = objective.params.camera, objective.levels
    if (levels.is_exact or not levels.values or deadline.passed or len(found.maps) > camera.sharpened_maps
            or len(objective.image) > camera.sharpened_side):
        return objective, found
    strokes = _as_strokes(objective, found, deadline) if isinstance(objective.levels, Drawn) else []
    least = min((shown.error for _, shown in strokes), default=found.error)
    starts = [start for start in strokes if start[1].error <= least / camera.plausible] \
        if least < camera.stroked * found.error else [(objective, found)]
    return min((_in_turns(*start, deadline) for start in starts), key=lambda end: end[1].error)


def _in_turns(objective: ImageObjective, found: Rendered, deadline: Deadline) -> tuple[ImageObjective, Rendered]:
    """The code polished, and its camera of the same kind estimated anew, in turns."""
    params = objective.params
    for _ in range(params.camera.turns):
        if deadline.passed:
            break
        found = polished(objective, found, params.camera.sharpened_steps, deadline=deadline, jacobian=FromRenderings)
        tried = nearest(objective.image, objective.levels, found.code, params, objective.seed)
        if not tried:
            break
        other = objective.seen_with(seen_with(objective.levels, tried[0][1]))
        again = other.judge(found.maps, found.weights)
        if again.error >= found.error:
            break
        objective, found = other, again
    return objective, found


def _as_strokes(objective: ImageObjective, found: Rendered, deadline: Deadline
                ) -> list[tuple[ImageObjective, Rendered]]:
    """The code polished as strokes of a recursion that ended, at each of the likeliest depths."""
    params, levels, tried = objective.params, objective.levels, []
    strokes = LEVELS["strokes"].of(objective.image, params.camera)
    for _, camera in nearest(objective.image, strokes, found.code, params, objective.seed)[:params.camera.depths]:
        other = objective.seen_with(seen_with(levels, camera))
        tried.append((other, polished(other, other.judge(found.maps, found.weights), params.camera.sharpened_steps,
                                      deadline=deadline)))
    return tried
