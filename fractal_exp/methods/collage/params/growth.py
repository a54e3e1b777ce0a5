"""The parameters of growth."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, model_validator

from ....ops.collage.reference import MAX_STEPS
from ....runtime.params import NAME, ParamError, Params, Share
from .fields import Some


class GrowthParams(Params):
    """Growth: as many small maps as asked for, for a shape that has no code."""

    enabled: bool = True
    """Whether maps are grown where the search finds no code."""
    counts: Annotated[tuple[Annotated[int, Field(ge=2)], ...], Some] = (4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
    """Numbers of maps on the curve, besides the number that is asked for. With a time limit, only that number is
    grown."""
    usual: Annotated[int, Field(ge=2)] = 64
    """Maximum number of maps if nothing is asked for."""
    enough: Share = 0.95
    """Likeness (F1 within a pixel) at which growth stops if nothing is asked for."""
    at_once: Annotated[int, Field(ge=2)] = 21
    """Number of maps asked for (`maps`, `bytes`) from which they are grown without a search."""
    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)] = 150
    """Adam steps of all maps together for each number of maps."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for before, after in pairwise(self.counts):
            if before >= after:
                raise ParamError("counts", f"{NAME} must ascend, got {after} after {before}")
        return self
