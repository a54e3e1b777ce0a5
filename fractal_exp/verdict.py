"""What a recovered code is worth, in words, and what is most likely to make it better."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import torch
from torch import Tensor

from .cameras.comparison import WITHIN_NOISE
from .evaluation import metrics
from .images.levels import DRAWN
from .images.reading import ReadImage
from .likeness import ALIKE, ALIKE_DARK, FEW_MAPS, UNLIKE, Likeness
from .runtime.deadline import USUAL

Kind = Literal["recovered", "approximation", "not recovered"]

TIME_LIMIT = "time limit"     # in `stopped` if a search ran out of time
OTHER_LEVELS = {"density": "coverage", "binary": "coverage", "coverage": "auto"}
DENSITIES = "density", "linear"   # levels by which each grey counts
OWN = *DENSITIES, "binary"    # levels of drawings of codes, in which nothing but noise is left by chance
ALIKE_INSIDE = 0.88           # likeness inside from which gaps and tone are right, too
ALIKE_DENSITY = 0.98          # the same in a density, which differs from the true code's only by chance
NOT_ALIKE = 0.5               # F1 within a pixel below which a code is not like the picture at all
NOT_ALIKE_UNCLEAR = 0.9       # the same for a picture without a clear shape
OVER_A_BOX = 0.02             # share of the gap to 1 by which a code's F1 must exceed that of a filled box
SMALL, SHRUNK = 2.0, 0.75     # factors of enlargement above and below which another size of the picture may help
LARGEST_SIDE = 512            # pixels, beyond which a finer image is shrunk for the search
MORE_TIME, MORE_MAPS = 4, 2   # factors on what was given, in suggestions
OTHER_COLOURS = 10.0          # mean CIEDE2000 difference from which anybody calls two colours different


@dataclass(frozen=True)
class Verdict:
    """What a code is worth.

    kind: "recovered" if few maps explain the picture to its noise, or its shape to within a pixel with its gaps and its
    tone; our own drawings of codes may also be explained to their noise by many. "approximation" if the code draws
    something like it; "not recovered" if the code is hardly like it, or no more than a filled box. Whether the picture
    is self-similar, no search can say. words: the same in one line, with figures; of colours too, where they are
    clearly off. remedy: what is most likely to help; empty if nothing is needed. change: the same as an argument of
    `invert` and its value, where it is one.
    """

    kind: Kind
    words: str
    remedy: str = ""
    change: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, likeness: Likeness, maps: int, target: ReadImage, *, stopped: str = "",
           options: Mapping[str, Any] | None = None) -> Verdict:
        """The verdict on a code with this number of maps.

        likeness: to the target; stopped: why the method ended; options: of the method, among them maps, at_most and
        seconds.
        """
        part = "" if target.known is None else ", as far as the picture shows it"
        if likeness.noise_ratio < WITHIN_NOISE and (maps <= FEW_MAPS or target.levels in OWN):
            return cls("recovered", f"recovered: the picture is explained to its noise{part}")
        unclear = target.unclear
        inside = _is_alike_inside(likeness, target)
        if likeness.f1_1px >= ALIKE and maps <= FEW_MAPS and inside and not unclear:
            return cls("recovered", f"recovered: the shape is explained to within a pixel by {maps} maps{part}")
        figures = f"F1 {_short(likeness.f1_1px)} within a pixel"
        if likeness.ssim is not None:
            figures += f", SSIM {_short(likeness.ssim)} inside"
        short, remedy, change = next(_remedies(likeness, maps, target, stopped, options or {}))
        if _is_alike(likeness, target.image, NOT_ALIKE_UNCLEAR if unclear else NOT_ALIKE):
            number, what = f"{maps} map{'s' * (maps > 1)}", " of the outline" * likeness.is_outline
            return cls("approximation", f"approximation{what} with {number}; {figures}; {short} would help", remedy,
                       change)
        why = f" ({unclear})" if unclear else ""
        return cls("not recovered", f"not recovered{why}; {figures}", remedy, change)

    def with_colours(self, apart: float | None) -> Verdict:
        """The verdict on a code that has colours too, whose mean CIEDE2000 difference from the picture's is `apart`."""
        if apart is None or apart < OTHER_COLOURS:
            return self
        return replace(self, words=f"{self.words}; its colours are not the picture's, {apart:.2g} apart (CIEDE2000)")

    def against_truth(self, exact: bool, equivalent: bool) -> Verdict:
        """The verdict on a code whose truth is known: recovered if it is the true code, or another one of the same
        attractor, whatever the picture says; else at best an approximation."""
        if exact or equivalent:
            found = "the true code" if exact else "another code of the true attractor"
            return Verdict("recovered", f"recovered: {found}")
        if self.kind != "recovered":
            return self
        likeness = self.words.partition(": ")[2]
        return replace(self, kind="approximation", words=f"approximation: {likeness}, but the code is not the true one")

    def __str__(self) -> str:
        return f"{self.words} ({self.remedy})" if self.remedy else self.words


def _is_alike(likeness: Likeness, image: Tensor, least: float) -> bool:
    """Whether a code is like the image, with an F1 within a pixel of at least `least`. It must beat the filled bounding
    box's score b by 0.02 (1 - b)."""
    box = _box(image)
    box_f1, box_1px = (float(metric(box[None], image[None])) for metric in (metrics.f1, metrics.f1_1px))
    better = likeness.f1 > box_f1 + OVER_A_BOX * (1 - box_f1) or likeness.f1_1px > box_1px + OVER_A_BOX * (1 - box_1px)
    return better and likeness.f1_1px >= least


def _is_alike_inside(likeness: Likeness, target: ReadImage) -> bool:
    """Whether a code has the gaps and the tone of the picture: neither a slab has, nor a square around the shape."""
    least = ALIKE_DENSITY if target.levels in DENSITIES else ALIKE_INSIDE
    return ((likeness.f1_dark is None or likeness.f1_dark >= ALIKE_DARK)
            and (likeness.ssim_share is None or likeness.ssim_share >= least))


def _box(image: Tensor) -> Tensor:
    """The filled bounding box of the lit pixels."""
    lit, box = image > 0, torch.zeros_like(image)
    rows, columns = (torch.nonzero(lit.any(axis)).flatten() for axis in (1, 0))
    if len(rows):
        box[int(rows[0]):int(rows[-1]) + 1, int(columns[0]):int(columns[-1]) + 1] = 1
    return box


def _remedies(likeness: Likeness, maps: int, target: ReadImage, stopped: str, options: Mapping[str, Any]
              ) -> Iterator[tuple[str, str, dict[str, Any]]]:
    """What may help, the likeliest first: each in a few words, what to do, and the argument that does it."""
    if target.unclear:
        yield "a clear shape", "cut one shape out of the picture, on a background of one colour", {}
    if target.doubtful:
        other = not target.inverted
        yield ("the other polarity", f"invert={str(other).lower()}, if the shape is what was taken for the background",
               {"invert": other})
    if TIME_LIMIT in stopped:
        seconds = MORE_TIME * float(options.get("seconds") or USUAL)
        yield "more time", f"more time: seconds={seconds:g}", {"seconds": seconds}
    if likeness.noise_ratio < WITHIN_NOISE:
        yield ("fewer maps", f"fewer maps: at_most={FEW_MAPS}, since nothing but noise is left and more maps fit any",
               {"at_most": FEW_MAPS})
    if target.scale > SMALL:
        yield "a larger picture", f"a larger picture: the shape was enlarged {target.scale:.2g} times", {}
    if likeness.f1_1px >= UNLIKE:
        if target.levels != DRAWN:  # else all that a drawing may mean was tried
            other = OTHER_LEVELS.get(target.levels, "coverage")
            yield "another meaning of grey levels", f"levels={other} instead of {target.levels}", {"levels": other}
        side = target.image.shape[-1]
        if target.scale < SHRUNK and side < LARGEST_SIDE and _is_alike_inside(likeness, target):
            finer = min(round(side / target.scale), LARGEST_SIDE)
            yield ("a finer image", f"resolution={finer}: the picture was shrunk {1 / target.scale:.2g} times",
                   {"resolution": finer})
    name = "at_most" if options.get("at_most") else "maps"
    more = MORE_MAPS * int(options.get(name) or maps)
    yield "more maps", f"more maps: {name}={more}, with more time for each", {name: more}


def _short(share: float) -> str:
    """A share as .55."""
    return f"{share:.2f}".replace("0.", ".", 1)
