"""The parameters of the search on the image itself."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from ....ops.collage.reference import MAX_STEPS
from ....runtime.params import Amount, Count, Odds, Params, Positive, Share, check_order
from .fields import DescentSteps, Factor, Grid, PositiveShare, SingularValue, Sizes, Some, descent, odd, power_of_two


class RefineParams(Params):
    """Descent of all maps on ever finer grids, at the start of stage 3."""

    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)] = 120
    """Steps on each grid; 0: none."""
    coarsest: Annotated[int, Field(ge=128, le=1024), AfterValidator(power_of_two)] = 128
    """Cells per side of the first grid. Each further grid has twice as many."""
    finest: Annotated[int, Field(ge=128, le=4096)] = 256
    """Maximum number of cells per side of the last grid."""
    grids: Annotated[int, Field(ge=1, le=8)] = 4
    """Number of grids that each error compares, each half as fine as the one before."""
    rate: Amount = 0.002
    """Learning rate on the first grid, canvas units. It is halved on each further grid."""
    largest: SingularValue = 0.9995
    """Largest singular value that a map may have."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        check_order(self, ("coarsest", "finest"))
        return self


class ImageParams(Params):
    """The error of a code's rendering against the image: the objective of stage 3."""

    grids: Positive = 4
    """Number of grids compared, each half as fine as the one before."""
    finest: Annotated[int, Field(ge=8)] = 512
    """Maximum number of cells per side of the finest grid, which otherwise is the image's pixels."""
    halved_from: Annotated[int, Field(ge=2)] = 8
    """Minimum number of cells per side of a grid for a coarser one to follow."""
    least_noise: Factor = 1e-3
    """Lower limit of the estimated noise of a rendering."""
    noise_renderings: Positive = 4
    """Number of renderings that estimate the noise of a linear image, which has few independent parts under a blur."""
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
    drawn_least: Count = 8
    """Moves after which the code of such a picture may be settled."""
    alike: Share = 0.985
    """F1 within 1 px from which the code of such a picture is settled, and at which two maps explain it by tiles."""
    longest: Annotated[int, Field(ge=1)] = 3
    """Maximum number of moves as a multiple of `count`, while the error keeps being halved."""
    recent: Share = 2 / 3
    """The search goes on if the error has been halved within this share of `count` moves."""
    price: Amount = 0.04
    """Cost of a map, in units of the noise of a rendering."""
    pruning: bool = True
    """Whether maps that are not worth their price are removed, from stage 3 on."""
    cleaning: bool = True
    """Whether all maps are pruned and polished in place of the last move asked for, and from then on whenever `recent`
    more have been made."""
    worth: Amount = 0.1
    """Share of the error that a map must save in a binary image or a picture that others drew."""
    missing: Amount = 1e3
    """Cost of each map fewer than `maps` asks for."""
    candidates: Positive = 24
    """Candidates per birth."""
    kept: Positive = 6
    """Candidates that also descend on the fine grid."""
    rendered: Positive = 3
    """Candidates that are rendered."""
    grid: Grid = 128
    """Cells per side of the fine grid of the image's measure. The coarse grid has half as many."""
    widths: Annotated[tuple[Factor, ...], Some] = (1.0, 0.25, 0.03)
    """Factors on the width of a new map's image that are rendered. The last one is for a reoriented line."""
    mirrored: bool = True
    """Whether a new map is also rendered mirrored in the axes of its image."""
    thin: Amount = 0.1
    """Ratio of width to length below which a map's image is a line."""
    least_width: Factor = 1e-3
    """Standard deviation, canvas units, whose square is added to the covariance of the image of a map to reorient."""
    sizes: Sizes = (0.02, 0.95)
    """Range of the larger singular value at birth."""
    blobs: Share = 0.5
    """Share of the candidates that take the shape of the uncovered blob; the others are random."""
    largest: SingularValue = 0.97
    """Upper limit of the singular values of a reoriented map."""
    visible_shares: Annotated[tuple[PositiveShare, ...], Some] = (1.0, 0.5, 0.25, 0.1, 0.04, 0.015, 0.006)
    """Shares of the weight due to a map's volume that are tried; the best is taken. Thin images show little of it."""
    rough: DescentSteps = descent(40, 0.02, 0.98)
    """Descent of all candidates on the coarse grid."""
    fine: DescentSteps = descent(20, 0.005, 0.98)
    """Descent of the kept candidates on the fine grid."""
    remove_most: Positive = 3
    """Maximum number of maps that one move removes."""
    promising: Amount = 1.25
    """A new map is polished if the error is at most this factor times the one before."""
    hopeful: Amount = 4.0
    """After a removal or a root, or for a line in another projection, maps are polished if the error is below this
    factor times the one before."""
    polish_new: Count = 2
    """Gauss-Newton steps of a new map."""
    polish_rest: Count = 4
    """Gauss-Newton steps of all maps after a removal or a root."""
    polish_accepted: Count = 1
    """Gauss-Newton steps of all maps after an accepted move."""
    polish_ends: Count = 8
    """Gauss-Newton steps of all maps at each pruning and at the end of the stage."""
    polish_starts: Count = 4
    """Gauss-Newton steps of all maps at the start of the stage."""
    settled: Amount = 1.05
    """Noise ratio below which a code counts as the true one."""
    settled_more: Amount = 0.005
    """Rise of that limit with each move."""
    own_weights: Amount = 0.8
    """A code keeps free probabilities if its error is below this factor times the error with tied ones; 0: they are
    always tied."""
    drawn_own_weights: Amount = 1.0
    """The same factor in a picture that others drew, and for linear grey levels, unless `own_weights` is 0."""
    root_error: Amount = 30.0
    """A root is tried if its error is at most this factor times the error before, or times `root_least`."""
    root_least: Amount = 0.5
    """Lower limit of the error before in this test."""
    root_maps: Positive = 10
    """Maximum number of maps of a hopeless code whose roots are tried."""
    root_orders: Annotated[tuple[Annotated[int, Field(ge=2)], ...], Some] = (2, 3)
    """Orders of roots that are tried."""
    double_px: Amount = 2.0
    """Distance of two maps (rms, pixels) below which they count as one in a picture that others drew."""
    unseen: Share | None = 0.002
    """Loss of likeness (F1 within a pixel) up to which maps are dropped from the code of a picture that others
    drew; null: none is dropped."""
    needless: Share | None = 5e-4
    """The same loss for maps that are removed while the others are polished together with the camera; null: none is
    removed, and contained maps stay as well."""
    needless_tried: Count = 2
    """Number of single maps that are left out on trial in such a polish, besides the contained ones."""
    flat_px: Amount = 0.75
    """Standard deviation across a line, pixels, below which a shape is assumed to lie on the line."""
    parent_maps: Count = 8
    """Maximum number of maps of a code whose parents and contained maps are sought, in a picture that others drew. A
    parent is a map g of which the code only holds compositions g∘f. A contained map is such a g∘f beside g."""
    parent_tried: Count = 6
    """Maximum number of parents that are tried."""
    parent_inside: Share = 0.97
    """Minimum share of the attractor's points that a parent must send to lit pixels, and that a contained map sends to
    the image of a larger map."""
    parent_points: Positive = 20_000
    """Number of points in this test."""
    root_all: Count = 5
    """Maximum number of maps of a code all of whose roots are tried at the start, in a picture that others drew."""
    root_largest: Count = 2
    """For other codes, number of largest maps whose roots are tried at the start of the stage."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        check_order(self, ("kept", "candidates"), ("rendered", "kept"))
        return self


class LineParams(Params):
    """Maps whose images are lines. The light along a line determines the map's projection."""

    enabled: bool = True
    """Whether such maps are sought."""
    count: Positive = 2
    """Maximum number of projections that are rendered."""
    polish: Count = 3
    """Gauss-Newton steps of each projection."""
    points: Positive = 50_000
    """Points of the attractor that are projected."""
    widest_px: Amount = 2.0
    """Maximum width of a line, pixels, taken as four standard deviations."""
    directions: Annotated[int, Field(ge=3)] = 48
    """Directions of projection that are tried."""
    ends: Annotated[int, Field(ge=2)] = 24
    """Number of places that are tried for each end of a line."""
    reach: Amount = 0.5
    """How far these places extend beyond the line's own ends, as a share of its length."""
    finer: Annotated[int, Field(ge=1), AfterValidator(odd)] = 9
    """Number of angles, and of places for each end, that are tried between the neighbours of the best."""
    shortest: Annotated[float, Field(ge=0, lt=1)] = 0.2
    """Minimum length that is tried, as a share of the line's own."""
    bins: Positive = 256
    """Bins of a projected measure."""
    aside_px: Count = 1
    """Pixels on each side of a line that may show its light."""
    largest: SingularValue = 0.98
    """Upper limit of the larger singular value of such a map."""


class GaussNewtonParams(Params):
    """Levenberg-Marquardt steps (Marquardt 1963) on the error of the rendering."""

    enabled: bool = True
    """Whether maps are polished at all."""
    rendered_steps: Count = 3
    """Steps with a Jacobian from renderings, if more than noise is left; 0: none."""
    rendered_above: Amount = 1.1
    """Noise ratio above which these steps are made."""
    rendered_below: Amount = 6.0
    """Noise ratio below which these steps are made."""
    damping: Amount = 1e-2
    """Damping of the first step, relative to the diagonal of the normal equations."""
    least_damping: Amount = 1e-4
    """Lower limit of the damping."""
    damping_down: Annotated[float, Field(ge=1)] = 5.0
    """Factor by which damping is divided after a step that lowers the error."""
    damping_up: Annotated[float, Field(ge=1)] = 30.0
    """Factor by which damping is multiplied after a step that does not."""
    one_by_one: bool = True
    """Whether each parameter is tried by itself if a map that moves alone finds no step, and in the last polish by
    renderings."""
    tries: Positive = 2
    """Number of dampings tried in a step."""
    strides: Annotated[tuple[Factor, ...], Some] = (1.0, 2.0, 4.0, 8.0)
    """Multiples of a step that are tried while the error falls."""
    little: Amount = 0.005
    """Relative gain below which a step counts as without gain."""
    patience: Positive = 1
    """Steps without gain, in a row, after which a polish ends."""
    last_patience: Positive = 2
    """The same number for the last polish of a stage."""
    longest_px: Factor = 2.0
    """Maximum step of a parameter, pixels of displacement."""
    largest: SingularValue = 0.9995
    """Largest singular value that a map may have, with or without simple numbers."""
    points_per_cell: Factor = 6.0
    """Points of the chaos game per cell of the finest grid, in a Jacobian from points."""
    least_spread: Factor = 1e-3
    """Lower limit, canvas units, of the attractor's standard deviation, in which steps of a matrix are measured."""
    log_step: Factor = 0.1
    """Step in the logarithm of a probability, a gain or a gamma that counts as much as a pixel. Probabilities move if
    grey levels are linear."""
    least_weight: PositiveShare = 1e-3
    """Lower limit of a probability that moves, as a share of the largest."""
    letters: Positive = 8
    """Number of terms of the series of a probability's effect that are summed."""
    margin: Share = 1 / 8
    """How far the grid of a linear image extends beyond each edge of the canvas, as a share of the canvas's side,
    because points there are blurred into the image."""
    window: Annotated[int, Field(ge=1), AfterValidator(odd)] = 3
    """Cells per side of the window in which grey levels are related to masses, in a Jacobian from points."""
    step_px: Factor = 0.05
    """Finite difference of a parameter, pixels, in a Jacobian from points."""
    stroke_effect: Share = 1e-3
    """Where strokes are drawn, a parameter stays if the sum of its squared derivatives is below this share of the
    largest such sum. The width of a stroke has no effect until the map is no longer flat."""
    nudge_px: Factor = 0.05
    """Finite difference of a parameter, pixels, in a Jacobian from renderings."""
    binary_nudge_px: Factor = 0.3
    """The same for a binary image, which changes by whole pixels."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        check_order(self, ("rendered_above", "rendered_below"))
        return self


class FrameParams(Params):
    """The frame: the attractor's box is centred, and its longer side spans [-0.75, 0.75]."""

    enabled: bool = True
    """Whether codes are fitted into the frame."""
    shortest: Amount = 0.93
    """Minimum span of the lit pixels, relative to the frame's side, for an image to fill its frame."""
    binary_shortest: Amount = 0.55
    """The same for the firm polishes of a binary image, which does not show faint tips."""
    longest: Amount = 1.17
    """Maximum span. The lit pixels may also lie off the canvas's centre by as much as they may be too long."""
    sigma_px: Factor = 0.05
    """Misfit, pixels, that counts as much as the counting error of one pixel."""
    beyond_px: Factor = 1.0
    """Misfit, pixels, above which the loss is linear (Huber 1964)."""
    far: Amount = 30.0
    """Noise ratio from which the frame is ignored, except by the firm polish, and codes are not rounded."""
    worse: Amount = 1.05
    """Factor on the error up to which a code fitted into the frame is kept."""
    firm: tuple[Factor, ...] = (100.0, 1000.0, 10000.0)
    """Factors on the frame's weight, one firm polish each, at the end of each round on a binary image whose code is not
    nearly right. The frame then says more about faint tips than the pixels do. Empty: no such polish."""
    firm_above: Amount = 1.2
    """Noise ratio above which a code counts as not nearly right."""
    firm_only: Amount = 2.0
    """Noise ratio above which a round ends with firm polishes alone, if the code exceeds it before and after them."""
    firm_worse: Amount = 2.0
    """Factor on the error before the firm polishes up to which one is kept."""
    firm_steps: Count = 6
    """Gauss-Newton steps of each firm polish."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        check_order(self, ("binary_shortest", "shortest"), ("shortest", "longest"), ("firm_above", "firm_only"))
        return self
