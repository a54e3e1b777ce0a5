"""The parameters of the search on the image's measure. Those of the camera are in `camera_params`."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from ....ops.collage import BinnedMeasure, Descent
from ....ops.collage.reference import LEAST, LEAST_RADIUS
from ....runtime.params import NAME, Amount, Count, ParamError, Params, Positive, Share, below, check_order
from .fields import DescentSteps, Factor, Grid, Sizes, descent, odd

Beta = Annotated[float, Field(ge=0, lt=1)]
Divisor = Annotated[float, Field(ge=LEAST, allow_inf_nan=False)]


def _within_reach(params: Params, sizes: str, descent: str) -> None:
    """Raise `ParamError` if a descent makes all maps of these sizes smaller than any of them."""
    least, limit = getattr(params, sizes)[0], getattr(params, descent).largest
    if least > limit:
        raise ParamError(sizes, f"{NAME} must begin at {descent}.largest or below, which is {limit}; "
                                f"got {list(getattr(params, sizes))}")


class DescentParams(Params):
    """What all descents on the collage error (Adam, Kingma and Ba 2015) have in common, and the error's grids."""

    grids: Annotated[int, Field(ge=1, le=4)] = BinnedMeasure.grids
    """Number of grids compared, each half as fine as the one before."""
    floor: Divisor = BinnedMeasure.floor
    """Mass added to each cell before the square roots of the error are taken. Masses below it hardly count."""
    cells_per_pixel: Annotated[float, Field(ge=1, le=2)] = 1.3
    """Maximum number of cells per pixel along a side of the finest grid. A grid has a power of two within this
    limit."""
    pixel_parts: Annotated[int, Field(ge=1, le=16)] = 2
    """Parts per side into which a pixel is divided when its mass is shared among cells."""

    beta_1: Beta = Descent.beta_1
    """Adam's decay of the mean gradient."""
    beta_2: Beta = Descent.beta_2
    """Adam's decay of the mean squared gradient."""
    epsilon: Divisor = Descent.epsilon
    """Adam's addition to the root of the mean squared gradient."""
    weight_rate: Amount = Descent.weight_rate
    """Learning rate of the log-weights at the first step."""
    decay: Share = Descent.decay
    """Factor to which both rates fall, exponentially, by the last step."""
    identity_radius: Annotated[float, Field(ge=LEAST_RADIUS)] = Descent.identity_radius
    """A map that displaces the measure by less (rms, canvas units) is pushed off the identity."""
    identity_weight: Amount = Descent.identity_weight
    """Strength of that push. It also counts in the score of stages 1 and 2."""


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
    agreement: Amount = 0.02
    """Relative difference of scores below which two restarts agree; the others are then skipped."""
    grid: Grid = 64
    """Cells per side of the grid of stage 1."""
    detail_grid: Grid = 128
    """Cells per side of the grid of stage 2; at least `grid`."""
    coarser: Annotated[int, Field(ge=1, le=2)] = 2
    """How many times fewer cells per side the coarse grid has. Random sets and new maps first descend on it."""
    slack: Annotated[float, Field(ge=0, lt=1)] = 0.5
    """Share of the measure that counts as covered from the start. 0: the maps must cover all of it."""
    price: Amount = 2e-4
    """Cost of a map in the score of stage 1."""
    detail_price: Amount = 1e-4
    """Cost of a map in the score of stage 2."""
    wrong_number: Factor = 1.0
    """Cost of each map too many (for `maps` or `at_most`) or too few (for `maps`)."""
    prior: Amount = 0.01
    """Strength of the prior that pulls weights towards |det| + 0.01 in stage 1."""
    detail_prior: Amount = 0.03
    """Strength of the same prior in stage 2."""
    attractor_weight: Amount = 0.5
    """Weight in the score of the collage error of the attractor's own measure."""
    attractor_points: Positive = 200_000
    """Points of the chaos game that estimate the attractor's measure."""
    start_sets: Positive = 40
    """Random sets of maps that the first mixture of a restart is made from."""
    start_maps: Positive = 8
    """Maps in each random set."""
    start_mixture: Positive = 14
    """Maximum number of maps in the first mixture of a restart."""
    restarts_mixture: Positive = 24
    """Maximum number of maps in the mixture of all restarts."""
    least_weight: Share = 0.002
    """Minimum weight of a map in a mixture."""
    mixture_floor: Factor = 1e-4
    """Least squares divide the residual of a cell by the square root of its mass plus this mass."""
    limit_tolerance: Amount = 1e-4
    """A map enters a mixture if its smaller singular value exceeds the limit by at most this, because of rounding."""
    merging: bool = True
    """Whether maps with nearly the same image are merged."""
    same_affinity: Share = 0.9
    """Bhattacharyya affinity of the images of two maps above which merging the maps is tried."""
    accept_error: Amount = 1.5
    """A neighbour is considered further if its collage error is at most this factor times the current one plus
    `prices` times the price of a map."""
    accept_score: Amount = 1.3
    """After pruning, a neighbour is considered further if its score is at most this factor times the current one."""
    add_only: Share = 0.3
    """Probability that a move adds maps without removing any."""
    add_most: Positive = 2
    """Maximum number of maps added by such a move. Other moves add at most as many as they removed."""
    remove_another: Share = 0.6
    """Probability, after each removed map, that a move removes one more."""
    remove_most: Positive = 6
    """Maximum number of maps that a move removes."""
    remove_anywhere: Share = 0.4
    """Probability that the removed maps are drawn from all maps, instead of those nearest to one."""
    large_birth: Share = 0.5
    """Probability that the first birth after a removal is sought among large maps."""
    best_birth: Share = 0.7
    """Probability that a birth takes the best of the kept candidates, instead of any of them."""
    pruning: bool = True
    """Whether maps that are not worth their price are removed; false: only while a set has more maps than asked for."""
    prune_tried: Positive = 3
    """Maps whose removal is tried at a time: those whose absence raises the error least."""
    prune_share: Amount = 0.3
    """A removal is tried if it raises the error by at most this share, or by `prices` times the price of a map."""
    prices: Amount = 8.0
    """Number of map prices by which the error may rise on the way to a better set."""
    start: DescentSteps = descent(150, 0.03, 0.97)
    """Descent of the random sets of a restart."""
    mix: DescentSteps = descent(150, 0.015)
    """Descent of a mixture."""
    resume: DescentSteps = descent(100, 0.004)
    """Descent of a set from an earlier stage."""
    neighbour: DescentSteps = descent(50, 0.01)
    """Descent of the neighbours in a move."""
    accept: DescentSteps = descent(50, 0.004)
    """Descent of the accepted neighbour."""
    prune: DescentSteps = descent(25, 0.006)
    """Descent of a set without one of its maps."""
    merge: DescentSteps = descent(50, 0.006)
    """Descent of a set after two maps were merged."""

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
    generations: Positive = 40
    """Maximum number of generations. In each, every set has a child, which replaces it if it is better."""
    judged_every: Positive = 10
    """Generations after which the best sets are rendered; at most `generations`."""
    judged: Positive = 8
    """Number of sets that are rendered; at most `size`."""
    polished: Positive = 3
    """Number of sets that are polished: those with the best renderings; at most `judged`."""
    polish_first: Count = 3
    """Gauss-Newton steps of each polished set."""
    polish: Count = 8
    """Further steps if the first ones reduced the error to `hopeful` of its value, as they do near the true code."""
    hopeful: Share = 0.3
    """Share of the error that the first steps may leave for polishing to go on."""
    rounds: Positive = 5
    """Maximum number of populations, each started from scratch."""
    moves: Count = 6
    """Moves of stage 3 that follow, instead of `moves.count`."""
    settled: Amount = 1.15
    """Noise ratio up to which a code counts as the true one. Above it, another population starts."""
    crossed: Share = 0.5
    """Probability that a child takes maps from another set, instead of random maps."""
    two: Share = 0.45
    """Probability that two maps are replaced, not one."""
    grid: Grid = 32
    """Cells per side of the grid on which sets descend."""
    view: Annotated[int, Field(ge=16)] = 64
    """Maximum side, pixels, of the image by which sets are judged and polished."""
    sizes: Sizes = (0.15, 0.85)
    """Range of the larger singular value of a random map."""
    least_ratio: Share = 0.2
    """Minimum ratio of its singular values."""
    faint: Share = 0.02
    """Mass of a cell, relative to the mean cell, up to which it is not used as a sample of the measure."""
    anywhere: Factor = 1e-9
    """Mass added to each cell when a map is born where mass is missing, so that it can be born if none is."""
    alike: Share = 0.002
    """Relative difference of errors below which two sets count as the same; a new random set replaces one."""
    descent: DescentSteps = descent(80, 0.03, 0.95)
    """Descent of each set."""
    prior: Amount = Descent.prior
    """Strength of the prior that pulls weights towards |det| + 0.01."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for low, high in (("size", "first"), ("judged_every", "generations"), ("judged", "size"),
                          ("polished", "judged")):
            check_order(self, (low, high))
        _within_reach(self, "sizes", "descent")
        return self


class BirthParams(Params):
    """New maps where a set leaves the measure uncovered, in stages 1 and 2. Stage 3 draws shapes in the same way."""

    residual: bool = True
    """Whether maps are born where mass is uncovered; false: anywhere on the measure."""
    by_cost: Amount = 1.0
    """How much the cost of uncovered mass in the collage error counts where places are drawn, relative to the mass
    itself. Thin tips weigh little but are seen well."""
    reflections: bool = True
    """Whether half of all random rotations are reflections instead, also in a restart and in stage 3."""
    count: Positive = 48
    """Candidates per birth in stage 1."""
    detail_count: Positive = 24
    """Candidates per birth in stage 2."""
    kept: Positive = 4
    """Candidates that also descend on the fine grid. One of them is taken. At most `count` and `detail_count`."""
    blobs: Share = 1 / 3
    """Share of the candidates that take the shape of the uncovered blob; the others are random."""
    volume: Factor = 1.1
    """Sum of |det| + 0.01 that a whole set is expected to have. A new map's share of it is its first weight."""
    least_weight: Factor = 1e-6
    """Minimum of the first weight."""
    large: Sizes = (0.4, 0.97)
    """Range of the larger singular value of large maps at birth."""
    medium: Sizes = (0.1, 0.95)
    """Range of the larger singular value of other maps in stage 1, and in the random sets of a restart."""
    small: Sizes = (0.03, 0.7)
    """Range of the larger singular value of other maps in stage 2."""
    least_ratio: Share = 0.05
    """Minimum ratio of the singular values of a random map, also in a restart."""
    anchored: Share = 0.5
    """Probability that a random map sends a random point of the measure to its place, instead of the mean."""
    blob_radius: Factor = 0.5
    """Standard deviation of the Gaussian window in which a blob is measured, canvas units, as a factor of a random
    size."""
    blob_grid: Grid = 64
    """Cells per side of the grid on which blobs are measured."""
    blob_least_radius: Factor = 1.0
    """Minimum standard deviation of that window, cells."""
    blob_least_width: Factor = 0.15
    """Standard deviation, cells, whose square is added to a blob's covariance."""
    blob_steps: Positive = 3
    """Steps of mean shift (Fukunaga and Hostetler 1975) that find the centre of a blob."""
    coarse: DescentSteps = descent(40, 0.04, 0.98)
    """Descent of all candidates on the coarse grid."""
    fine: DescentSteps = descent(15, 0.01, 0.98)
    """Descent of the kept candidates on the fine grid."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for count in ("count", "detail_count"):
            check_order(self, ("kept", count))
        for sizes in ("large", "medium", "small"):
            for kind in ("coarse", "fine"):
                _within_reach(self, sizes, kind)
        return self


class SaturationParams(Params):
    """Correction of the image's measure for saturated grey levels."""

    enabled: bool = True
    """Whether the measure is corrected."""
    trust: Amount = 4.0
    """Power of the agreement between image and rendering that gives the trust in a correction."""
    trajectories: Positive = 4000
    """Trajectories of the chaos game that estimate the code's own measure."""
    length: Annotated[int, Field(ge=2)] = 530
    """Points of each trajectory, including those of the warm-up."""
    warmup: Count = 30
    """Points at the start of each trajectory that are dropped; fewer than `length`."""
    weak: Amount = 1e-3
    """Mass added to both sides of the ratio of masses in a pixel (-log(1 - I) of a density, I of other images),
    because faint pixels tell little."""
    window: Annotated[int, Field(ge=1), AfterValidator(odd)] = 3
    """Pixels per side of the window over which all masses are averaged first."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        below(self, "warmup", "length")
        return self
