"""The parameters of the search on the image itself."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ....ops.collage.reference import MAX_STEPS
from ....runtime.params import Amount, Count, Odds, Params, Positive, Share
from .fields import Factor, Grid, SingularValue, Some


class RefineParams(Params):
    """Descent of all maps on ever finer grids, at the start of stage 3."""

    steps: Annotated[int, Field(ge=0, le=MAX_STEPS)] = 120
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
    unseen: Share | None = 0.002
    """Loss of likeness (F1 within a pixel) up to which maps are dropped from the code of a picture that others
    drew; null: none is dropped."""
    needless: Share | None = 5e-4
    """The same loss for maps that are removed while the others are polished together with the camera; null: none is
    removed, and contained maps stay as well."""
    parent_maps: Count = 8
    """Maximum number of maps of a code whose parents and contained maps are sought, in a picture that others drew. A
    parent is a map g of which the code only holds compositions g∘f. A contained map is such a g∘f beside g."""


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
    largest: SingularValue = 0.9995
    """Largest singular value that a map may have, rounded or not."""
    points_per_cell: Factor = 6.0
    """Points of the chaos game per cell of the finest grid, in a Jacobian from points."""


class FrameParams(Params):
    """The frame: the attractor's box is centred, and its longer side spans [-0.75, 0.75]."""

    enabled: bool = True
    """Whether codes are fitted into the frame."""
    firm: tuple[Factor, ...] = (100.0, 1000.0, 10000.0)
    """Factors on the frame's weight, one firm polish each, at the end of each round on a binary image whose code is not
    nearly right. The frame then says more about faint tips than the pixels do. Empty: no such polish."""
