"""From a picture to its code in one call."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from .errors import InputError, did_you_mean
from .methods import METHODS, WITHOUT_CODE, check_options, load
from .methods.base import Method, OnStep, Progress
from .runtime.bars import progress_bar
from .runtime.extras import need

if TYPE_CHECKING:
    import numpy as np
    from torch import Tensor

    from .images.checks import Frame
    from .images.levels import Levels
    from .images.reading import ReadImage
    from .inversion import Inversion
    from .runtime.checkpoint import Checkpoint

OWN = ("method", "resolution", "frame", "invert", "threshold", "clean", "crop", "levels", "seed", "seconds",
       "progress", "on_step", "keep_interrupted", "checkpoint", "colour")  # arguments of `invert`, whatever the method


def invert(image: str | Path | np.ndarray | Tensor | ReadImage, /, *, method: str = "collage", resolution: int = 256,
           frame: Frame = "fit", invert: bool | Literal["auto"] = "auto",
           threshold: float | None = None, clean: bool = True, crop: Sequence[int] | None = None,
           levels: Levels = "auto", colour: bool = False, seed: int = 0, seconds: float | None = None,
           progress: bool = False, on_step: OnStep | None = None, keep_interrupted: bool = False,
           checkpoint: Checkpoint | None = None, **options: Any) -> Inversion:
    """Recover the code of the self-similar shape in a picture.

    image: a path, or an array or tensor that `fractal_exp.images.read_target` accepts. The shape is found, turned white
    on black, centred, padded, and resized to (resolution, resolution). The code is in the frame of that image: the
    shape's longer side spans [-0.75, 0.75]. The result's `placement` maps it back to the picture's pixels. A
    `ReadImage` from `read_target` is used as it is. frame: "part" takes a shape that reaches a side of the picture to
    go on beyond it; "keep" keeps the frame of a square picture, such as one from `render`; fitting it again would
    resample its grey levels. A grey `suite.target` of this resolution stays as it is, unless it was rounded to 8 bits.
    For a binary one take "keep".
    invert, threshold, clean, crop: see `read_target`. levels: what the grey levels mean, see
    `images.levels.TargetImage`; with "linear", an array or tensor may hold counts or densities of any scale. colour:
    give each map of the code found a colour and a blend, so that the code is drawn in the picture's colours (see
    `ifs.Colours` and `colouring.fitted`). The search, and so the shape, is the same without. It needs scikit-image.
    seconds: a time limit, after which the best code so far is returned. Without one, collage search looks for the code
    of a picture from elsewhere for at most 60 seconds of a core, and for that of an image by `suite.target` as long as
    is worth while. progress: show a bar. on_step: called with a
    `Progress` after every step. keep_interrupted: an interruption (Ctrl-C) returns the best code so far, if there is
    one, instead of raising KeyboardInterrupt. checkpoint: where the work is saved, also at an interruption, and where
    it goes on from if that says so; `seconds` count from now.

    options go to the method. For "collage" they are the fields of `methods.collage.params.CollageParams`; a component
    takes a mapping: `invert("leaf.png", maps=4, rounds=1, moves={"root": 0})`. For "chaotic" they are the arguments of
    `methods.chaotic.method.laptop`, such as maps (10), starts (10) and iterations (800). "evolutionary", "cuckoo",
    "learning_fractals_32" and "learning_fractals_256", and the networks "neural_regression" and "amortized", which are
    trained beforehand, take the fields of their own parameters (docs/comparisons.md).

    Returns an `Inversion`: the code, its likeness to the picture, a verdict, how it was found and why the method
    stopped. Raises `InputError`, before any work, if the image is unusable, the method or an option is unknown, or a
    value is out of range.
    """
    from .images.painted import Painted
    from .inversion import coloured, run
    from .inversion.road import INTERRUPTED

    _check(progress, on_step, colour)
    _known(method, options | {"seconds": seconds, "seed": seed})
    target, reading = _read(image, resolution, levels, {"frame": frame, "invert": invert, "threshold": threshold,
                                                        "clean": clean, "crop": crop})
    works = built(target, method, seed=seed, seconds=seconds, **options)
    painted = Painted.of(target) if colour else None
    used = {"seed": seed, "seconds": seconds, **{key: value for key, value in reading.items() if value is not None},
            **({"levels": levels} if levels != "auto" else {}), **({"colour": True} if colour else {}), **options}
    with _Bar(progress) as bar:
        steps = [each for each in (on_step, bar) if each is not None]
        shape = run(target, works, name=method, options=used, seed=seed, checkpoint=checkpoint,
                    keep_interrupted=keep_interrupted, on_step=partial(_tell, steps))
    if painted is None:
        return shape
    with suppress(KeyboardInterrupt) if keep_interrupted else nullcontext():
        if shape.stopped != INTERRUPTED:
            return coloured(shape, painted, seed)
    return replace(shape, stopped=INTERRUPTED, notes=(*shape.notes, "no colours: the work was interrupted"))


def built(target: ReadImage, method: str = "collage", *, seed: int = 0, seconds: float | None = None, **options: Any
          ) -> Method:
    """The method that `invert` would use on a target, with the same arguments. Raises `InputError` as `invert` does,
    before any work."""
    build = _known(method, options | {"seconds": seconds, "seed": seed})
    return build(resolution=target.image.shape[-1], seed=seed, seconds=seconds, **options)


def _read(image: str | Path | np.ndarray | Tensor | ReadImage, resolution: int, levels: Levels,
          options: dict[str, Any]) -> tuple[ReadImage, dict[str, Any]]:
    """The target, and the options of `read_target` with which it was read; none if it was read before."""
    from .images.levels import decided
    from .images.reading import ReadImage, read_target

    if isinstance(image, ReadImage):
        return (image if levels == "auto" else replace(image, levels=decided(levels, image.image))), {}
    if levels == "linear" and not isinstance(image, str | Path):
        image, options = _scaled(image), {**options, "clean": False}  # its levels are numbers; there is no paper
    target = read_target(image, resolution, levels=levels, **options)
    return target, {**options, "crop": target.crop}  # plain numbers, whatever the sequence was


def _scaled(counts: np.ndarray | Tensor) -> np.ndarray:
    """Counts or densities of points, (R,R) of any type and scale, divided by their maximum."""
    import numpy as np

    grey = np.asarray(counts, np.float64)
    if not (np.isfinite(grey).all() and grey.size and 0 <= grey.min() < grey.max()):
        raise InputError("counts or densities must be finite, at least 0 and not all equal, got "
                         f"{f'[{grey.min():.4g}, {grey.max():.4g}]' if grey.size else 'none'}; take a histogram")
    return (grey / grey.max()).astype(np.float32)


def _known(method: str, options: dict[str, Any]) -> Callable[..., Method]:
    """The function that builds the method. Raises `InputError` if the method or an option is unknown."""
    if method in WITHOUT_CODE:
        raise InputError(f"the method {method!r} finds no code: it {WITHOUT_CODE[method]}; fractal-train "
                         f"method={method} does that, or choose one of {', '.join(METHODS)}")
    if method not in METHODS:
        raise InputError(f"there is no method {method!r}{did_you_mean(str(method), METHODS) or ';'} choose one of "
                         f"{', '.join(METHODS)}")
    build = load(method)
    check_options(build, method, options, OWN)
    return build


def _check(progress: bool, on_step: OnStep | None, colour: bool) -> None:
    """Raise `InputError` if an argument of `invert` has a wrong type, or a library for colours is missing."""
    if not (on_step is None or callable(on_step)):
        raise InputError(f"on_step must be a function that takes a Progress, got {on_step!r}")
    if not isinstance(progress, bool):
        raise InputError(f"progress must be True or False, got {progress!r}")
    if not isinstance(colour, bool):
        raise InputError(f"colour must be True or False, got {colour!r}")
    if colour:
        need("skimage")


def _tell(steps: Sequence[OnStep], progress: Progress) -> None:
    for on_step in steps:
        on_step(progress)


class _Bar:
    """An `on_step` that shows a bar with the stage and the error, if `wanted`."""

    def __init__(self, wanted: bool):
        self.bar = progress_bar(total=100, disable=not wanted,
                                bar_format="{percentage:3.0f}%|{bar:20}| {elapsed}{postfix}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.bar.close()

    def __call__(self, progress: Progress) -> None:
        self.bar.n = round(100 * progress.fraction, 1)
        self.bar.set_postfix_str(progress.describe())
