"""The parameters of collage search, one class per component. docs/method.md explains where the method uses each.

Where a docstring names no source, the value was found by trial on tuning suites (docs/lab_notes.md). Each part has a
setting that switches it off: `enabled=false` or another switch, a count of 0, odds of 0.
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from ....cameras.params import CameraParams
from ....runtime.params import NAME, ParamError, Params, Positive
from .growth import GrowthParams
from .image import FrameParams, GaussNewtonParams, ImageParams, LineParams, MoveParams, RefineParams
from .measure import BirthParams, PopulationParams, SaturationParams, SearchParams
from .rounding import CanonicalParams
from .stages import StageParams

BYTES_OF_A_MAP = 12   # six numbers of 16 bits


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
    search: SearchParams = SearchParams()
    population: PopulationParams = PopulationParams()
    births: BirthParams = BirthParams()
    saturation: SaturationParams = SaturationParams()
    refine: RefineParams = RefineParams()
    camera: CameraParams = CameraParams()
    image: ImageParams = ImageParams()
    moves: MoveParams = MoveParams()
    lines: LineParams = LineParams()
    gauss_newton: GaussNewtonParams = GaussNewtonParams()
    frame: FrameParams = FrameParams()
    canonical: CanonicalParams = CanonicalParams()
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
        if self.likeness is not None and not self.growth.enabled:
            raise ParamError("likeness", f"{NAME} is reached by growth, but growth.enabled is false; "
                                         f"got {self.likeness}")
        return self

    @property
    def most_maps(self) -> int | None:
        """The maximum number of maps, or None."""
        return self.bytes // BYTES_OF_A_MAP if self.bytes else self.at_most

    @property
    def grows_at_once(self) -> bool:
        """Whether the user asks for so many maps that growth starts without a search."""
        asked = self.maps or (self.bytes or 0) // BYTES_OF_A_MAP
        return self.growth.enabled and asked >= self.growth.at_once
