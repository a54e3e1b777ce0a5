"""The camera of a picture: what its grey levels mean, and the values of what drew it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any, Self


def _number(*, is_listed: bool = False, is_length: bool = False) -> Any:
    """A value without a unit. is_listed: it is one of a list that is tried; all others may change by any small amount,
    and a user may know them: `CameraParams` has a field for each."""
    return field(default=None, metadata={"is_length": is_length, "is_listed": is_listed})


def _length(*, is_listed: bool = False) -> Any:
    """A length in canvas units; users see pixels."""
    return _number(is_listed=is_listed, is_length=True)


@dataclass(frozen=True)
class Camera:
    """How a picture was drawn from a code.

    All values but the kind are None where this kind has no such value, or where none is known. Each is declared here
    alone; lengths are in canvas units.
    """

    kind: str
    """What grey levels mean, a name in `kinds.KINDS`."""
    gain: float | None = _number()
    """How fast ink covers the paper, per density relative to a uniform one."""
    gamma: float | None = _number()
    """Of the tone curve."""
    depth: float | None = _number(is_listed=True)
    """How many maps copy a stroke at most."""
    thinning: float | None = _number(is_listed=True)
    """1 if the pen shrinks with the copies, else 0."""
    tile: float | None = _length(is_listed=True)
    """Size of the smallest parts of a construction that ended, 0 if the attractor itself is drawn."""
    pen: float | None = _length()
    """The pen's radius."""
    blur: float | None = _length()
    """Standard deviation of the blur."""

    @property
    def is_known(self) -> bool:
        """Whether any value is known."""
        return any(getattr(self, name) is not None for name in OPTIONS)

    def moved(self, values: Mapping[str, float]) -> Self:
        """The same camera with other values, by name."""
        return replace(self, **values)

    def facts(self, side: int) -> dict[str, str | float]:
        """The camera as JSON data: its kind and the values that are known; lengths in pixels of an image with so many
        a side, such as `pen_px`. `parse_camera` reads them back."""
        known = {name: value for name in OPTIONS if (value := getattr(self, name)) is not None}
        return {"levels": self.kind} | {OPTIONS[name]: value * side / 2 if name in LENGTHS else value
                                        for name, value in known.items()}

    def plain(self) -> dict[str, Any]:
        """All fields, for a checkpoint."""
        return asdict(self)


VALUES = {each.name: each.metadata for each in fields(Camera) if each.metadata}
LENGTHS = {name for name, value in VALUES.items() if value["is_length"]}
OPTIONS = {name: f"{name}_px" if name in LENGTHS else name for name in VALUES}   # the names that users see
KNOWN = {name: OPTIONS[name] for name, value in VALUES.items() if not value["is_listed"]}   # that a user may know


def parse_camera(facts: Mapping[str, str | float], side: int) -> Camera:
    """The camera whose `facts` these are. Raises KeyError, TypeError or ValueError on other data."""
    known = {name: float(facts[option]) for name, option in OPTIONS.items() if option in facts}
    return Camera(str(facts["levels"]), **{name: value * 2 / side if name in LENGTHS else value
                                           for name, value in known.items()})
