"""The camera of a picture that others drew, estimated with a nearly right code."""

from __future__ import annotations

from torch import Tensor

from ....ifs.code import IFS
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from ..measure.levels import Levels
from ..measure.pens import Drawn, ToneMapped
from ..measure.tones import LEVELS, Camera, camera_of, seen_with
from ..params import CollageParams
from .gauss_newton import polished
from .jacobian import FromRenderings
from .objective import ImageObjective, Rendered


def estimated(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> Camera:
    """The camera with which the rendering of a code comes closest to the image (R,R); empty if the levels are exact or
    `CameraParams.estimate` is off.

    All values that the parameters list are tried. Dots are chosen only if they explain the image much better than a
    pen, and a tone curve only if it explains it much better than both. If the search already measures the image through
    a tone curve, the camera that explains it best is chosen."""
    if levels.is_exact or not levels.camera.estimate:
        return ()

    def best(name: str) -> tuple[float, Camera]:
        return nearest(image, LEVELS[name].of(image, levels.camera), code, params, seed)[0]

    if params.levels != "auto":
        return best(params.levels)[1]
    limits, pen, dots = levels.camera, best("coverage"), best("dots")
    if isinstance(levels, ToneMapped):
        return min(pen, dots, best("tonemapped"))[1]
    likely = dots if dots[0] < limits.dotted * pen[0] else pen
    if dots[0] <= limits.curved_from * pen[0]:
        curve = best("tonemapped")
        likely = curve if curve[0] < limits.dotted * likely[0] else likely
    return likely[1]


def nearest(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> list[tuple[float, Camera]]:
    """The cameras of this kind with which a code comes closest to the image (R,R): one for each value of
    `Levels.drawn`, with its angle of error, the lowest first. Empty if such a camera cannot draw the code."""
    judge, found = ImageObjective(image, levels, params), {}
    for values, rendering in levels.candidates(code, len(image), derive(seed, "camera")):
        tried = judge.angle(judge.error(rendering.to(image))), camera_of(levels, values)
        key = levels.drawn(values)
        found[key] = min(tried, found.get(key, tried))
    return sorted(found.values())


def angle_as_density(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> float:
    """The least angle of error between the image (R,R) and the density of a code, with or without a tone curve."""
    return min(nearest(image, LEVELS[name].of(image, levels.camera), code, params, seed)[0][0]
               for name in ("dots", "tonemapped"))


def sharpened(objective: ImageObjective, found: Rendered, deadline: Deadline = NO_DEADLINE
              ) -> tuple[ImageObjective, Rendered]:
    """Polish the code by its renderings and estimate the camera again, in turns, as long as the error falls. Return the
    code and the objective with the last camera. Strokes are tried where a pen drew lines. A code of many maps or for a
    large image stays as it is, because this would take too long."""
    camera, levels = objective.params.camera, objective.levels
    if (levels.is_exact or not levels.values or deadline.passed or len(found.maps) > camera.sharpened_maps
            or len(objective.image) > camera.sharpened_side):
        return objective, found
    strokes = as_strokes(objective, found, deadline) if isinstance(objective.levels, Drawn) else []
    least = min((shown.error for _, shown in strokes), default=found.error)
    starts = [start for start in strokes if start[1].error <= least / camera.plausible] \
        if least < camera.stroked * found.error else [(objective, found)]
    return min((in_turns(*start, deadline) for start in starts), key=lambda end: end[1].error)


def in_turns(objective: ImageObjective, found: Rendered, deadline: Deadline) -> tuple[ImageObjective, Rendered]:
    """Polish the code and estimate its camera, of the same kind, in turns."""
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


def as_strokes(objective: ImageObjective, found: Rendered, deadline: Deadline
                ) -> list[tuple[ImageObjective, Rendered]]:
    """The code polished as strokes of a recursion that ended, once for each of the likeliest depths."""
    params, levels, tried = objective.params, objective.levels, []
    strokes = LEVELS["strokes"].of(objective.image, params.camera)
    for _, camera in nearest(objective.image, strokes, found.code, params, objective.seed)[:params.camera.depths]:
        other = objective.seen_with(seen_with(levels, camera))
        tried.append((other, polished(other, other.judge(found.maps, found.weights), params.camera.sharpened_steps,
                                      deadline=deadline)))
    return tried
