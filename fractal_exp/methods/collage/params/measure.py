"""The parameters of the search on the image's measure."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from ....runtime.params import Count, Params, Positive, check_order
from .fields import Grid


class SearchParams(Params):
    """Large neighbourhood search (Shaw 1998) on the image's measure: stages 1 and 2."""

    restarts: Annotated[int, Field(ge=1, le=1000)] = 5
    """Searches from random maps in the first round, and one more where `camera.grey_inside` says so. Later rounds may
    have half as many."""
    mixture: bool = True
    """Whether non-negative least squares mix the maps of all restarts, and the search goes on from the mixture."""
    moves: Count = 50
    """Moves of each restart, and of the search from the mixture."""
    detail_moves: Count = 25
    """Moves of stage 2, on the finer grid."""
    proposals: Positive = 2
    """Neighbours compared in a move, each on its own thread."""
    grid: Grid = 64
    """Cells per side of the grid of stage 1."""
    detail_grid: Grid = 128
    """Cells per side of the grid of stage 2; at least `grid`."""
    slack: Annotated[float, Field(ge=0, lt=1)] = 0.5
    """Share of the measure that counts as covered from the start. 0: the maps must cover all of it."""
    merging: bool = True
    """Whether maps with nearly the same image are merged."""
    pruning: bool = True
    """Whether maps that are not worth their price are removed; false: only while a set has more maps than asked for."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        check_order(self, ("grid", "detail_grid"))
        return self


class PopulationParams(Params):
    """Populations of sets of maps (memetic, Moscato 1989). For linear images with given `maps`, they replace stages
    1 and 2."""

    most_maps: Count = 8
    """Maximum number of maps for which there is a population; 0: never."""
    first: Positive = 500
    """Random sets from which each population is first chosen."""
    size: Annotated[int, Field(ge=2)] = 48
    """Sets in a population; at most `first`."""
    generations: Annotated[int, Field(ge=10)] = 40
    """Maximum number of generations. In each, every set has a child, which replaces it if it is better. The best sets
    are rendered after every tenth."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        check_order(self, ("size", "first"))
        return self


class BirthParams(Params):
    """New maps where a set leaves the measure uncovered, in stages 1 and 2. Stage 3 draws shapes in the same way."""

    residual: bool = True
    """Whether maps are born where mass is uncovered; false: anywhere on the measure."""
    reflections: bool = True
    """Whether half of all random rotations are reflections instead, also in a restart and in stage 3."""
    count: Annotated[int, Field(ge=8)] = 48
    """Candidates per birth in stage 1. Stage 2 has half as many. The best four also descend on the fine grid."""


class SaturationParams(Params):
    """Correction of the image's measure for saturated grey levels."""

    enabled: bool = True
    """Whether the measure is corrected."""
    trajectories: Positive = 4000
    """Trajectories of the chaos game that estimate the code's own measure."""
