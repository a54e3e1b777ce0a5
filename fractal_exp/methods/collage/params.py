"""The parameters of collage search, a class a component. docs/collage.md says where each stands in the method.

Where a docstring names no source, the value was found by trial on tuning suites (docs/lab_notes.md). A part is switched
off by its own setting: `enabled=false`, a count of 0, odds of 0.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from ...ops.collage.reference import MAX_STEPS
from ...runtime.params import NAME, Amount, Count, Interval, Odds, ParamError, Params, Positive, Share, as_yaml


def _ascending(values: Interval) -> Interval:
    if values[0] > values[1]:
        raise ParamError("", f"{NAME} must be a lower and an upper end, got {list(values)}")
    return values


def _power_of_two(value: int) -> int:
    if value & (value - 1):
        raise ParamError("", f"{NAME} must be a power of two, got {value}")
    return value


def _odd(value: int) -> int:
    if value % 2 == 0:
        raise ParamError("", f"{NAME} must be odd, got {value}")
    return value


SingularValue = Annotated[float, Field(gt=0, lt=1)]
Sizes = Annotated[tuple[SingularValue, SingularValue], AfterValidator(_ascending)]
PositiveShare = Annotated[float, Field(gt=0, le=1)]
Nudge = Annotated[float, Field(gt=-0.5, lt=0.5)]
Factor = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Grid = Annotated[int, Field(ge=16, le=1024), AfterValidator(_power_of_two)]
BYTES_OF_A_MAP = 12   # six numbers of 16 bits
Some = Field(min_length=1)   # of a list that must not be empty


class DescentSteps(Params):
    """One descent on the collage error: how long and how fast."""

    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)]
    """Adam steps."""
    rate: Amount
    """Learning rate of the maps at the first step, canvas units."""
    largest: SingularValue = 0.995
    """Largest singular value that a map may have."""


def _descent(steps: int, rate: float, largest: float = 0.995) -> DescentSteps:
    return DescentSteps(steps=steps, rate=rate, largest=largest)


class DescentParams(Params):
    """What all descents on the collage error share (Adam, Kingma and Ba 2015), and the grids of that error."""

    grids: Annotated[int, Field(ge=1, le=4)] = 3
    """Grids that are compared, each half as fine as the one before."""
    cells_per_pixel: Annotated[float, Field(ge=1, le=2)] = 1.3
    """Cells a side of the finest grid that an image can fill, for each pixel of its side; a grid has the next lower
    power of two at most."""

    weight_rate: Amount = 0.05
    """Learning rate of the logarithms of the weights."""
    decay: Share = 0.05
    """What is left of both rates at the last step; they fall exponentially."""
    identity_radius: Annotated[float, Field(ge=1e-6)] = 0.1
    """Maps that displace the measure by less (rms, canvas units) are pushed off the identity."""
    identity_weight: Amount = 0.3
    """Strength of that push, which also adds to the score of stages 1 and 2."""


class SearchParams(Params):
    """Large neighbourhood search (Shaw 1998) on the image's measure: stages 1 and 2."""

    restarts: Annotated[int, Field(ge=1, le=1000)] = 5
    """Searches from random maps in the first round; later rounds take half as many, rounded up."""
    mixture: bool = True
    """Whether the maps of all restarts are mixed by non-negative least squares, and the search goes on from there."""
    moves: Count = 50
    """Moves of each restart, and of the search from the mixture."""
    detail_moves: Count = 25
    """Moves of stage 2, on the finer grid."""
    proposals: Positive = 2
    """Neighbours that are compared in a move, by as many threads."""
    agreement: Amount = 0.02
    """Relative difference of scores below which two restarts have found the same; the others are then left out."""
    grid: Grid = 64
    """Cells a side of the grid of stage 1. Random sets and newborn maps first descend on half as many."""
    detail_grid: Grid = 128
    """Cells a side of the grid of stage 2."""
    slack: Annotated[float, Field(ge=0, lt=1)] = 0.5
    """Share of the measure that counts as covered from the start. 0: the maps must cover all of it."""
    price: Amount = 2e-4
    """Cost of a map in the score of stage 1."""
    detail_price: Amount = 1e-4
    """Cost of a map in the score of stage 2."""
    wrong_number: Factor = 1.0
    """Cost of each map more than `maps` or `at_most` allows, or fewer than `maps` asks for."""
    prior: Amount = 0.01
    """Strength of the pull of weights towards |det| + 0.01 in stage 1."""
    detail_prior: Amount = 0.03
    """The same in stage 2."""
    attractor_weight: Amount = 0.5
    """Weight of the collage error of the attractor's own measure in the score."""
    attractor_points: Positive = 200_000
    """Points of the chaos game that estimate that measure."""
    start_sets: Positive = 40
    """Random sets of maps from which a restart takes its first mixture."""
    start_maps: Positive = 8
    """Maps in each of them."""
    start_mixture: Positive = 14
    """Maps that the first mixture of a restart may have."""
    restarts_mixture: Positive = 24
    """Maps that the mixture of all restarts may have."""
    least_weight: Share = 0.002
    """Least weight of a map in a mixture."""
    mixture_floor: Factor = 1e-4
    """Mass that is added to that of a cell where least squares divide a residual by its square root."""
    same_affinity: Share = 0.9
    """Bhattacharyya affinity of two maps' images from which on the two are tried as one."""
    accept_error: Amount = 1.5
    """A neighbour is looked at further if its collage error is below this factor times the current one, plus `prices`
    prices of a map."""
    accept_score: Amount = 1.3
    """And after pruning, if its score is below this factor times the current one."""
    add_only: Share = 0.3
    """Probability that a move removes no map before it adds some."""
    add_most: Positive = 2
    """Maps that such a move may add; after a removal it is as many as were removed."""
    remove_another: Share = 0.6
    """Probability that a move removes one more map after each."""
    remove_most: Positive = 6
    """Maps that a move may remove."""
    remove_anywhere: Share = 0.4
    """Probability that the removed maps are drawn from all, not from those nearest to one."""
    large_birth: Share = 0.5
    """Probability that the first map born in the place of removed ones is looked for among large maps."""
    best_birth: Share = 0.7
    """Probability that the best of the maps kept at a birth is taken, not any of them."""
    prune_tried: Positive = 3
    """Maps whose removal is tried at a time: those that raise the error least."""
    prune_share: Amount = 0.3
    """A removal is tried if it raises the error by at most this share of it, or by `prices` prices of a map."""
    prices: Amount = 8.0
    """Prices of a map by which the error may rise on the way to a better set."""
    start: DescentSteps = _descent(150, 0.03, 0.97)
    """The random sets of a restart."""
    mix: DescentSteps = _descent(150, 0.015)
    """A mixture."""
    resume: DescentSteps = _descent(100, 0.004)
    """A set found by an earlier stage."""
    neighbour: DescentSteps = _descent(50, 0.01)
    """The neighbours of a move."""
    accept: DescentSteps = _descent(50, 0.004)
    """The neighbour that is accepted."""
    prune: DescentSteps = _descent(25, 0.006)
    """A set without one of its maps."""
    merge: DescentSteps = _descent(50, 0.006)
    """A set in which two maps were made one."""


class PopulationParams(Params):
    """Populations of sets of maps (memetic, Moscato 1989): stages 1 and 2 of linear images of given `maps`."""

    largest: Count = 8
    """Maps of a set up to which there is a population; 0: none."""
    first: Positive = 500
    """Random sets that the first population is chosen from."""
    size: Annotated[int, Field(ge=2)] = 48
    """Sets of a population."""
    generations: Positive = 40
    """Generations at most. In each, every set has a child, which takes its place if it is better."""
    judged_every: Positive = 10
    """Generations after which the best sets are rendered,"""
    judged: Positive = 8
    """so many of them,"""
    polished: Positive = 3
    """and polished, those of the best renderings."""
    polish_first: Count = 3
    """Gauss-Newton steps of each,"""
    polish: Count = 8
    """and more steps if those have brought the error below `hopeful` of what it was: near the true code they do."""
    hopeful: Share = 0.3
    """That share."""
    rounds: Positive = 5
    """Populations at most, each begun anew."""
    moves: Count = 6
    """Moves by renderings that follow them, in the place of `moves.count`."""
    settled: Amount = 1.15
    """Noise ratio up to which a code is taken for the true one; another population begins above it."""
    crossed: Share = 0.5
    """Probability that a child takes maps from another set; otherwise they are random."""
    two: Share = 0.45
    """Probability that two maps are exchanged, not one."""
    grid: Grid = 32
    """Cells a side of the grid on which sets descend."""
    view: Annotated[int, Field(ge=16)] = 64
    """Pixels a side, at most, of the image by which they are judged and polished."""
    sizes: Sizes = (0.15, 0.85)
    """Range of the larger singular value of a random map."""
    least_ratio: Share = 0.2
    """Least ratio of its singular values."""
    faint: Share = 0.02
    """Mass of a cell, as a share of the mean cell's, below which it is no sample of the measure."""
    alike: Share = 0.002
    """Relative difference of errors below which two sets are the same; a new random one replaces one of them."""
    descent: DescentSteps = _descent(80, 0.03, 0.95)
    """Of each set."""
    prior: Amount = 0.01
    """Strength of the pull of weights towards |det| + 0.01."""


class BirthParams(Params):
    """New maps where a set leaves the measure uncovered, in stages 1 and 2. The shapes of stage 3's are made alike."""

    residual: bool = True
    """Whether maps are born where mass is uncovered; false: anywhere on the measure."""
    count: Positive = 48
    """Candidates of a birth in stage 1."""
    detail_count: Positive = 24
    """Candidates of a birth in stage 2."""
    kept: Positive = 4
    """Candidates that also descend on the fine grid, of which one is taken."""
    blobs: Share = 1 / 3
    """Share of the candidates that take the shape of the uncovered blob; the others are random."""
    volume: Factor = 1.1
    """Sum of |det| + 0.01 that a whole set is expected to have: a newborn map weighs its own over this."""
    large: Sizes = (0.4, 0.97)
    """Range of the larger singular value of large maps at birth."""
    medium: Sizes = (0.1, 0.95)
    """The same of other maps in stage 1, and of the random sets of a restart."""
    small: Sizes = (0.03, 0.7)
    """The same of other maps in stage 2."""
    least_ratio: Share = 0.05
    """Least ratio of the singular values of a random map, also of a restart's."""
    anchored: Share = 0.5
    """Probability that a random map sends a random point of the measure to its place, not the measure's mean."""
    blob_radius: Factor = 0.5
    """Standard deviation, canvas units, of the Gaussian window in which a blob is measured, as a factor of a random
    size."""
    blob_grid: Grid = 64
    """Cells a side of the grid on which blobs are measured."""
    blob_least_radius: Factor = 1.0
    """Least standard deviation of that window, cells."""
    blob_least_width: Factor = 0.15
    """Standard deviation, cells, whose square is added to the covariance of a blob."""
    blob_steps: Positive = 3
    """Steps of mean shift (Fukunaga and Hostetler 1975) that find a blob's centre."""
    coarse: DescentSteps = _descent(40, 0.04, 0.98)
    """All candidates, on the coarse grid."""
    fine: DescentSteps = _descent(15, 0.01, 0.98)
    """Those that are kept, on the fine grid."""


class SaturationParams(Params):
    """The correction of the image's measure for what its grey levels hide."""

    enabled: bool = True
    """Whether the measure is corrected."""
    trust: Amount = 4.0
    """Power of the agreement between the image and the code's rendering with which a correction is trusted."""
    trajectories: Positive = 4000
    """Trajectories of the chaos game that give the code's own measure."""
    length: Annotated[int, Field(ge=31)] = 530
    """Points of each, of which 30 are warm-up."""
    weak: Amount = 1e-3
    """Mass that is added to that of a pixel (-log(1 - I) of a density, I of other images) on both sides of the ratio of
    masses: of fainter pixels it tells little."""
    window: Annotated[int, Field(ge=1), AfterValidator(_odd)] = 3
    """Pixels a side of the window over which all masses are averaged first."""


class RefineParams(Params):
    """Descent of all maps on ever finer grids, at the start of stage 3."""

    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)] = 120
    """Steps on each grid; 0: none."""
    coarsest: Annotated[int, Field(ge=128, le=1024), AfterValidator(_power_of_two)] = 128
    """Cells a side of the first grid; each next one has twice as many."""
    finest: Annotated[int, Field(ge=64, le=4096)] = 256
    """Cells a side of the last grid at most."""
    grids: Annotated[int, Field(ge=1, le=8)] = 4
    """Grids that each error compares, each half as fine as the one before."""
    rate: Amount = 0.002
    """Learning rate on the first grid, canvas units. Each next one takes half of it."""
    largest: SingularValue = 0.9995
    """Largest singular value that a map may have."""


class CameraParams(Params):
    """How the image is taken to have been rendered from a code: as the suite's targets are."""

    supersample: Positive = 16
    """Subpixels a side of a pixel of a density or a binary image (Section 5 of the paper)."""
    coverage_supersample: Positive = 4
    """The same of an anti-aliased image."""
    points_per_pixel: Annotated[float, Field(ge=0.1, allow_inf_nan=False)] = 50_000_000 / 1024**2
    """Points of the chaos game for each pixel of the canvas (Section 5 of the paper)."""
    threshold: Annotated[float, Field(ge=0, lt=1)] = 0.25
    """Share of lit subpixels above which a pixel of a binary image is white."""
    reuse: Positive = 8
    """Words under which a point of the invariant measure is put in a rendering that judges a code."""
    linear_points: Annotated[float, Field(ge=0.1, allow_inf_nan=False)] = 12.0
    """Points for each pixel, at least, of a rendering that judges a code by a linear image."""
    deblur_steps: Count = 10
    """Steps of Richardson (1972) and Lucy (1974) that sharpen a blurred image before maps are sought."""
    rounding: Amount = 1e-3
    """Subpixels by which a grey level of our own renderer may miss a whole number of them."""

    pen_px: Amount | None = None
    """Radius of the pen that drew lines and areas, pixels of the image; none: estimated."""
    blur_px: Amount | None = None
    """Standard deviation of the blur, pixels of the image; none: estimated, or none of a linear image."""
    tiles_px: tuple[Factor, ...] = (32.0, 22.0, 16.0, 11.0, 8.0, 5.6, 4.0)
    """Sizes of the smallest parts of a construction that are tried; none: only the attractor is."""
    small_tile_px: Amount = 8.0
    """Size of such parts by half of which, at most, a code's attractor may lie off the shape in the picture."""
    dotted: Share = 0.75
    """Dots explain a picture if their angle of error is below this share of that of a pen."""
    gain: Factor | None = None
    """How fast dots cover the paper, for a density relative to a uniform one on the canvas; none: estimated."""
    pens_px: Annotated[tuple[Amount, ...], Some] = (0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)
    """Radii that are tried."""
    blurs_px: Annotated[tuple[Amount, ...], Some] = (0.0, 0.2, 0.35, 0.5, 0.7, 1.0)
    """Blurs that are tried."""
    gains: Annotated[tuple[Factor, ...], Some] = tuple(0.01 * 2**(k / 2) for k in range(18))
    """Gains that are tried."""
    pen_supersample: Positive = 3
    """Subpixels a side of a pixel where a pen is laid on."""
    dot_supersample: Positive = 2
    """Subpixels a side of a pixel where dots are blurred."""


class ImageParams(Params):
    """The error of a code's rendering against the image: the objective of stage 3."""

    grids: Positive = 4
    """Grids that are compared, each half as fine as the one before."""
    finest: Annotated[int, Field(ge=8)] = 512
    """Cells a side of the finest at most; it has those of the image's pixels if they are fewer."""
    least_noise: Factor = 1e-3
    """Least error that is taken for the noise of a rendering."""
    last_renderings: Positive = 4
    """Renderings whose mean is compared in the last polish, and for the last digits."""
    reduced_renderings: Positive = 4
    """Renderings whose mean tells what a smaller image would show."""


class MoveParams(Params):
    """Moves of single maps, judged by renderings: stage 3. A move's odds of 0 switch it off."""

    count: Count = 60
    """Moves asked for; more follow while they pay (`longest`)."""
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
    """Moves in a picture that others drew."""
    drawn_least: Count = 8
    """Moves before it is looked whether that is enough."""
    alike: Share = 0.985
    """F1 within 1 px from which on the code of such a picture is settled."""
    longest: Annotated[int, Field(ge=1)] = 3
    """Times `count` moves are made at most, while the error keeps being halved."""
    recent: Share = 2 / 3
    """Moves, as a share of `count`, within which the error must have been halved to go on."""
    price: Amount = 0.04
    """Cost of a map, in units of the noise of a rendering."""
    worth: Amount = 0.1
    """Share of the error by which a map must lower it in a picture that others drew."""
    missing: Amount = 1e3
    """Cost of each map fewer than asked for."""
    candidates: Positive = 24
    """Maps born in a move."""
    kept: Positive = 6
    """Those that also descend on the fine grid."""
    rendered: Positive = 3
    """Those that are rendered."""
    grid: Grid = 128
    """Cells a side of the fine grid of the image's measure; the coarse one has half as many."""
    widths: Annotated[tuple[Factor, ...], Some] = (1.0, 0.25, 0.03)
    """Widths of a new map's image that are rendered, as factors of its own; the last is that of a reoriented line."""
    thin: Amount = 0.1
    """Width over length below which a map's image is a line."""
    least_width: Factor = 1e-3
    """Standard deviation, canvas units, whose square is added to the covariance of the image of a map to reorient."""
    sizes: Sizes = (0.02, 0.95)
    """Range of the larger singular value at birth."""
    blobs: Share = 0.5
    """Share of the candidates that take the shape of the uncovered blob; the others are random."""
    largest: SingularValue = 0.97
    """Largest singular value of a map in a new orientation."""
    visible_shares: Annotated[tuple[PositiveShare, ...], Some] = (1.0, 0.5, 0.25, 0.1, 0.04, 0.015, 0.006)
    """Shares of the weight that a map's volume asks for, of which the best is taken: thin images are hardly seen."""
    rough: DescentSteps = _descent(40, 0.02, 0.98)
    """All candidates, on the coarse grid."""
    fine: DescentSteps = _descent(20, 0.005, 0.98)
    """Those that are kept, on the fine grid."""
    remove_most: Positive = 3
    """Maps that one move may remove."""
    promising: Amount = 1.25
    """A new map is polished if the error is below this factor times the one before,"""
    hopeful: Amount = 4.0
    """and all maps after a removal or a root, or a line in another projection, if it is below this one."""
    polish_new: Count = 2
    """Gauss-Newton steps of a new map."""
    polish_rest: Count = 4
    """Gauss-Newton steps of all maps after a removal or a root."""
    polish_accepted: Count = 1
    """Gauss-Newton steps of all maps after an accepted move."""
    polish_ends: Count = 8
    """Gauss-Newton steps of all maps whenever the code is pruned, and at the end of the stage; half as many at its
    start."""
    settled: Amount = 1.05
    """Noise ratio below which a code is taken for the true one,"""
    settled_more: Amount = 0.005
    """which rises by this with each move."""
    own_weights: Amount = 0.8
    """A code keeps probabilities of its own if its error is below this factor times the error of tied ones; 0: they are
    always tied."""
    root_error: Amount = 30.0
    """A root is tried if its error is below this factor times the error before,"""
    root_least: Amount = 0.5
    """or below that factor times this error."""
    root_maps: Positive = 10
    """Maps from which on roots are not tried where the code is hopeless."""
    root_orders: Annotated[tuple[Annotated[int, Field(ge=2)], ...], Some] = (2, 3)
    """Orders of roots."""
    double_px: Amount = 2.0
    """Maps of a code of a picture that others drew that are no farther apart (rms, pixels) are one."""
    unseen: Share = 0.002
    """Likeness (F1 within a pixel) that a map must add to a code of a picture that others drew."""
    flat_px: Amount = 0.75
    """Standard deviation across a line (pixels) below which the shape is taken to lie on it."""
    parent_maps: Count = 8
    """Maps that a code of a picture that others drew may have for such to be looked for that several of its maps are
    compositions of."""
    parent_tried: Count = 6
    """Those that are tried,"""
    parent_inside: Share = 0.97
    """if they send so many of the attractor's points to where the image is lit,"""
    parent_points: Positive = 20_000
    """of so many."""
    root_all: Count = 5
    """Maps that a code of a picture that others drew may have for the roots of all to be tried at the start."""
    root_largest: Count = 2
    """Largest maps whose roots are tried at the start of the stage."""


class LineParams(Params):
    """Maps whose images are lines: their projection is found from the light along the line."""

    enabled: bool = True
    """Whether such maps are looked for."""
    count: Positive = 2
    """Projections that are rendered at most."""
    polish: Count = 3
    """Gauss-Newton steps of each."""
    points: Positive = 50_000
    """Points of the attractor that are projected."""
    widest_px: Amount = 2.0
    """Four standard deviations of a line's width, pixels, at most."""
    directions: Annotated[int, Field(ge=3)] = 48
    """Directions of projection that are tried."""
    ends: Annotated[int, Field(ge=2)] = 24
    """Places where a line may begin or end."""
    reach: Amount = 0.5
    """How far beyond its own ends, as a share of its length."""
    finer: Annotated[int, Field(ge=1), AfterValidator(_odd)] = 9
    """Angles and places of each end that are tried between the neighbours of the best, the best among them."""
    shortest: Annotated[float, Field(ge=0, lt=1)] = 0.2
    """Least length, as a share of its own."""
    bins: Positive = 256
    """Bins of a projected measure."""
    aside_px: Count = 1
    """Pixels on each side of a line whose light may be its own."""
    largest: SingularValue = 0.98
    """Largest singular value of such a map."""


class GaussNewtonParams(Params):
    """Levenberg-Marquardt steps (Marquardt 1963) on the error of the rendering."""

    enabled: bool = True
    """Whether maps are polished at all."""
    rendered_steps: Count = 3
    """Steps with a Jacobian from renderings, where more than noise is left; 0: none."""
    rendered_above: Amount = 1.1
    """Noise ratio above which they are made,"""
    rendered_below: Amount = 6.0
    """and below which."""
    damping: Amount = 1e-2
    """Damping of the first step, relative to the diagonal of the normal equations."""
    least_damping: Amount = 1e-4
    """Least damping."""
    damping_down: Annotated[float, Field(ge=1)] = 5.0
    """Damping is divided by this after a step that led down,"""
    damping_up: Annotated[float, Field(ge=1)] = 30.0
    """and multiplied by this after one that did not."""
    tries: Positive = 2
    """Dampings that are tried in a step."""
    strides: Annotated[tuple[Factor, ...], Some] = (1.0, 2.0, 4.0, 8.0)
    """Multiples of a step that are tried while they lead further down."""
    little: Amount = 0.005
    """Relative gain below which a step was in vain."""
    patience: Positive = 1
    """Steps in vain, one after another, after which a polish ends,"""
    last_patience: Positive = 2
    """and one that ends a stage."""
    longest_px: Factor = 2.0
    """Longest step of a parameter, pixels of displacement."""
    largest: SingularValue = 0.9995
    """Largest singular value that a map may have, also one of simple numbers."""
    points_per_cell: Factor = 6.0
    """Points of the chaos game for each cell of the finest grid, in a Jacobian from points."""
    window: Annotated[int, Field(ge=1), AfterValidator(_odd)] = 3
    """Cells a side of the window in which grey levels tell how they follow from masses, in a Jacobian from points."""
    step_px: Factor = 0.05
    """Finite difference of a parameter, pixels, in a Jacobian from points,"""
    nudge_px: Factor = 0.05
    """in one from renderings,"""
    binary_nudge_px: Factor = 0.3
    """and in one from renderings of a binary image, which change by whole pixels."""


class FrameParams(Params):
    """The frame: the attractor's box is centred, its longer side spans [-0.75, 0.75]."""

    enabled: bool = True
    """Whether codes are fitted into the frame."""
    shortest: Amount = 0.93
    """Span of the lit pixels, as a share of the frame's side, from which on an image is taken to fill its frame,"""
    longest: Amount = 1.17
    """and up to which. What is lit may also lie off the middle of the canvas by as much as it may be too long."""
    sigma_px: Factor = 0.05
    """Misfit, pixels, that counts as much as the counting error of one pixel."""
    beyond_px: Factor = 1.0
    """Misfit from which on it counts in proportion (Huber 1964)."""
    far: Amount = 30.0
    """Noise ratio from which on the frame tells nothing, and the last digits stay as they are."""
    worse: Amount = 1.05
    """Factor on the error that fitting the frame may cost."""


class CanonicalParams(Params):
    """The last digits of a code that is nearly found: simple numbers, symmetry, the exact frame."""

    enabled: bool = True
    """Whether this stage runs."""
    near_error: Amount = 0.5
    """Error up to which the stage runs even where the noise ratio is above `frame.far`."""
    fill: bool = True
    """Whether the frame is filled exactly."""
    symmetric: bool = True
    """Whether offsets that are nearly mirror-symmetric are made so."""
    worse: Amount = 1.02
    """Factor on the least error so far that simple numbers may cost,"""
    line_worse: Amount = 1.0
    """that lines along an axis may cost,"""
    symmetric_worse: Amount = 1.05
    """that symmetric offsets may cost,"""
    filled_worse: Amount = 1.2
    """and that the exact frame may cost."""
    near_px: Amount = 0.05
    """Displacement (rms over the attractor, pixels) within which a matrix is near a simple one."""
    denominators: Annotated[tuple[Positive, ...], Some] = (*range(1, 13), 100)
    """Denominators of the proper fractions that are simple entries of a matrix; those and their square roots are the
    simple ratios of a similarity,"""
    ratios: tuple[Annotated[float, Field(gt=0, lt=1)], ...] = (((5**0.5 - 1) / 2) ** 2,)
    """and so are these: the squared inverse of the golden ratio."""
    degrees: Annotated[tuple[Positive, ...], Some] = (15, 18)
    """A simple similarity rotates by a multiple of one of these, degrees."""
    symmetric_level: Share = 0.25
    """Grey level above which a pixel belongs to the shape whose symmetries are looked for."""
    symmetric_likeness: Share = 0.93
    """F1 within 1 px of a shape with its image under a symmetry."""
    drawn_near_px: Amount = 0.5
    """The same displacement in a picture that others drew,"""
    drawn_worse: Amount = 1.5
    """the factor on the error there,"""
    drawn_denominators: Annotated[tuple[Positive, ...], Some] = tuple(range(1, 13))
    """and the denominators."""
    least_side: Positive = 256
    """Side of an image, pixels, below which the pixel of this size counts instead."""
    line_px: Amount = 1.0
    """Standard deviation across, pixels, of an image that may be a line along an axis,"""
    line_thin: Amount = 0.1
    """and as a share of its length."""
    lines_tried: Positive = 3
    """Lines that are polished."""
    line_steps: Count = 3
    """Gauss-Newton steps of each."""
    line_factors: Annotated[tuple[Factor, ...], Some] = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4)
    """Lengths at which a line is tried, as factors of its own."""
    line_scales: Positive = 3
    """Simple scales of a line that are tried,"""
    line_shifts: Positive = 9
    """each in so many places within a pixel to either side."""
    polish: Count = 8
    """Gauss-Newton steps of what is not fixed."""
    symmetric_px: Amount = 0.1
    """Difference of offsets, pixels, that may be the same."""
    framed_px: Amount = 0.5
    """Misfit, pixels, of a frame that is meant to be filled,"""
    exact_px: Factor = 0.002
    """and the `sigma_px` of one that is."""
    nudges: Annotated[tuple[Nudge, ...], Some] = (0.0, 1e-6, -1e-6, 1e-5, -1e-5, 5e-5, -5e-5)
    """Relative changes of size that are tried on a shape that may end at edges of pixels."""
    points: Positive = 20_000
    """Points that tell an attractor's mean and covariance."""


    def of_drawn(self) -> CanonicalParams:
        """As they are for a picture that others drew, which tells less of a code."""
        return self.updated(near_px=self.drawn_near_px, worse=self.drawn_worse, symmetric_worse=self.drawn_worse,
                            denominators=self.drawn_denominators)


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


class StageParams(Params):
    """Rounds, sizes and shares of time."""

    density_rounds: Positive = 4
    """Rounds at most, where grey levels are a density."""
    other_rounds: Positive = 2
    """Rounds at most on other images: it is less likely that they show an attractor."""
    drawn_rounds: Positive = 3
    """The same of pictures that others drew."""
    drawn_blur_px: Amount = 3.0
    """In each later round their measure is blurred by so many pixels more: a construction that ended early looks like
    its attractor from afar."""
    second_round: Amount = 1.2
    """Noise ratio above which a second round begins,"""
    later_rounds: Amount = 2.0
    """and a third and a fourth."""
    hopeless: Amount = 0.4
    """Error of a rendering, radians rms, from which on the image is taken to show no code's attractor."""
    avoid_isometries: bool = True
    """Whether every other round keeps clear of near-isometries, if a code with one has failed."""
    unlike: Share = 0.95
    """F1 within 1 px below which the code of a picture that others drew is worth another round, and no rounding."""
    drawn_hopeless: Share = 0.7
    """F1 within 1 px below which such a picture shows no code, and no other round is worth its time."""
    isometry: Share = 0.95
    """Smaller singular value above which a map is a near-isometry,"""
    contraction: SingularValue = 0.9
    """and the largest one that such a round allows."""
    largest_side: Annotated[int, Field(ge=64)] = 512
    """Side in pixels of the image that is searched; a larger one is shrunk."""
    full_side: Annotated[int, Field(ge=64)] = 1024
    """Side in pixels, at most, of the image on which the code of a larger one is polished in the end; at least
    `largest_side`."""
    full_polish: Count = 4
    """Gauss-Newton steps on it."""
    search_share: Share = 0.35
    """Share of a limited time at which the restarts of the first round end,"""
    mixture_share: Share = 0.45
    """the search from their mixture,"""
    detail_share: Share = 0.65
    """stage 2,"""
    approach_share: Share = 0.75
    """the polish of a shrunk image,"""
    hopeless_share: Share = 0.75
    """the moves of stage 3 where the code is hopeless, so that time is left for growth,"""
    image_share: Share = 0.95
    """stage 3 and all later rounds,"""
    full_share: Share = 0.98
    """the polish at full size,"""
    canonical_share: Share = 0.99
    """and from which on the last digits are left as they are."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for first, second in (*pairwise(name for name in type(self).model_fields if name.endswith("_share")),
                              ("largest_side", "full_side")):
            low, high = getattr(self, first), getattr(self, second)
            if low > high:
                raise ParamError(second, f"{NAME} must be at least {first}, which is {low}; got {high}")
        return self


class CollageParams(Params):
    """All parameters of collage search."""

    maps: Annotated[int, Field(ge=2)] | None = None
    """Number of maps; null: found."""
    at_most: Annotated[int, Field(ge=2)] | None = None
    """Upper bound of the number of maps; null: no bound."""
    likeness: Annotated[float, Field(gt=0, le=1)] | None = None
    """F1 within a pixel that is to be reached, by as few maps of the curve as can be; null: as `growth` says."""
    bytes: Annotated[int, Field(ge=24)] | None = None
    """Bytes that the code may take, 12 for each map (six numbers of 16 bits); null: no bound."""
    rounds: Positive | None = None
    """Rounds at most; null: as `stages` says for the meaning of the grey levels."""
    levels: Literal["auto", "density", "linear", "dots", "coverage", "binary"] = "auto"
    """What grey levels mean: the share of subpixels that a chaos game hits, the number of its points in a pixel up to a
    factor, the ink of as many dots, the covered share of a pixel, or nothing (black and white). `auto` takes what our
    own renderer did not draw for coverage, and dots if these explain it better in the end."""
    search: SearchParams = SearchParams()
    population: PopulationParams = PopulationParams()
    births: BirthParams = BirthParams()
    descent: DescentParams = DescentParams()
    saturation: SaturationParams = SaturationParams()
    refine: RefineParams = RefineParams()
    camera: CameraParams = CameraParams()
    image: ImageParams = ImageParams()
    moves: MoveParams = MoveParams()
    lines: LineParams = LineParams()
    gauss_newton: GaussNewtonParams = GaussNewtonParams()
    frame: FrameParams = FrameParams()
    canonical: CanonicalParams = CanonicalParams()
    growth: GrowthParams = GrowthParams()
    stages: StageParams = StageParams()

    @model_validator(mode="after")
    def _one_number_of_maps(self) -> Self:
        given = [f"{name}={value}" for name in ("maps", "at_most", "likeness", "bytes")
                 if (value := getattr(self, name)) is not None]
        if len(given) > 1:
            raise ValueError("give one of the number of maps (maps), its upper bound (at_most or bytes) and the "
                             f"likeness to be reached, not two; got {' and '.join(given)}")
        return self

    @property
    def most_maps(self) -> int | None:
        """The upper bound of the number of maps, if there is one."""
        return self.bytes // BYTES_OF_A_MAP if self.bytes else self.at_most

    @property
    def grows_at_once(self) -> bool:
        """Whether so many maps are asked for that no search is worth while."""
        asked = self.maps or (self.bytes or 0) // BYTES_OF_A_MAP
        return self.growth.enabled and asked >= self.growth.at_once


def hydra_config() -> str:
    """conf/method/collage.yaml: `python -m fractal_exp.methods.collage.params > conf/method/collage.yaml`."""
    elsewhere = {"rounds": "${rounds}", "search.restarts": "${restarts}", "search.moves": "${moves}",
                 "search.detail_moves": "${detail_moves}", "moves.count": "${image_moves}"}
    return f"""# Collage search: the maps of a code, found one by one from the measure that the image shows.
# Made from fractal_exp/methods/collage/params.py, which states every parameter once; do not edit it here.
_target_: fractal_exp.methods.collage.method.Collage
_convert_: all
seconds: ${{seconds}}
seed: ${{seed}}
device: ${{device}}
previews: 10
{as_yaml(CollageParams(), elsewhere)}
"""


if __name__ == "__main__":
    print(hydra_config(), end="")
