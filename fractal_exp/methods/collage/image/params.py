"""The parameters of the search on the image itself."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from ....ops.collage.reference import MAX_STEPS
from ....runtime.params import Amount, Count, Odds, Params, Positive, Share
from ..fields import DescentSteps, Factor, Grid, PositiveShare, SingularValue, Sizes, Some, descent, odd, power_of_two


class RefineParams(Params):
    """Descent of all maps on ever finer grids, at the start of stage 3."""

    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)] = 120
    """Steps on each grid; 0: none."""
    coarsest: Annotated[int, Field(ge=128, le=1024), AfterValidator(power_of_two)] = 128
    """Cells a side of the first grid; each next one has twice as many."""
    finest: Annotated[int, Field(ge=64, le=4096)] = 256
    """Cells a side of the last grid at most."""
    grids: Annotated[int, Field(ge=1, le=8)] = 4
    """Grids that each error compares, each half as fine as the one before."""
    rate: Amount = 0.002
    """Learning rate on the first grid, canvas units. Each next one takes half of it."""
    largest: SingularValue = 0.9995
    """Largest singular value that a map may have."""


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
    rough: DescentSteps = descent(40, 0.02, 0.98)
    """All candidates, on the coarse grid."""
    fine: DescentSteps = descent(20, 0.005, 0.98)
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
    finer: Annotated[int, Field(ge=1), AfterValidator(odd)] = 9
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
    window: Annotated[int, Field(ge=1), AfterValidator(odd)] = 3
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
