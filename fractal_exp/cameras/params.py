"""The parameters of the camera, which says how an image was rendered from a code."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from ..images.levels import TARGET_SUPERSAMPLE
from ..runtime.params import NAME, Amount, ParamError, Params, Positive
from .camera import KNOWN

Factor = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class CameraParams(Params):
    """How the image is assumed to have been rendered from a code. The defaults describe the suite's targets."""

    supersample: Positive = TARGET_SUPERSAMPLE
    """Subpixels per side of a pixel of a density or a binary image (16 in the paper's program)."""
    points_per_pixel: Annotated[float, Field(ge=0.1, allow_inf_nan=False)] = 50_000_000 / 1024**2
    """Points of the chaos game per pixel of the canvas (Section 5 of the paper)."""
    estimate: bool = True
    """Whether the camera of a picture that others drew is estimated; false: such a picture counts as a plain rendering,
    without a pen, tiles, dots, strokes or a blur."""
    pen_px: Amount | None = None
    """Radius of the pen that drew lines and areas, pixels of the image; null: estimated."""
    blur_px: Amount | None = None
    """Standard deviation of the blur, pixels of the image; null: estimated, or no blur for a linear image."""
    gain: Factor | None = None
    """How fast ink covers the paper, per dot density relative to a uniform one on the canvas; null: estimated."""
    gamma: Factor | None = None
    """Gamma of the tone curve of a density; null: estimated."""
    tiles: bool = True
    """Whether tiles are tried: the smallest parts of a construction that ended early."""
    strokes: bool = True
    """Whether strokes are tried: the drawing of a recursion that ended, as of a tree."""
    constructions: bool = True
    """Whether the few maps of a construction are sought where many maps, or none, explain a drawing."""
    curves: bool = True
    """Whether an image that is grey inside is also searched as a density behind a tone curve."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        for name, value in self.all_known.items():
            if not self.estimate and name != "blur":  # which a linear image has
                raise ParamError(KNOWN[name], f"{NAME} must be null if estimate is false, got {value}")
        return self

    @property
    def all_known(self) -> dict[str, float]:
        """All that the user knows of a camera, by the names of `Camera`; lengths are in pixels."""
        return {name: value for name in KNOWN if (value := self.known(name)) is not None}

    def known(self, value: str) -> float | None:
        """What the user knows of a value of `Camera`, in pixels if it is a length; None: nothing."""
        return getattr(self, KNOWN[value]) if value in KNOWN else None
