"""The parameters of growth."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ....ops.collage.reference import MAX_STEPS
from ....runtime.params import Amount, Params, Positive, Share
from ..fields import Factor, PositiveShare, SingularValue, Some


class GrowthParams(Params):
    """Growth: as many small maps as asked for, for shapes of no code."""

    enabled: bool = True
    """Whether maps are grown where the search finds no code."""
    counts: Annotated[tuple[Annotated[int, Field(ge=2)], ...], Some] = (4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
    """Numbers of maps on the curve; a number that is asked for is added. With a limit of time, only that one is
    grown."""
    usual: Annotated[int, Field(ge=2)] = 64
    """Maps at most, where nothing is asked for,"""
    enough: Share = 0.95
    """and the likeness (F1 within a pixel) from which on there are no more."""
    unlike: Share = 0.9
    """Likeness below which maps are grown and held against what the search found."""
    margin: Share = 0.02
    """By so much the likeness of grown maps must be the better."""
    at_once: Annotated[int, Field(ge=2)] = 21
    """Number of maps asked for (`maps`, `bytes`) from which on they are grown without any search."""
    lit: Annotated[float, Field(ge=0, lt=1)] = 0.1
    """Grey level, as a share of the highest, above which a pixel belongs to the shape."""
    side: Annotated[int, Field(ge=32)] = 256
    """Pixels a side of the picture that is covered; a larger one is shrunk."""
    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)] = 150
    """Adam steps of all maps together, for each number of maps."""
    rate: Amount = 0.02
    """Learning rate at the first step, canvas units,"""
    decay: PositiveShare = 0.05
    """and what is left of it at the last; it falls exponentially."""
    largest: SingularValue = 0.9
    """Largest singular value that a map may have."""
    points_per_pixel: Factor = 0.9
    """Points of the shape that all maps together move in a step, for each pixel of the picture,"""
    least_points: Positive = 300
    """of which each moves so many at least,"""
    most_points: Positive = 8000
    """and at most."""
    recount: Positive = 25
    """Steps after which the areas of the images are counted again;"""
    area_power: Share = 0.7
    """in between they follow the determinants to this power."""
    half: Factor = 0.1
    """Covered share of a pixel that shows half white,"""
    power: Factor = 1.5
    """and how steep this rises."""
    exact: Amount = 0.3
    """Weight of the F1 to the pixel beside that within a pixel,"""
    coarse: Amount = 0.3
    """of the brightness of blocks of pixels,"""
    far: Amount = 0.05
    """and of the distance of what is off the shape."""
    least_cell: Positive = 4
    """Pixels that are missing for each new map, below which new maps are placed anywhere on the shape."""
