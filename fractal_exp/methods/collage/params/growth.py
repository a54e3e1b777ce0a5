"""The parameters of growth."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, model_validator

from ....ops.collage.reference import MAX_STEPS
from ....runtime.params import NAME, Amount, ParamError, Params, Positive, Share, check_order
from .fields import Factor, PositiveShare, SingularValue, Some


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
    unlike: Share = 0.9
    """Likeness below which maps are grown and compared with what the search found. Where they have more error on a
    binary image, what was found stays if its rendering reaches this likeness, unless another one is asked for."""
    margin: Share = 0.02
    """Minimum gain in likeness for grown maps to replace what the search found."""
    at_once: Annotated[int, Field(ge=2)] = 21
    """Number of maps asked for (`maps`, `bytes`) from which they are grown without a search."""
    lit: Annotated[float, Field(ge=0, lt=1)] = 0.1
    """Grey level, as a share of the highest, above which a pixel belongs to the shape."""
    side: Annotated[int, Field(ge=32)] = 256
    """Maximum side, pixels, of the picture that is covered. A larger one is shrunk."""
    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)] = 150
    """Adam steps of all maps together for each number of maps."""
    rate: Amount = 0.02
    """Learning rate at the first step, canvas units."""
    decay: PositiveShare = 0.05
    """Factor to which the rate falls, exponentially, by the last step."""
    largest: SingularValue = 0.9
    """Largest singular value that a map may have."""
    points_per_pixel: Factor = 0.9
    """Points of the shape that all maps together move in a step, per pixel of the picture."""
    least_points: Positive = 300
    """Minimum number of points that each map moves."""
    most_points: Positive = 8000
    """Maximum number of points that each map moves."""
    recount: Positive = 25
    """Steps between two counts of the areas of the images."""
    area_points: Positive = 6000
    """Points of the shape whose images are counted."""
    subpixels: Annotated[int, Field(ge=1, le=256)] = 16
    """Subpixels per side of a pixel in which the images of points are counted."""
    area_power: Share = 0.7
    """Between two counts, areas follow the determinants to this power."""
    area_change: Annotated[float, Field(ge=1, allow_inf_nan=False)] = 5.0
    """Maximum factor by which a determinant counts as grown or shrunk since the last count."""
    half: Factor = 0.1
    """Covered share of a pixel that shows half white."""
    power: Factor = 1.5
    """Steepness with which the shade rises with the covered share."""
    around: Share = 0.5
    """Share of the cover of a pixel's 3 × 3 neighbourhood that counts for the pixel itself, in the recall within a
    pixel."""
    exact: Amount = 0.3
    """Weight of the F1 to the pixel; the F1 within a pixel has weight 1."""
    coarse: Amount = 0.3
    """Weight of the brightness of blocks of pixels."""
    blocks: Annotated[tuple[Positive, ...], Some] = (4, 8, 16)
    """Pixels per side of these blocks."""
    far: Amount = 0.05
    """Weight of the distance of what lies off the shape."""
    far_px: Factor = 8.0
    """Unit of this distance, pixels."""
    farthest: Amount = 3.0
    """Maximum of this distance, in that unit."""
    kmeans_rounds: Positive = 30
    """Rounds of k-means (Lloyd 1982) that cut the shape into cells."""
    least_cell: Positive = 4
    """Missing pixels per new map below which new maps are placed anywhere on the shape."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        check_order(self, ("least_points", "most_points"))
        for before, after in pairwise(self.counts):
            if before >= after:
                raise ParamError("counts", f"{NAME} must ascend, got {after} after {before}")
        return self
