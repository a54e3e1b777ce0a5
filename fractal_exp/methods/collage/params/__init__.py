"""The parameters of collage search, one class per component. docs/collage.md explains where the method uses each.

Where a docstring names no source, the value was found by trial on tuning suites (docs/lab_notes.md). Each part has a
setting that switches it off: `enabled=false` or another switch, a count of 0, odds of 0.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ....runtime.params import NAME, ParamError, Params, Positive
from .camera import CameraParams
from .growth import GrowthParams
from .image import FrameParams, GaussNewtonParams, ImageParams, LineParams, MoveParams, RefineParams
from .measure import BirthParams, DescentParams, PopulationParams, SaturationParams, SearchParams
from .rounding import RoundingParams
from .stages import StageParams

BYTES_OF_A_MAP = 12   # six numbers of 16 bits
CAMERAS = {   # values of the camera, with the levels that they are of
    "pen_px": ("coverage",), "gain": ("dots", "tonemapped"), "gamma": ("tonemapped",),
    "blur_px": ("coverage", "dots", "tonemapped", "linear"),
}


class CollageParams(Params):
    """All parameters of collage search."""

    maps: Annotated[int, Field(ge=2)] | None = None
    """Number of maps; null: the search finds it."""
    at_most: Annotated[int, Field(ge=2)] | None = None
    """Maximum number of maps; null: no limit."""
    likeness: Annotated[float, Field(gt=0, le=1)] | None = None
    """F1 within a pixel that growth must reach, with as few maps of the curve as possible; null: see `growth`."""
    bytes: Annotated[int, Field(ge=24)] | None = None
    """Maximum size of the code, bytes: 12 for each map (six numbers of 16 bits); null: no limit."""
    rounds: Positive | None = None
    """Maximum number of rounds; null: `stages` says, depending on what grey levels mean."""
    levels: Literal["auto", "density", "linear", "dots", "tonemapped", "coverage", "binary"] = "auto"
    """What grey levels mean: the share of subpixels that the chaos game hits, the number of its points in a pixel
    up to a factor, the ink of as many dots, such a number through a tone curve (gamma or logarithm), the covered share
    of a pixel, or nothing (black and white). `auto` takes images that our renderer did not draw as coverage, or as
    dots or a tone-mapped density if those explain them better."""
    search: SearchParams = SearchParams()
    population: PopulationParams = PopulationParams()
    births: BirthParams = BirthParams()
    descent: DescentParams = DescentParams()
    saturation: SaturationParams = SaturationParams()
    refine: RefineParams = RefineParams()
    camera: CameraParams = CameraParams()
    image: ImageParams = ImageParams()
    moves: MoveParams = MoveParams()
    lines: LineParams = LineParams()
    gauss_newton: GaussNewtonParams = GaussNewtonParams()
    frame: FrameParams = FrameParams()
    rounding: RoundingParams = RoundingParams()
    growth: GrowthParams = GrowthParams()
    stages: StageParams = StageParams()

    @model_validator(mode="after")
    def _one_number_of_maps(self) -> Self:
        given = [f"{name}={value}" for name in ("maps", "at_most", "likeness", "bytes")
                 if (value := getattr(self, name)) is not None]
        if len(given) > 1:
            raise ValueError("give one of the number of maps (maps), its upper bound (at_most or bytes) and the "
                             f"likeness to be reached, not two; got {' and '.join(given)}")
        return self

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        camera = self.camera
        if self.likeness is not None and not self.growth.enabled:
            raise ParamError("likeness", f"{NAME} is reached by growth, but growth.enabled is false; "
                                         f"got {self.likeness}")
        for name, levels in CAMERAS.items():
            value = getattr(camera, name)
            if value is not None and self.levels not in ("auto", *levels):
                raise ParamError(f"camera.{name}", f"{NAME} must be null if levels is {self.levels}, got {value}")
        if not self.camera_kinds:
            raise ParamError("camera.pen_px", f"{NAME} must be null if camera.gain or camera.gamma is given, which "
                                              f"are of dots, not of lines and areas; got {camera.pen_px}")
        if camera.blur_px is not None and not camera.estimate and self.levels != "linear":
            raise ParamError("camera.blur_px", f"{NAME} must be null if camera.estimate is false and levels is not "
                                               f"linear, got {camera.blur_px}")
        return self

    @property
    def camera_kinds(self) -> tuple[str, ...]:
        """The levels that a picture may have that others drew: those asked for, or, if `levels` is `auto`, those that
        have all the values of the camera that the user knows."""
        if self.levels != "auto":
            return (self.levels,)
        known = [kinds for name, kinds in CAMERAS.items() if getattr(self.camera, name) is not None]
        return tuple(kind for kind in ("coverage", "dots", "tonemapped") if all(kind in kinds for kinds in known))

    @property
    def most_maps(self) -> int | None:
        """The maximum number of maps, or None."""
        return self.bytes // BYTES_OF_A_MAP if self.bytes else self.at_most

    @property
    def grows_at_once(self) -> bool:
        """Whether the user asks for so many maps that growth starts without a search."""
        asked = self.maps or (self.bytes or 0) // BYTES_OF_A_MAP
        return self.growth.enabled and asked >= self.growth.at_once
