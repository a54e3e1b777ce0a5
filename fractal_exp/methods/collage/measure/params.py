"""The parameters of the search on the image's measure, and of what grey levels mean."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from ....runtime.params import Amount, Count, Params, Positive, Share
from ..fields import DescentSteps, Factor, Grid, PositiveShare, Sizes, Some, ascending, descent, odd


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
    start: DescentSteps = descent(150, 0.03, 0.97)
    """The random sets of a restart."""
    mix: DescentSteps = descent(150, 0.015)
    """A mixture."""
    resume: DescentSteps = descent(100, 0.004)
    """A set found by an earlier stage."""
    neighbour: DescentSteps = descent(50, 0.01)
    """The neighbours of a move."""
    accept: DescentSteps = descent(50, 0.004)
    """The neighbour that is accepted."""
    prune: DescentSteps = descent(25, 0.006)
    """A set without one of its maps."""
    merge: DescentSteps = descent(50, 0.006)
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
    descent: DescentSteps = descent(80, 0.03, 0.95)
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
    coarse: DescentSteps = descent(40, 0.04, 0.98)
    """All candidates, on the coarse grid."""
    fine: DescentSteps = descent(15, 0.01, 0.98)
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
    window: Annotated[int, Field(ge=1), AfterValidator(odd)] = 3
    """Pixels a side of the window over which all masses are averaged first."""


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
    stroke: Amount = 0.06
    """A map draws a stroke if its image is no wider, canvas units."""
    twigs_px: Annotated[tuple[Factor, Factor], AfterValidator(ascending)] = (0.4, 24.0)
    """Lengths of the last strokes of a recursion that are tried, the least and the greatest,"""
    deepest: Positive = 24
    """and how many maps copy a stroke at most."""
    stroked: PositiveShare = 0.9
    """Strokes explain a picture if the error is below this share of that of a pen that draws the attractor,"""
    depths: Positive = 3
    """after the code was polished at so many depths, the likeliest;"""
    plausible: PositiveShare = 0.7
    """a depth is polished with further if the least error is above this share of its own."""
    dotted: Share = 0.75
    """Dots explain a picture if their angle of error is below this share of that of a pen."""
    turns: Positive = 3
    """Times, at most, that a code is polished by its renderings and its camera estimated anew,"""
    sharpened_steps: Positive = 8
    """with so many Gauss-Newton steps each time,"""
    sharpened_maps: Count = 12
    """if the code has no more maps,"""
    sharpened_side: Positive = 512
    """and the image no more pixels a side."""
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
