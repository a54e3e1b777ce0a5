"""The camera of a picture that others drew, estimated with a nearly right code."""

from __future__ import annotations

from torch import Tensor

from ....ifs.code import IFS
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from ..camera.levels import Levels
from ..camera.pens import ToneMapped
from ..camera.tones import LEVELS, Camera, camera_of, seen_with
from ..params import CollageParams
from .gauss_newton import polished
from .jacobian import FromRenderings
from .objective import ImageObjective, Rendered

Seen = tuple[ImageObjective, Rendered]   # a code as a camera sees it; the objective has this camera


def estimated(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> Camera:
    """The camera with which the rendering of a code comes closest to the image (R,R); empty if the levels are exact or
    `CameraParams.estimate` is off.

    All values that the parameters list are tried, of the kinds that the user leaves open
    (`CollageParams.camera_kinds`). Tiles are chosen only if they explain the image much better than a pen that draws
    the attractor, dots only if they explain it much better than both, and a tone curve only if it explains it much
    better than pens, tiles and dots. If the search already measures the image through a tone curve, the camera that
    explains it best is chosen."""
    if levels.is_exact or not levels.camera.estimate:
        return ()

    def best(name: str) -> tuple[float, Camera]:
        kind = LEVELS[name].of(image, levels.camera)
        return _likely(kind, nearest(image, kind, code, params, seed))

    kinds, limits = params.camera_kinds, levels.camera
    if len(kinds) == 1 or isinstance(levels, ToneMapped):
        return min(map(best, kinds))[1]
    dots = best("dots")
    pen = best("coverage") if "coverage" in kinds else (float("inf"), ())
    likely = dots if dots[0] < limits.dotted * pen[0] else pen
    if dots[0] <= limits.curved_from * pen[0]:
        curve = best("tonemapped")
        likely = curve if curve[0] < limits.dotted * likely[0] else likely
    return likely[1]


def showing(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> Camera:
    """The camera with which the drawing of a code is most like the shape on the image (R,R): with the highest F1 within
    a pixel, to a hundredth, and then the least error. It is of the kind that `estimated` finds, and empty if that
    finds none.

    It is for grown maps. They cover a shape evenly, so the error, which compares grey levels, may prefer a camera that
    draws them too faint to be seen."""
    camera = estimated(image, levels, code, params, seed)
    if not camera:
        return ()
    seen = seen_with(levels, camera)
    judge = ImageObjective(image, seen, params)

    def merit(tried: tuple[tuple[float, ...], Tensor]) -> tuple[float, float]:
        rendering = tried[1].to(image)
        return round(judge.likeness(rendering), 2), -judge.error(rendering)

    whole = (tried for tried in seen.candidates(code, len(image), derive(seed, "camera"))
             if seen_with(levels, camera_of(seen, tried[0])).shows_attractor)
    return camera_of(seen, max(whole, key=merit)[0])


def nearest(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> list[tuple[float, Camera]]:
    """The cameras of this kind with which a code comes closest to the image (R,R): one for each value of
    `Levels.drawn`, with its angle of error, the lowest first. Empty if such a camera cannot draw the code."""
    judge, found = ImageObjective(image, levels, params), {}
    for values, rendering in levels.candidates(code, len(image), derive(seed, "camera")):
        tried = judge.angle(judge.error(rendering.to(image))), camera_of(levels, values)
        key = levels.drawn(values)
        found[key] = min(tried, found.get(key, tried))
    return sorted(found.values())


def _likely(levels: Levels, tried: list[tuple[float, Camera]]) -> tuple[float, Camera]:
    """The best camera that draws the attractor, unless tiles come much closer. Tiles show the picture itself, so they
    suit a wrong code too."""
    whole = [each for each in tried if seen_with(levels, each[1]).shows_attractor]
    return tried[0] if not whole or tried[0][0] < levels.camera.tiled * whole[0][0] else whole[0]


def angle_as_density(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> float:
    """The least angle of error between the image (R,R) and the density of a code, with or without a tone curve."""
    return min(nearest(image, LEVELS[name].of(image, levels.camera), code, params, seed)[0][0]
               for name in ("dots", "tonemapped"))


def sharpened(objective: ImageObjective, found: Rendered, deadline: Deadline = NO_DEADLINE) -> Seen:
    """Polish the code together with its camera, starting from the likeliest cameras of each open kind, or, with a tone
    curve, from this curve alone. Return the code and the objective with the best of these cameras, or both as they are
    if none is better. A code of many maps or for a large image stays as it is, because this would take too long.

    Both are polished together because one makes up for the other: with a pen that is too thin, the best attractor is
    too large.
    """
    camera, levels = objective.params.camera, objective.levels
    if deadline.passed or not may_be_sharpened(objective, found):
        return objective, found
    if isinstance(levels, ToneMapped):
        return in_turns(objective, found, deadline)
    kinds = [kind for kind in objective.params.camera_kinds if kind != "tonemapped"]
    starts = [start for kind in kinds for start in _starts(objective, found, kind, deadline)]
    least = min(map(angle_of, starts), default=0.0)
    likely = [start for start in starts if angle_of(start) ** 2 <= least**2 / camera.plausible]
    return min([(objective, found), *(in_turns(*start, deadline) for start in likely)], key=angle_of)


def may_be_sharpened(objective: ImageObjective, found: Rendered) -> bool:
    """Whether a code has a camera, and so few maps and pixels that polishing both together takes seconds."""
    camera, levels = objective.params.camera, objective.levels
    return (not levels.is_exact and bool(levels.values) and len(found.maps) <= camera.sharpened_maps
            and len(objective.image) <= camera.sharpened_side)


def _starts(objective: ImageObjective, found: Rendered, kind: str, deadline: Deadline) -> list[Seen]:
    """The code as the likeliest cameras of a kind see it. Strokes are tried beside pens and tiles. Strokes replace pens
    and tiles if they explain the picture much better."""
    camera = objective.params.camera
    starts = as_seen(objective, found, kind, deadline)
    if kind == "coverage" and starts:
        strokes = as_seen(objective, found, "strokes", deadline)
        if strokes and strokes[0][1].error <= camera.stroked * starts[0][1].error:
            return strokes
    return starts


def in_turns(objective: ImageObjective, found: Rendered, deadline: Deadline) -> Seen:
    """Polish the code with its camera and estimate this camera again, of the same kind, in turns."""
    params = objective.params
    for _ in range(params.camera.turns):
        if deadline.passed:
            break
        found = polished(objective, found, params.camera.sharpened_steps, deadline=deadline, jacobian=FromRenderings,
                         camera=True)
        objective = objective.seen_with(found.levels)
        tried = nearest(objective.image, objective.levels, found.code, params, objective.seed)
        if not tried:
            break
        other = objective.seen_with(seen_with(objective.levels, tried[0][1]))
        again = other.judge(found.maps, found.weights)
        if again.error >= found.error:
            break
        objective, found = other, again
    return objective, found


def as_seen(objective: ImageObjective, found: Rendered, kind: str, deadline: Deadline) -> list[Seen]:
    """The code polished together with each of the likeliest cameras of a kind, the best first; empty if no such camera
    can draw it."""
    image, params, seen = objective.image, objective.params, []
    levels = LEVELS[kind].of(image, params.camera)
    for _, camera in nearest(image, levels, found.code, params, objective.seed)[:params.camera.likeliest]:
        if deadline.passed:
            break
        other = ImageObjective(image, seen_with(levels, camera), params, objective.seed)
        shown = polished(other, other.judge(found.maps, found.weights), params.camera.sharpened_steps,
                         deadline=deadline, camera=True)
        seen.append((other.seen_with(shown.levels), shown))
    return sorted(seen, key=angle_of)


def angle_of(seen: Seen) -> float:
    """The angle of error, by which cameras of all kinds can be compared."""
    objective, shown = seen
    return objective.angle(shown.error)
