"""The camera of a picture that others drew, estimated from a code that is nearly right."""

from __future__ import annotations

from torch import Tensor

from ....ifs.code import IFS
from ....runtime.seeds import derive
from ..measure.levels import Levels
from ..measure.tones import LEVELS, Camera
from ..params import CollageParams
from .objective import ImageObjective

DRAWN = "coverage", "dots"   # what a picture that others drew may be, the likelier first


def estimated(image: Tensor, levels: Levels, code: IFS, params: CollageParams, seed: int) -> Camera:
    """The camera with which the rendering of a code comes nearest to the image (R,R); none where the levels are exact.

    All values that the parameters list are tried. Dots are taken only if they explain the image much better than a pen.
    """
    if levels.is_exact:
        return ()
    found = []
    for name in DRAWN if params.levels == "auto" else (params.levels,):
        kind = LEVELS[name].of(image, levels.camera)
        judge = ImageObjective(image, kind, params)
        tried = kind.candidates(code, len(image), derive(seed, "camera"))
        error, values = min((judge.error(rendering), values) for values, rendering in tried)
        found.append((judge.angle(error), (name, *values)))
    (likely, camera), *others = found
    return next((other for angle, other in others if angle < levels.camera.dotted * likely), camera)
