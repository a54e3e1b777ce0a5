"""From a picture to its code in one call."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from .errors import InputError, did_you_mean
from .methods import METHODS, check_options, load
from .methods.base import CodeReconstruction, Method, OnStep, Progress, stop_reason

if TYPE_CHECKING:
    import numpy as np
    from torch import Tensor

    from .inversion import Inversion

OWN = ("method", "resolution", "frame", "seed", "seconds", "progress", "on_step")  # of `invert`, whatever the method


def invert(image: str | Path | np.ndarray | Tensor, *, method: str = "collage", resolution: int = 256,
           frame: Literal["fit", "keep"] = "fit", seed: int = 0, seconds: float | None = None, progress: bool = False,
           on_step: OnStep | None = None, **options: Any) -> Inversion:
    """Recover the code of the self-similar shape on a picture.

    image: a path, or an array or tensor as `fractal_exp.images.read_target` takes them; the shape is found, turned
    white on black, centred and padded, and brought to (resolution, resolution). The code is in the frame of that
    image: the shape's longer side spans [-0.75, 0.75]; the result's `placement` takes it back to the picture's pixels.
    frame: "keep" takes a square picture as it is framed, as one that `render` or `suite.target` drew; fitting it again
    would resample its grey levels. seconds: a limit after which the best code so far is returned. progress: show a
    bar. on_step is told a `Progress` after every step.

    options go to the method. For "collage" they are the fields of `methods.collage.params.CollageParams`, those of a
    component as a mapping: `invert("leaf.png", maps=4, rounds=1, moves={"root": 0})`. With levels="linear" an array or
    tensor may hold counts or densities of any scale. For "chaotic" they are the
    arguments of `methods.chaotic.method.laptop`, such as maps (10), starts (10) and iterations (800).

    Returns an `Inversion`: the code, its likeness to the picture, how it was found and why the method stopped.
    Raises `InputError` on an unusable image, an unknown method or option, or values out of range, all before any work.
    """
    from .images.reading import read_target
    from .inversion import Inversion, Likeness, warnings_of
    from .methods.history import History

    build = _checked(method, options | {"seconds": seconds, "seed": seed}, progress, on_step)
    if options.get("levels") == "linear" and not isinstance(image, str | Path):
        image = _scaled(image)
    target = read_target(image, resolution, frame=frame)
    built = build(resolution=resolution, seed=seed, seconds=seconds, **options)
    with _Bar(progress) as bar:
        history = History([each for each in (on_step, bar) if each is not None])
        found = built.reconstruct(target.image, on_step=history)
        took = history.seconds()
    if not isinstance(found, CodeReconstruction):
        raise TypeError(f"the method {method!r} reconstructs a {type(found).__name__}, which is no code")
    stopped = stop_reason(found, seconds, took)
    likeness = Likeness.of(found.code, target.image, levels=options.get("levels", "auto"),
                           camera=options.get("camera"), seed=seed)
    return Inversion(
        code=found.code, target=target, source=Path(image).absolute() if isinstance(image, str | Path) else image,
        likeness=likeness, history=history.stages(), stopped=stopped, seconds=took, method=method,
        options={"seed": seed, "seconds": seconds, "frame": frame, **options}, notes=(*target.notes, *found.notes),
        warnings=warnings_of(target, likeness, stopped))


def _scaled(counts: np.ndarray | Tensor) -> np.ndarray:
    """Counts or densities of points, (R,R) of any type and scale, as grey levels up to 1."""
    import numpy as np

    grey = np.asarray(counts, np.float64)
    if not (np.isfinite(grey).all() and grey.size and 0 <= grey.min() < grey.max()):
        raise InputError("counts or densities must be finite, at least 0 and not all alike, got "
                         f"{f'[{grey.min():.4g}, {grey.max():.4g}]' if grey.size else 'none'}; take a histogram")
    return (grey / grey.max()).astype(np.float32)


def _checked(method: str, options: dict[str, Any], progress: bool, on_step: OnStep | None) -> Callable[..., Method]:
    """What builds the method, or `InputError` if it is unknown or an argument is not of its type."""
    if method not in METHODS:
        raise InputError(f"there is no method {method!r}{did_you_mean(str(method), METHODS) or ';'} choose one of "
                         f"{', '.join(METHODS)}")
    if not (on_step is None or callable(on_step)):
        raise InputError(f"on_step must be a function that takes a Progress, got {on_step!r}")
    if not isinstance(progress, bool):
        raise InputError(f"progress must be True or False, got {progress!r}")
    build = load(method)
    check_options(build, method, options, OWN)
    return build


class _Bar:
    """An `on_step` that draws a bar with the stage and the error; nothing unless it is `wanted`."""

    def __init__(self, wanted: bool):
        from tqdm import tqdm

        self.bar = tqdm(total=100, disable=not wanted, bar_format="{percentage:3.0f}%|{bar:20}| {elapsed}{postfix}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.bar.close()

    def __call__(self, progress: Progress) -> None:
        self.bar.n = round(100 * progress.fraction, 1)
        self.bar.set_postfix_str(progress.describe())
