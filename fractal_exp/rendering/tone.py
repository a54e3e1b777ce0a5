"""Grey levels of a density: with the tone of the picture that a code was found on, or with a logarithm."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from ..errors import InputError
from ..ifs.code import IFS
from ..ops.filters import filtered
from ..runtime.checks import check_number, shown
from .curve import Curve

log = logging.getLogger(__name__)

NOTE = "tone"        # in the `meta` of a code
LEAST_LIGHT, MOST_GAMMA = 1e-3, 20.0
FAINT = 0.05         # grey level that counts half as light
BESIDE = 1 / 8       # share of a pixel's points that goes to each neighbour of its row, then of its column: σ is 0.5 px
SAMPLE = 65_536      # pixels by which a view is exposed
OVER = 40.0          # exposure times density from which a pixel is white under every curve
HALVINGS = 100, 12   # of an exposure: at most, until the light is too little; and between the last two


@dataclass(frozen=True)
class Tone:
    """How grey levels follow the density of points: I = (1 - exp(-e d))^(1 / gamma), or min(1, e d)^(1 / gamma) if it
    is `linear`.

    d is the density of a view, of any scale, and e the view's exposure: with it the view has as much `light` as the
    picture that the code was found on. So a copy has the tone of the whole at every zoom, although its density may be
    any, and nothing here depends on pixels or points. light: the mean grey level of a picture where it is lit, from
    0.001 to 1; gamma: from 0.05 to 20; cover: the mean share of a lit pixel that the shape covers, from 0.001 to 1,
    with which a code in colours is drawn, or None. Raises `InputError` on others.
    """

    light: float
    gamma: float = 1.0
    linear: bool = False
    cover: float | None = None

    def __post_init__(self) -> None:
        check_number("light", self.light, "a mean grey level from 0.001 to 1", LEAST_LIGHT, 1)
        check_number("gamma", self.gamma, "a number from 0.05 to 20", 1 / MOST_GAMMA, MOST_GAMMA)
        if not isinstance(self.linear, bool):
            raise InputError(f"linear must be true or false, got {shown(self.linear)}")
        if self.cover is not None:
            check_number("cover", self.cover, "a mean share from 0.001 to 1", LEAST_LIGHT, 1)

    @classmethod
    def of_picture(cls, picture: Tensor, gamma: float = 1.0, *, linear: bool = False) -> Self | None:
        """The tone of a picture (R,R) with this curve; None if it is black. A gamma out of range is brought into it."""
        light = _light(picture.clamp(0, 1))
        if light < LEAST_LIGHT:
            return None
        return cls(min(round(light, 4), 1.0), min(max(gamma, 1 / MOST_GAMMA), MOST_GAMMA), linear)

    def covering(self, cover: Tensor) -> Tone:
        """The same tone for a code in colours, found where a shape covers the shares `cover` (R,R) of pixels."""
        return replace(self, cover=min(max(round(_light(cover.clamp(0, 1)), 4), LEAST_LIGHT), 1.0))

    @property
    def of_cover(self) -> Tone | None:
        """The tone of the cover, with which a code in colours is drawn; None if it is not known."""
        return None if self.cover is None else replace(self, light=self.cover, cover=None)

    def facts(self) -> dict[str, Any]:
        """The note that a code keeps of it, as JSON data."""
        return {name: value for name, value in asdict(self).items() if value is not None}

    def exposure(self, density: Tensor) -> float:
        """The exposure of a softened density (R,R): the largest with which it has this tone's light."""
        lit = density[density > 0]
        if not len(lit):
            return 1.0
        lit = lit[::math.ceil(len(lit) / SAMPLE)]
        high = OVER / float(lit.min())
        for _ in range(HALVINGS[0]):
            if _light(self.grey(lit, high / 2)) < self.light:
                break
            high /= 2
        low = high / 2
        for _ in range(HALVINGS[1]):
            middle = math.sqrt(low * high)
            low, high = (middle, high) if _light(self.grey(lit, middle)) < self.light else (low, middle)
        return high

    def grey(self, density: Tensor, exposure: float) -> Tensor:
        """Grey levels (…) in [0,1] of a density (…)."""
        return Curve(self.gamma, self.linear).grey(exposure * density).clamp(max=1)

    def towards(self, other: Tone, t: float) -> Tone:
        """The tone at time t in [0,1] on the way to another: light and gamma move along straight lines."""
        cover = None if self.cover is None or other.cover is None else (1 - t) * self.cover + t * other.cover
        return Tone((1 - t) * self.light + t * other.light, (1 - t) * self.gamma + t * other.gamma,
                    (other if t > 0.5 else self).linear, cover)


def tone_of(code: IFS) -> Tone:
    """The tone that a code keeps as "tone" in its `meta`, {light, gamma, linear, cover}.

    Raises `InputError` if there is none, or none that can be drawn.
    """
    given = code.meta.get(NOTE)
    if given is None:
        raise InputError('the code has no tone to draw with; invert finds it in a picture whose grey levels are a '
                         'density, and mode="density" draws without')
    if not isinstance(given, Mapping) or not {"light"} <= given.keys() <= {"light", "gamma", "linear", "cover"}:
        raise InputError(f"a tone holds light, gamma, linear and cover by name, got {shown(given)}")
    try:
        return Tone(**given)
    except InputError as error:
        raise InputError(f"the code's tone: {error}") from None


def own_tone(code: IFS) -> Tone | None:
    """`tone_of` a code, or None without one that can be drawn; notes are anybody's, so a wrong one only warns."""
    if NOTE not in code.meta:
        return None
    try:
        return tone_of(code)
    except InputError as error:
        log.warning("%s; it is left out", error)
        return None


def with_tone(code: IFS, tone: Tone | None) -> IFS:
    """The code with this tone in its notes, or with none."""
    others = {key: value for key, value in code.meta.items() if key != NOTE}
    meta = others if tone is None else {**others, NOTE: tone.facts()}
    return code if meta == code.meta else replace(code, meta=meta)


def usual_mode(code: IFS) -> str:
    """How a code is drawn unless somebody chooses: in its colours, else with its tone, else as occupancy."""
    return "colour" if code.colours is not None else "tone" if own_tone(code) else "occupancy"


def softened(density: Tensor) -> Tensor:
    """A density (H,W) blurred by half a pixel, so that thin lines have no steps; nothing lies beyond its edges."""
    return filtered(density, (BESIDE, 1 - 2 * BESIDE, BESIDE))


def white_level(density: Tensor) -> float:
    """The density that becomes white in a picture: the 99.9th percentile of the pixels with points."""
    lit = density[density > 0]
    return float(np.quantile(lit.numpy(), 0.999)) if len(lit) else 1.0


def tone_map(density: Tensor, white: float | None = None) -> Tensor:
    """A picture in [0,1] of a density image: log(1 + density) over log(1 + white), cut at 1.

    `white` is the density that becomes white (default: `white_level`); give it to keep the frames of a film alike.
    """
    white = white_level(density) if white is None else white
    return (torch.log1p(density) / math.log1p(white)).clamp(max=1.0)


def _light(grey: Tensor) -> float:
    """The mean of grey levels (…) where there is light: a level well above `FAINT` counts fully, and black not at all.
    Thin lines that are far denser than all else count by their area. 0 if all are black."""
    weight = grey / (grey + FAINT)
    total = float(weight.sum())
    return float((weight * grey).sum()) / total if total > 0 else 0.0
