"""The camera of a picture that others drew, estimated with a nearly right code."""

from __future__ import annotations

from torch import Tensor

from ..ifs.code import IFS
from ..runtime.seeds import derive
from .camera import Camera
from .comparison import Comparison
from .kinds import kind_of, with_camera
from .levels import Levels

DOTTED = 0.75      # dots, or a tone curve, need an angle of error below this factor times that of simpler kinds
CURVED_FROM = 2.0  # a tone curve is tried if the angle of dots is at most this factor times the pen's
TILED = 0.7        # tiles must have an angle below this factor times the pen's: they show the picture itself

Tried = tuple[float, Camera]   # an angle of error, and the camera that has it


def estimated(image: Tensor, levels: Levels, code: IFS, seed: int) -> Camera | None:
    """The camera with which the rendering of a code comes closest to the image (R,R); None if the levels are exact or
    `CameraParams.estimate` is off.

    All values are tried, of the kinds that the picture may have (`Levels.kinds`). Tiles are chosen only if they explain
    the image much better than a pen that draws the attractor, dots only if they explain it much better than both, and a
    tone curve only if it explains it much better than pens, tiles and dots. If the search already measures the image
    through a tone curve, the camera that explains it best is chosen."""
    if levels.is_exact or not levels.params.estimate:
        return None

    def best(name: str) -> Tried:
        kind = kind_of(name)(levels.params, image, kinds=levels.kinds)
        return _likely(kind, nearest(image, kind, code, seed))

    if len(levels.kinds) == 1 or levels.kind == "tonemapped":
        return min(map(best, levels.kinds), key=angle_of)[1]
    dots = best("dots")
    pen = best("coverage") if "coverage" in levels.kinds else (float("inf"), Camera("coverage"))
    likely = dots if dots[0] < DOTTED * pen[0] else pen
    if dots[0] <= CURVED_FROM * pen[0]:
        curve = best("tonemapped")
        likely = curve if curve[0] < DOTTED * likely[0] else likely
    return likely[1]


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
    `Levels.drawn`, with its angle of error, the lowest first. Empty if such a camera cannot draw the code."""
    judge, found = Comparison(image, levels), {}
    for camera, rendering in levels.candidates(code, len(image), derive(seed, "camera")):
        tried = judge.angle(judge.error(rendering.to(image))), camera
        key = levels.drawn(camera)
        found[key] = min(found.get(key, tried), tried, key=angle_of)
    return sorted(found.values(), key=angle_of)


def _likely(levels: Levels, tried: list[Tried]) -> Tried:
    """The best camera that draws the attractor, unless tiles come much closer. Tiles show the picture itself, so they
    suit a wrong code too."""
    whole = [each for each in tried if with_camera(levels, each[1]).shows_attractor]
    return tried[0] if not whole or tried[0][0] < TILED * whole[0][0] else whole[0]


def angle_as_density(image: Tensor, levels: Levels, code: IFS, seed: int) -> float:
    """The least angle of error between the image (R,R) and the density of a code, with or without a tone curve."""
    return min(nearest(image, kind_of(name)(levels.params, image), code, seed)[0][0] for name in ("dots", "tonemapped"))
