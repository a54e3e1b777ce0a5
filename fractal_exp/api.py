"""From a picture to its code in one call."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from .errors import InputError, did_you_mean
from .ifs.code import IFS
from .methods import METHODS, check_options, load
from .methods.base import OnStep

if TYPE_CHECKING:
    import numpy as np
    from torch import Tensor


def invert(image: str | Path | np.ndarray | Tensor, *, method: str = "collage", resolution: int = 256,
           frame: Literal["fit", "keep"] = "fit", seed: int = 0, seconds: float | None = None,
           on_step: OnStep | None = None, **options: Any) -> IFS:
    """Recover the code of the self-similar shape on a picture.

    image: a path, or an array or tensor as `fractal_exp.images.read_target` takes them; the shape is found, turned
    white on black, centred and padded, and brought to (resolution, resolution). The code is in the frame of that
    image: the shape's longer side spans [-0.75, 0.75]. frame: "keep" takes a square picture as it is framed, as one
    that `render` or `suite.target` drew; fitting it again would resample its grey levels. seconds: a limit after which
    the best code so far is returned. on_step is told a `Progress` after every step. options go to the method: for
    "collage" maps (None: found), at_most (None), islands (5), moves (50), rounds (None: up to 4 or 2, by the picture),
    detail_moves (25), picture_moves (60), levels ("auto") and memory_gib (None: no limit), see
    `methods.collage.method.Collage`; for "chaotic" maps (10), starts (10), scouting (120), iterations (800),
    trajectories (1000), length (110), match_target (True), radii ((1,)), perceptual (None, or fractal, lpips_alex,
    lpips_squeeze, lpips_vgg) and perceptual_weights (None), see `methods.chaotic.method.laptop`.

    Raises `InputError` on an unusable image, an unknown method or option, or values out of range, all before any work.
    """
    from .images.reading import read_target

    if method not in METHODS:
        raise InputError(f"there is no method {method!r}{did_you_mean(str(method), METHODS) or ';'} choose one of "
                         f"{', '.join(METHODS)}")
    if not (on_step is None or callable(on_step)):
        raise InputError(f"on_step must be a function that takes a Progress, got {on_step!r}")
    build = load(method)
    check_options(build, method, options | {"seconds": seconds, "seed": seed})
    target = read_target(image, resolution, frame=frame).image
    built = build(resolution=resolution, seed=seed, seconds=seconds, **options)
    return built.reconstruct(target, on_step=on_step).code
