"""The parameters of collage search, one class per component. docs/method.md explains where the method uses each.

Where a docstring names no source, the value was found by trial on tuning suites (docs/lab_notes.md). Each part has a
setting that switches it off: `enabled=false` or another switch, a count or odds of 0, nothing (null, or an empty list)
in the place of a number. The plan of a search leaves out a stage that is off. Any other part looks at its own setting:
a function that is to change something returns it as it is, and one that proposes something proposes nothing. Numbers
that nobody varies are constants beside their use.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from ...cameras.params import CameraParams, Factor
from ...ops.collage.reference import MAX_STEPS
from ...runtime.params import NAME, Amount, Count, Odds, ParamError, Params, Positive, Share, Some

BYTES_OF_A_MAP = 12   # six numbers of 16 bits


def power_of_two(value: int) -> int:
    """Return the value; raise `ParamError` unless it is a power of two."""
    if value & (value - 1):
        raise ParamError("", f"{NAME} must be a power of two, got {value}")
    return value


Grid = Annotated[int, Field(ge=16, le=1024), AfterValidator(power_of_two)]
Steps = Annotated[int, Field(ge=0, le=MAX_STEPS)]


class SearchParams(Params):
    """Large neighbourhood search (Shaw 1998) on the image's measure: stages 1 and 2."""

    ascending = (("grid", "detail_grid"),)
    restarts: Annotated[int, Field(ge=1, le=1000)] = 5
    """Searches from random maps in the first round, and one more where `camera.curves` lets an image be a density.
    Later rounds may have half as many. A picture of a part of a shape has four times as many, of a quarter of the
    moves."""
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
    pruning: bool = True
    """Whether maps that are not worth their price are removed; false: only while a set has more maps than asked for."""


class PopulationParams(Params):
    """Populations of sets of maps (memetic, Moscato 1989). For linear images with given `maps`, they replace stages
    1 and 2."""

    ascending = (("size", "first"),)
    most_maps: Count = 8
    """Maximum number of maps for which there is a population; 0: never."""
    first: Positive = 500
    """Random sets from which each population is first chosen."""
    size: Annotated[int, Field(ge=2)] = 48
    """Sets in a population; at most `first`."""
    generations: Annotated[int, Field(ge=10)] = 40
    """Maximum number of generations. In each, every set has a child, which replaces it if it is better. The best sets
    are rendered after every tenth."""


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


class RefineParams(Params):
    """Descent of all maps on ever finer grids, at the start of stage 3."""

    steps: Steps = 120
    """Steps on each grid; 0: none."""
    finest: Annotated[int, Field(ge=128, le=4096)] = 256
    """Maximum number of cells per side of the last grid."""


class ImageParams(Params):
    """The error of a code's rendering against the image: the objective of stage 3."""

    finest: Annotated[int, Field(ge=8)] = 512
    """Maximum number of cells per side of the finest grid, which otherwise is the image's pixels."""
    last_renderings: Positive = 4
    """Number of renderings averaged in the last polish and for rounding."""
    reduced_renderings: Count = 4
    """Number of renderings averaged to estimate what a smaller image would show; 0: a large image is only shrunk."""


class MoveParams(Params):
    """Moves of single maps, judged by renderings: stage 3. Odds of 0 switch a move off."""

    count: Count = 60
    """Moves asked for. More follow while they pay (`longest`)."""
    birth: Odds = 0.36
    """Odds of adding a map."""
    reorient: Odds = 0.24
    """Odds of replacing a map by one of equal mean and covariance in another orientation."""
    replace: Odds = 0.15
    """Odds of replacing a map by a new one."""
    remove: Odds = 0.17
    """Odds of removing some maps."""
    root: Odds = 0.08
    """Odds of replacing a map by its square or cube root. 0 also leaves out the roots tried at the start."""
    drawn_count: Count = 24
    """Moves for a picture that others drew."""
    longest: Annotated[int, Field(ge=1)] = 3
    """Maximum number of moves as a multiple of `count`, while the error keeps being halved."""
    price: Amount = 0.04
    """Cost of a map, in units of the noise of a rendering."""
    worth: Amount = 0.1
    """Share of the error that a map must save in a binary image or a picture that others drew."""
    pruning: bool = True
    """Whether maps that are not worth their price are removed, from stage 3 on."""
    cleaning: bool = True
    """Whether all maps are pruned and polished in place of the last move asked for, and now and then from then on."""
    grid: Grid = 128
    """Cells per side of the fine grid of the image's measure. The coarse grid has half as many."""
    mirrored: bool = True
    """Whether a new map is also rendered mirrored in the axes of its image."""
    polish_starts: Count = 4
    """Gauss-Newton steps of all maps at the start of the stage."""
    polish_ends: Count = 8
    """Gauss-Newton steps of all maps at each pruning and at the end of the stage."""
    own_weights: Amount = 0.8
    """A code keeps free probabilities if its error is below this factor times the error with tied ones; 0: they are
    always tied."""


class LineParams(Params):
    """Maps whose images are lines. The light along a line determines the map's projection."""

    enabled: bool = True
    """Whether such maps are sought."""
    count: Positive = 2
    """Maximum number of projections that are rendered."""


class GaussNewtonParams(Params):
    """Levenberg-Marquardt steps (Marquardt 1963) on the error of the rendering."""

    enabled: bool = True
    """Whether maps are polished at all."""
    rendered_steps: Count = 3
    """Steps with a Jacobian from renderings in the last polish, if more than noise is left; 0: none."""
    strides: Annotated[tuple[Factor, ...], Some] = (1.0, 2.0, 4.0, 8.0)
    """Multiples of a step that are tried while the error falls."""
    last_patience: Positive = 2
    """Steps without gain, in a row, after which the last polish of a stage ends."""
    points_per_cell: Factor = 6.0
    """Points of the chaos game per cell of the finest grid, in a Jacobian from points."""


class FrameParams(Params):
    """The frame: the attractor's box is centred, and its longer side spans [-0.75, 0.75]."""

    enabled: bool = True
    """Whether codes are fitted into the frame."""
    firm: tuple[Factor, ...] = (100.0, 1000.0, 10000.0)
    """Factors on the frame's weight, one firm polish each, at the end of each round on a binary image whose code is not
    nearly right. The frame then says more about faint tips than the pixels do. Empty: no such polish."""


class RoundingParams(Params):
    """Rounding of a code that is nearly found: simple numbers, symmetry, the exact frame."""

    enabled: bool = True
    """Whether this stage runs."""
    matrices: bool = True
    """Whether matrices near simple ones are rounded to them."""
    lines_tried: Count = 3
    """Number of lines along an axis that are polished in the place of a map that nearly is one; 0: none."""
    symmetric: bool = True
    """Whether nearly mirror-symmetric offsets are made exactly so."""
    symmetries: bool = True
    """Whether maps may be preceded by a symmetry of the shape, in a picture that others drew."""
    polish: Count = 8
    """Gauss-Newton steps of the entries that are not fixed."""


class SimplifyParams(Params):
    """Codes of fewer maps that draw the same, for a picture that others drew."""

    unseen: Share | None = 0.002
    """Loss of likeness (F1 within a pixel) up to which maps are dropped; null: none is dropped."""
    needless: Share | None = 5e-4
    """The same loss for maps that are removed while the others are polished together with the camera; null: none is
    removed, and contained maps stay as well."""
    parent_maps: Count = 8
    """Maximum number of maps of a code whose parents and contained maps are sought. A parent is a map g of which the
    code only holds compositions g∘f. A contained map is such a g∘f beside g."""


class GrowthParams(Params):
    """Growth: as many small maps as asked for, for a picture that shows no code."""

    enabled: bool = True
    """Whether maps are grown where the search finds no code."""
    counts: Annotated[tuple[Annotated[int, Field(ge=2)], ...], Some] = (16, 64, 128, 256, 512)
    """Numbers of maps on the curve, besides the number that is asked for. Under a time limit of
    less than a minute, only that number is grown."""
    usual: Annotated[int, Field(ge=2)] = 128
    """Maximum number of maps if nothing is asked for."""
    enough: Share = 0.95
    """Likeness at which growth stops if nothing is asked for."""
    at_once: Annotated[int, Field(ge=2)] = 21
    """Number of maps asked for (`maps`, `bytes`) from which they are grown without a search."""
    steps: Steps = 2000
    """Adam steps of all maps together. Smaller numbers of maps, grown beside the one that is asked for, take half of
    them, unless a likeness is asked for."""

    @model_validator(mode="after")
    def _counts_ascend(self) -> Self:
        for before, after in pairwise(self.counts):
            if before >= after:
                raise ParamError("counts", f"{NAME} must ascend, got {after} after {before}")
        return self


class StageParams(Params):
    """Rounds and image sizes."""

    ascending = (("largest_side", "full_side"),)
    independent_rounds: Count = 4
    """Maximum number of rounds on a binary image. Each begins from nothing. 0: rounds continue from each other."""
    avoid_isometries: bool = True
    """Whether every other round avoids near-isometries: the first, third … of a picture that others drew and of a
    binary image; the second, fourth … of another image, after a code with one."""
    largest_side: Annotated[int, Field(ge=64)] = 512
    """Maximum side, pixels, of the image that is searched. A larger one is shrunk."""
    full_side: Annotated[int, Field(ge=64)] = 1024
    """Maximum side, pixels, of the image on which the code of a larger one is polished at the end; at least
    `largest_side`."""


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
    rounding: RoundingParams = RoundingParams()
    simplify: SimplifyParams = SimplifyParams()
    growth: GrowthParams = GrowthParams()
    stages: StageParams = StageParams()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        given = [f"{name}={value}" for name in ("maps", "at_most", "likeness", "bytes")
                 if (value := getattr(self, name)) is not None]
        if len(given) > 1:
            raise ValueError("give one of the number of maps (maps), its upper bound (at_most or bytes) and the "
                             f"likeness to be reached, not two; got {' and '.join(given)}")
        if self.likeness is not None and not self.growth.enabled:
            raise ParamError("likeness", f"{NAME} is reached by growth, but growth.enabled is false; "
                                         f"got {self.likeness}")
        return self

    @property
    def most_maps(self) -> int | None:
        return self.bytes // BYTES_OF_A_MAP if self.bytes else self.at_most

    @property
    def grows_at_once(self) -> bool:
        """Whether the user asks for so many maps that growth starts without a search."""
        asked = self.maps or (self.bytes or 0) // BYTES_OF_A_MAP
        return self.growth.enabled and asked >= self.growth.at_once
