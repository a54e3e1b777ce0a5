"""The camera of a picture that others drew, estimated with a nearly right code."""

from __future__ import annotations

import math

from torch import Tensor

from ..ifs.code import IFS
from ..runtime.deadline import check_time
from ..runtime.seeds import derive
from .camera import Camera
from .comparison import WITHIN_NOISE, Comparison
from .kinds import kind_of, of_others, with_camera
from .levels import Levels, may_be_density, may_be_dots

DOTTED = 0.75   # dots, or a tone curve, need an angle of error below this factor times that of simpler kinds
TILED = 0.7     # tiles must have an angle below this factor times the pen's: they show the picture itself

Tried = tuple[float, Camera]   # an angle of error, and the camera that has it


def estimated(image: Tensor, levels: Levels, code: IFS, seed: int) -> Camera | None:
    """The camera with which the rendering of a code comes closest to the image (R,R); None if the levels are exact,
    `CameraParams.estimate` is off, or no camera can draw the code.

    All values are tried, of the kinds that the picture may have (`Levels.kinds`), one kind after the other. Tiles are
    chosen only if they explain the image much better than a pen that draws the attractor, and each other kind only if
    it explains it much better than those before: dots than pens and tiles, a tone curve than all of them. If the image
    is seen as a density or is grey inside, the camera that explains it best is chosen, of those that draw the
    attractor. Dots are chosen in any case if they explain the image to its noise."""
    if levels.is_exact or not levels.params.estimate:
        return None
    angles, is_density = dict[str, float](), is_of_a_density(image, levels) or may_be_density(image)
    below, tiled = (1.0, 0.0) if is_density else (DOTTED, TILED)
    likely: Tried | None = None
    for name in levels.kinds:
        kind = kind_of(name)(levels.params, image, kinds=levels.kinds).within(levels.known)
        if is_density or kind.is_worth_trying(angles):
            found = _likely(kind, nearest(image, kind, code, seed), tiled)
            if found and kind.is_grainy and _explain(image, with_camera(kind, found[1]), code, seed):
                return found[1]
            angles[name] = found[0] if found else math.inf
            if found and (likely is None or found[0] < below * likely[0]):
                likely = found
    return likely and likely[1]


def _explain(image: Tensor, dots: Levels, code: IFS, seed: int) -> bool:
    """Whether nothing but their noise is left of an image (R,R) beside the dots of a code."""
    comparison = Comparison(image, dots, seed)
    return may_be_dots(image) and comparison.noise_ratio(code, comparison.render(code)) < WITHIN_NOISE


def is_of_a_density(image: Tensor, levels: Levels) -> bool:
    """Whether the camera of these levels is one that the image (R,R) of a density may have: a tone curve, or dots, if
    it may be a scatter plot."""
    return levels.is_curved or levels.is_density and may_be_dots(image)


def angle_of(tried: Tried) -> float:
    """Sort key: the angle of error."""
    return tried[0]


def showing(image: Tensor, levels: Levels, code: IFS, seed: int) -> Camera | None:
    """The camera with which the drawing of a code is most like the shape on the image (R,R): with the highest F1 within
    a pixel, to a hundredth, and then the least error. It is of the kind that `estimated` finds, and None if that finds
    none.

    It is for grown maps. They cover a shape evenly, so the error, which compares grey levels, may prefer a camera that
    draws them too faint to be seen."""
    camera = estimated(image, levels, code, seed)
    if camera is None:
        return None
    seen = with_camera(levels, camera)
    judge = Comparison(image, seen)

    def merit(tried: tuple[Camera, Tensor]) -> tuple[float, float]:
        rendering = tried[1].to(image)
        return round(judge.likeness(rendering), 2), -judge.error(rendering)

    whole = (tried for tried in seen.candidates(code, len(image), derive(seed, "camera"))
             if with_camera(levels, tried[0]).shows_attractor)
    return max(whole, key=merit)[0]


def nearest(image: Tensor, levels: Levels, code: IFS, seed: int) -> list[Tried]:
    """The cameras of this kind with which a code comes closest to the image (R,R): one for each value of
    `Levels.what_is_drawn`, with its angle of error, the lowest first. Empty if such a camera cannot draw the code."""
    judge, found = Comparison(image, levels), {}
    for camera, rendering in levels.candidates(code, len(image), derive(seed, "camera")):
        check_time()
        tried = judge.angle(judge.error(rendering.to(image))), camera
        key = levels.what_is_drawn(camera)
        found[key] = min(found.get(key, tried), tried, key=angle_of)
    return sorted(found.values(), key=angle_of)


def _likely(levels: Levels, tried: list[Tried], tiled: float) -> Tried | None:
    """The best camera that draws the attractor, unless tiles have an angle below `tiled` times its own. Tiles show the
    picture itself, so they suit a wrong code too. None if no camera was tried."""
    if not tried:
        return None
    whole = [each for each in tried if with_camera(levels, each[1]).shows_attractor]
    return tried[0] if not whole or tried[0][0] < tiled * whole[0][0] else whole[0]


def angle_as_density(image: Tensor, levels: Levels, code: IFS, seed: int) -> float:
    """The least angle of error between the image (R,R) and the density of a code, with or without a tone curve."""
    kinds = [kind_of(name)(levels.params, image).within(levels.known) for name in of_others()
             if kind_of(name).is_density]
    return min((angle for kind in kinds for angle, _ in nearest(image, kind, code, seed)[:1]), default=math.inf)
