"""The camera of a picture: what its grey levels mean, and the values of what drew it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Self

LENGTHS = ("tile", "pen", "blur")   # canvas units
NUMBERS = ("gain", "gamma", "depth", "thinning")


@dataclass(frozen=True)
class Camera:
    """How a picture was drawn from a code.

    kind: what grey levels mean, a name in `kinds.KINDS`. All other values are None where this kind has no such value,
    or where none is known. gain: how fast ink covers the paper, per density relative to a uniform one; gamma: of the
    tone curve; depth: how many maps copy a stroke at most; thinning: 1 if the pen shrinks with the copies, else 0;
    tile: the size of the smallest parts of a construction that ended, 0 if the attractor itself is drawn; pen: the
    pen's radius; blur: the standard deviation of the blur. Lengths are in canvas units.
    """

    kind: str
    gain: float | None = None
    gamma: float | None = None
    depth: float | None = None
    thinning: float | None = None
    tile: float | None = None
    pen: float | None = None
    blur: float | None = None

    @property
    def is_known(self) -> bool:
        """Whether any value is known."""
        return any(getattr(self, name) is not None for name in (*NUMBERS, *LENGTHS))

    def moved(self, values: Mapping[str, float]) -> Self:
        """The same camera with other values, by name."""
        return replace(self, **values)

    def facts(self, side: int) -> dict[str, str | float]:
        """The camera as JSON data: its kind and the values that are known; lengths in pixels of an image with so many
        a side, such as `pen_px`. `parse_camera` reads them back."""
        numbers = {name: value for name in NUMBERS if (value := getattr(self, name)) is not None}
        lengths = {f"{name}_px": value * side / 2 for name in LENGTHS if (value := getattr(self, name)) is not None}
        return {"levels": self.kind, **numbers, **lengths}

    def plain(self) -> dict[str, Any]:
        """All fields, for a checkpoint."""
        return asdict(self)


def parse_camera(facts: Mapping[str, str | float], side: int) -> Camera:
    """The camera whose `facts` these are. Raises KeyError, TypeError or ValueError on other data."""
    numbers = {name: float(facts[name]) for name in NUMBERS if name in facts}
    lengths = {name: float(facts[f"{name}_px"]) * 2 / side for name in LENGTHS if f"{name}_px" in facts}
    return Camera(str(facts["levels"]), **numbers, **lengths)
