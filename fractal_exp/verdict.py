"""What a recovered code is worth, in words, and what is most likely to make it better."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, Protocol, Self

import torch
from pydantic import model_validator
from torch import Tensor

from .evaluation import metrics
from .images.reading import ReadImage
from .methods.collage.camera.tones import guess_levels
from .methods.collage.params import CameraParams, CollageParams
from .runtime.params import Amount, Params, Positive, Share, check_order

Kind = Literal["recovered", "approximation", "not self-similar"]

TIME_LIMIT = "time limit"     # in `stopped` if a search ran out of time
OTHER_LEVELS = {"density": "coverage", "binary": "coverage", "coverage": "auto"}
SEARCH = CollageParams()      # its defaults decide in the same way whether a code is good enough


class VerdictParams(Params):
    """The thresholds of a verdict. They were found by trial."""

    within_noise: Amount = SEARCH.stages.second_round
    """Noise ratio below which a code cannot be told from the true one."""
    recovered: Share = 0.985
    """F1 within a pixel at which a code of few maps is no accident, as in collage search."""
    few_maps: Positive = 12
    """Maximum number of maps of such a code."""
    not_alike: Share = 0.5
    """F1 within a pixel below which a code is not like the picture at all."""
    not_alike_unclear: Share = 0.9
    """The same limit for a picture without a clear shape."""
    over_a_box: Share = 0.02
    """Share of the gap to 1 by which a code's F1 must exceed that of a filled box."""
    warned: Share = 0.8
    """F1 within a pixel below which an approximation comes with a warning."""
    shape_right: Share = SEARCH.stages.unlike
    """F1 within a pixel at which the shape is right, though grey levels may be wrong."""
    small: Amount = 2.0
    """Factor of enlargement above which a picture is small."""
    shrunk: Amount = 0.75
    """Factor of enlargement below which a picture was shrunk so much that a finer image may show more."""
    more_time: Amount = 4.0
    """Factor on the time that is suggested."""
    more_maps: Positive = 2
    """Factor on the number of maps that is suggested."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        check_order(self, ("not_alike", "not_alike_unclear"), ("not_alike", "recovered"))
        return self


THRESHOLDS = VerdictParams()


class Alike(Protocol):
    """The figures of a likeness: see `fractal_exp.inversion.Likeness`."""

    @property
    def f1(self) -> float: ...
    @property
    def f1_1px(self) -> float: ...
    @property
    def noise_ratio(self) -> float: ...


@dataclass(frozen=True)
class Verdict:
    """What a code is worth.

    kind: "recovered" if the picture is explained to its noise, or its shape to within a pixel by few maps;
    "approximation" if the code draws something like it; "not self-similar", as far as we can see, if the code is hardly
    like it, or no more than a filled box. words: the same in one line, with figures. remedy: what is most likely to
    help; empty if nothing is needed.
    """

    kind: Kind
    words: str
    remedy: str = ""

    @classmethod
    def of(cls, likeness: Alike, maps: int, image: Tensor, *, picture: ReadImage | None = None, stopped: str = "",
           options: Mapping[str, Any] | None = None, params: VerdictParams = THRESHOLDS) -> Verdict:
        """The verdict on a code with this number of maps.

        likeness: to the image (R,R); picture: how the image was read, or None; stopped: why the method ended; options:
        of the method, among them maps, at_most, seconds and levels; params: the thresholds.
        """
        if likeness.noise_ratio < params.within_noise:
            return cls("recovered", "recovered: the picture is explained to its noise")
        unclear = picture.unclear if picture is not None else ""
        if likeness.f1_1px >= params.recovered and maps <= params.few_maps and not unclear:
            return cls("recovered", f"recovered: the shape is explained to within a pixel by {maps} maps")
        figures = f"F1 {_short(likeness.f1_1px)} within a pixel"
        short, remedy = next(_remedies(likeness, maps, image, picture, stopped, options or {}, params))
        least = params.not_alike_unclear if unclear else params.not_alike
        if _is_alike(likeness, image, least, params.over_a_box):
            number = f"{maps} map{'s' * (maps > 1)}"
            return cls("approximation", f"approximation with {number}; {figures}; {short} would help", remedy)
        why = f" ({unclear})" if unclear else ""
        return cls("not self-similar", f"not self-similar as far as we can see{why}; {figures}", remedy)

    def __str__(self) -> str:
        return f"{self.words} ({self.remedy})" if self.remedy else self.words


def _is_alike(likeness: Alike, image: Tensor, least: float, gain: float) -> bool:
    """Whether a code is like the image, with an F1 within a pixel of at least `least`, and exceeds a filled box by a
    share `gain` of the gap to 1."""
    box = _box(image)
    box_f1, box_1px = (float(metric(box[None], image[None])) for metric in (metrics.f1, metrics.f1_1px))
    better = likeness.f1 > box_f1 + gain * (1 - box_f1) or likeness.f1_1px > box_1px + gain * (1 - box_1px)
    return better and likeness.f1_1px >= least


def _box(image: Tensor) -> Tensor:
    """The filled bounding box of the lit pixels."""
    lit, box = image > 0, torch.zeros_like(image)
    rows, columns = (torch.nonzero(lit.any(axis)).flatten() for axis in (1, 0))
    if len(rows):
        box[int(rows[0]):int(rows[-1]) + 1, int(columns[0]):int(columns[-1]) + 1] = 1
    return box


def _remedies(likeness: Alike, maps: int, image: Tensor, picture: ReadImage | None, stopped: str,
              options: Mapping[str, Any], params: VerdictParams) -> Iterator[tuple[str, str]]:
    """What may help, the likeliest first: each in a few words, and what to do."""
    if picture is not None and picture.unclear:
        yield "a clear shape", "cut one shape out of the picture, on a background of one colour"
    if picture is not None and picture.doubtful:
        other = str(not picture.inverted).lower()
        yield "the other polarity", f"invert={other}, if the shape is what was taken for the background"
    if TIME_LIMIT in stopped and options.get("seconds"):
        yield "more time", f"more time: seconds={params.more_time * float(options['seconds']):g}"
    if picture is not None and picture.scale > params.small:
        yield "a larger picture", f"a larger picture: the shape was enlarged {picture.scale:.2g} times"
    if likeness.f1_1px >= params.shape_right:
        yield from _other_levels(image, str(options.get("levels") or "auto"))
        if picture is not None and picture.scale < params.shrunk and len(image) < SEARCH.stages.largest_side:
            finer = min(round(len(image) / picture.scale), SEARCH.stages.largest_side)
            yield "a finer image", f"resolution={finer}: the picture was shrunk {1 / picture.scale:.2g} times"
    name = "at_most" if options.get("at_most") else "maps"
    more = f"{name}={params.more_maps * int(options.get(name) or maps)}"
    yield "more maps", f"more maps: {more}, with more time for each"


def _short(share: float) -> str:
    """A share as .55."""
    return f"{share:.2f}".removeprefix("0")


def _other_levels(image: Tensor, asked: str) -> Iterator[tuple[str, str]]:
    """Another meaning of grey levels. None if `auto` took the picture for a drawing: it then tries several itself."""
    taken = guess_levels(image, CameraParams()) if asked == "auto" else asked
    if taken != "coverage" or asked != "auto":
        yield "another meaning of grey levels", f"levels={OTHER_LEVELS.get(taken, 'coverage')} instead of {taken}"
