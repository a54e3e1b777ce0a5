"""What inversion.json says beside the code, and what may be in it, whoever wrote it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, field_validator

from ..cameras.kinds import KINDS
from ..cameras.params import CameraParams
from ..errors import InputError
from ..images.known import Known
from ..images.placement import Placement
from ..likeness import Likeness
from ..methods.history import StageRecord
from ..verdict import Verdict

VERSION = 2        # of the facts
LARGEST = 10.0**6  # of a side or a place in pixels, and of the values of a camera

Value = Annotated[float, Field(ge=0, le=LARGEST)]


class Point(BaseModel, frozen=True):
    """A `CurvePoint`. Files of older versions do not hold its code."""

    maps: int
    likeness: float
    bytes: int
    code: Any = None


class Facts(BaseModel, frozen=True):
    """The facts of an `Inversion`; see `Inversion.facts`. Files of older versions hold no levels, no camera, and not
    how the picture was read."""

    version: Literal[2]
    method: str
    options: dict[str, Any]
    source: str | None
    reading: dict[str, Any] = {}
    resolution: int
    inverted: bool
    placement: Placement
    known: Known | None = None
    scale: Annotated[float, Field(gt=0, le=LARGEST)]
    likeness: Likeness
    verdict: Verdict
    levels: Annotated[str, Field(max_length=40)] | None = None
    camera: dict[str, str | Value] | None = None
    stopped: str
    seconds: float
    stages: tuple[StageRecord, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    curve: tuple[Point, ...] = ()

    @field_validator("options")
    @classmethod
    def _knows_a_camera(cls, options: dict[str, Any]) -> dict[str, Any]:
        known_camera(options)
        return options

    @field_validator("placement")
    @classmethod
    def _has_an_area(cls, placement: Placement) -> Placement:
        (x0, y0, x1, y1), sides = placement.crop_box, placement.size
        if not (min(sides) >= 1 and x1 - x0 > 0 and y1 - y0 > 0 and max(map(abs, (*sides, x0, y0, x1, y1))) <= LARGEST):
            raise ValueError(f"the picture and the box that was taken of it must have sides up to {LARGEST:g} pixels")
        return placement

    @field_validator("known")
    @classmethod
    def _is_on_the_canvas(cls, known: Known | None) -> Known | None:
        if known and not (-1 <= known.left < known.right <= 1 and -1 <= known.bottom < known.top <= 1):
            raise ValueError("the part of the canvas that the picture shows must be a box within [-1, 1]²")
        return known

    @field_validator("camera")
    @classmethod
    def _is_of_a_kind(cls, camera: dict[str, str | float] | None) -> dict[str, str | float] | None:
        if camera and camera.get("levels") not in KINDS:
            raise ValueError(f"its levels must be one of {', '.join(KINDS)}")
        if any(type(value) is str for name, value in (camera or {}).items() if name != "levels"):
            raise ValueError("its values must be numbers")
        return camera

    @field_validator("verdict", mode="before")
    @classmethod
    def _has_a_kind_of_today(cls, verdict: Any) -> Any:
        if isinstance(verdict, Mapping) and verdict.get("kind") == "not self-similar":
            return {**verdict, "kind": "not recovered"}
        return verdict

    @property
    def meaning(self) -> str:
        """What the grey levels of the target mean, or "auto"."""
        return self.levels or str(self.options.get("levels", "auto"))[:40]


def known_camera(options: Mapping[str, Any]) -> CameraParams:
    """What the options of a method say of the camera; what an older version's say beside that is left out. Raises
    `InputError` if they are no options of a camera."""
    given = options.get("camera") or {}
    if not isinstance(given, Mapping):
        raise InputError(f"the option camera must be a mapping of settings, got {type(given).__name__}")
    return CameraParams().updated(**{name: given[name] for name in given.keys() & CameraParams.model_fields.keys()})
