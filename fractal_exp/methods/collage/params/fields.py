"""Types of values that several components have as parameters."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from ....ops.collage.reference import MAX_STEPS, Descent
from ....runtime.params import NAME, Amount, Interval, ParamError, Params


def ascending(values: Interval) -> Interval:
    """Return the two values; raise `ParamError` unless they ascend."""
    if values[0] > values[1]:
        raise ParamError("", f"{NAME} must be a lower and an upper end, got {list(values)}")
    return values


def power_of_two(value: int) -> int:
    """Return the value; raise `ParamError` unless it is a power of two."""
    if value & (value - 1):
        raise ParamError("", f"{NAME} must be a power of two, got {value}")
    return value


def odd(value: int) -> int:
    """Return the value; raise `ParamError` unless it is odd."""
    if value % 2 == 0:
        raise ParamError("", f"{NAME} must be odd, got {value}")
    return value


SingularValue = Annotated[float, Field(gt=0, lt=1)]
Sizes = Annotated[tuple[SingularValue, SingularValue], AfterValidator(ascending)]
PositiveShare = Annotated[float, Field(gt=0, le=1)]
Factor = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Grid = Annotated[int, Field(ge=16, le=1024), AfterValidator(power_of_two)]
Some = Field(min_length=1)   # for a list that must not be empty


class DescentSteps(Params):
    """One descent on the collage error: how long and how fast."""

    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)]
    """Adam steps."""
    rate: Amount
    """Learning rate of the maps at the first step, canvas units."""
    largest: SingularValue = Descent.largest
    """Largest singular value that a map may have."""


def descent(steps: int, rate: float, largest: float = Descent.largest) -> DescentSteps:
    """Shorthand for `DescentSteps`, for defaults."""
    return DescentSteps(steps=steps, rate=rate, largest=largest)
