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
    found = [nearest(image, levels, code, params, seed, name)[0]
             for name in (DRAWN if params.levels == "auto" else (params.levels,))]
    (likely, camera), *others = found
    return next((other for angle, other in others if angle < levels.camera.dotted * likely), camera)


def nearest(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int, name: str
            ) -> list[tuple[float, Camera]]:
    """The cameras of one kind with which a code comes nearest to the image (R,R), one for each of what they draw (see
    `Levels.drawn`), each with its angle of error, the least first."""
    kind = LEVELS[name].of(image, levels.camera)
    judge, found = ImageObjective(image, kind, params), {}
    for values, rendering in kind.candidates(code, len(image), derive(seed, "camera")):
        tried = (judge.angle(judge.error(rendering)), (name, *values))
        key = kind.drawn(values)
        found[key] = min(tried, found.get(key, tried))
    return sorted(found.values())


def sharpened(objective: ImageObjective, found: Rendered, deadline: Deadline = NO_DEADLINE
              ) -> tuple[ImageObjective, Rendered]:
    """The code polished by its renderings and the camera estimated anew, in turns while both bring it nearer to the
    image; with the objective that has the last camera. Where strokes may explain lines better than a pen that draws the
    whole attractor, with either. A code of many maps stays as it is: it would take too long."""
    camera = objective.params.camera
    if objective.levels.is_exact or len(found.maps) > camera.sharpened_maps:
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
        levels = objective.levels
        (_, camera), *_ = nearest(objective.image, levels, found.code, params, objective.seed,
                                  str(camera_of(levels)[0]))
        other = objective.seen_with(seen_with(levels, camera))
        again = other.judge(found.maps, found.weights)
        if again.error >= found.error:
            break
        objective, found = other, again
    return objective, found


def _as_strokes(objective: ImageObjective, found: Rendered, deadline: Deadline
                ) -> list[tuple[ImageObjective, Rendered]]:
    """The code polished as strokes of a recursion that ended, at each of the likeliest depths."""
    params, levels, tried = objective.params, objective.levels, []
    for _, camera in nearest(objective.image, levels, found.code, params, objective.seed, "strokes"
                             )[:params.camera.depths]:
        other = objective.seen_with(seen_with(levels, camera))
        tried.append((other, polished(other, other.judge(found.maps, found.weights), params.camera.sharpened_steps,
                                      deadline=deadline)))
    return tried
