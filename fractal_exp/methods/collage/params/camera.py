"""The parameters of the camera, which says how an image was rendered from a code."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from ....images.target_levels import TARGET_ROUNDING, TARGET_SUPERSAMPLE
from ....runtime.params import NAME, Amount, Count, ParamError, Params, Positive, Share, below, check_order
from .fields import Factor, PositiveShare, SingularValue, Some, ascending


class CameraParams(Params):
    """How the image is assumed to have been rendered from a code. The defaults describe the suite's targets."""

    supersample: Positive = TARGET_SUPERSAMPLE
    """Subpixels per side of a pixel of a density or a binary image (Section 5 of the paper)."""
    coverage_supersample: Positive = 4
    """Subpixels per side of a pixel of an anti-aliased image."""
    points_per_pixel: Annotated[float, Field(ge=0.1, allow_inf_nan=False)] = 50_000_000 / 1024**2
    """Points of the chaos game per pixel of the canvas (Section 5 of the paper)."""
    threshold: Annotated[float, Field(ge=0, lt=1)] = 0.25
    """Share of lit subpixels above which a pixel of a binary image is white."""
    reuse: Positive = 8
    """Number of words under which a rendering that judges a code draws each point of the invariant measure."""
    linear_points: Annotated[float, Field(ge=0.1, allow_inf_nan=False)] = 12.0
    """Minimum number of points per pixel in a rendering that judges a code by a linear image."""
    deblur_steps: Count = 10
    """Steps of Richardson (1972) and Lucy (1974) that sharpen a blurred image before the search."""
    rounding: Amount = TARGET_ROUNDING
    """Maximum deviation from a whole number of subpixels for a grey level of our own renderer: 16 bits round by up to
    0.002."""
    unlit: Annotated[float, Field(gt=0, lt=1)] = 0.5
    """Minimum number of unlit subpixels in a pixel of a density. A white pixel would have an infinite mass."""
    least_variance: Factor = 1e-4
    """Lower limit of I (1 - I) in the slope of the arcsine by which images are compared."""
    trajectory: Annotated[int, Field(ge=2)] = 430
    """Points of each trajectory of the chaos game that draws a linear image or estimates an attractor's measure,
    including those of the warm-up."""
    warmup: Count = 30
    """Points at the start of each trajectory that are dropped; fewer than `trajectory`."""
    blur_reach: Annotated[float, Field(gt=0, le=10)] = 4.0
    """Standard deviations at which a Gaussian blur ends, as in SciPy."""
    least_blur_px: Factor = 0.2
    """Standard deviation, pixels, below which a blur is left out, because it would hardly reach the next pixel."""
    coarse_blur_px: Annotated[float, Field(gt=0, le=8)] = 1.0
    """Blur, pixels, below which a linear image is drawn with smaller pixels, in which the blur is at least as wide."""

    estimate: bool = True
    """Whether the camera of a picture that others drew is estimated; false: such a picture counts as a plain rendering,
    without a pen, tiles, dots, strokes or a blur."""
    pen_px: Amount | None = None
    """Radius of the pen that drew lines and areas, pixels of the image; null: estimated."""
    blur_px: Amount | None = None
    """Standard deviation of the blur, pixels of the image; null: estimated, or no blur for a linear image."""
    tiles_px: tuple[Factor, ...] = (32.0, 22.0, 16.0, 11.0, 8.0, 5.6, 4.0)
    """Sizes, pixels, that are tried for the smallest parts of a construction (tiles); empty: only the attractor."""
    tile_words: Positive = 6000
    """Maximum number of words under which a tile is drawn."""
    tile_words_seen: Positive = 800
    """Maximum number of words that show the shape of a tile; at most `tile_words`."""
    tile_side: Factor = 1.13
    """Side of the grid on which the shape of a tile is estimated, relative to the frame's."""
    tile_cells: Annotated[tuple[Positive, Positive], AfterValidator(ascending)] = (12, 160)
    """Minimum and maximum number of cells per side of this grid. Between them, it has a cell for each subpixel."""
    tile_lit: Share = 0.5
    """Share of the highest level on this grid above which a cell belongs to a tile."""
    tile_usual: Share = 0.65
    """Quantile of the levels of these cells that tells a thin grey line from a white area."""
    beside_px: Amount = 1.5
    """Distance between the centres of two pixels, pixels, below which an attractor's pixel counts as beside one of the
    shape. All eight neighbours are nearer."""
    small_tile_px: Amount = 8.0
    """Tile size, pixels, up to which an attractor may lie off the shape by half a tile. For larger tiles, the limit
    is half of this size, except for a code of at most `tiled_maps` maps."""
    tiled_maps: Annotated[int, Field(ge=2)] = 2
    """Maximum number of maps of a code whose attractor may lie off the shape by half of any tile: so few maps do not
    draw a picture by chance."""
    tiled: PositiveShare = 0.7
    """In stage 3, tiles are taken if their angle of error is below this factor times the angle of a pen."""
    strokes: bool = True
    """Whether strokes are tried: the drawing of a recursion that ended, as of a tree."""
    stroke: Amount = 0.06
    """Maximum width, canvas units, of the image of a map that draws a stroke."""
    trunk_strokes: Count = 4
    """Maximum number of strokes that take the place of a code's flat maps, where its other maps leave them over; 0: the
    flat maps stay."""
    trunk_beside_px: Amount = 2.5
    """Maximum distance, pixels, from the images of the shape at which a lit pixel counts as drawn by them."""
    trunk_least_px: Factor = 8.0
    """Minimum length, pixels, of such a stroke."""
    trunk_line_px: Amount = 1.0
    """Maximum distance, pixels, at which a pixel counts as beside a line."""
    trunk_gap_px: Factor = 4.0
    """Longest gap, pixels, in such a stroke."""
    trunk_trials: Positive = 200
    """Number of lines that are tried for each stroke."""
    twigs_px: Annotated[tuple[Factor, Factor], AfterValidator(ascending)] = (0.4, 24.0)
    """Minimum and maximum length, pixels, of the last strokes of a recursion that are tried."""
    deepest: Positive = 24
    """Maximum depth that is tried: how many maps copy a stroke."""
    most_strokes: Positive = 40_000
    """Maximum number of strokes that are copied by equally many maps. Drawings with more are not tried."""
    stroked: PositiveShare = 0.9
    """Strokes are taken if their error is below this factor times that of the best pen or tiles."""
    likeliest: Positive = 3
    """Number of cameras of each kind, the likeliest ones, with which the code is polished first: the best pen and tile
    sizes, or pairs of depth and thinning of strokes."""
    plausible: PositiveShare = 0.7
    """Only cameras whose error is at most the least error divided by this are polished further."""
    recursion_below: Share = 0.985
    """A construction is sought if the likeness of the code of stage 2 is below this, or if that code has more maps than
    any search for one allows; for a code seen as dots, if its likeness is below `StageParams.unlike`. Another one is
    sought while the likeness of a drawing by strokes is below this."""
    recursion_maps: tuple[Annotated[int, Field(ge=2)], ...] = (4, 3, 2)
    """Maximum number of maps in each search for the branches of a tree; empty: no such search. The first one comes
    before those for tiles."""
    recursion_blurs_px: tuple[Amount, ...] = (3.0, 6.0)
    """Blurs of the measure, pixels, in searches for few maps (`tiled_maps`), whose codes are then seen as tiles; empty:
    no such search."""
    registered_strokes: Positive = 4000
    """Maximum number of strokes in the last generation of a drawing that is registered with the picture."""
    registered_points: Positive = 20_000
    """Number of points on these strokes, besides one for each, from which on they are farther apart than a pixel."""
    registered_kept: Positive = 2
    """Number of registered codes, those at the likeliest depths, that are then seen as strokes."""
    registration_steps: Positive = 60
    """Maximum number of steps of a registration."""
    registration_little: Share = 0.001
    """A registration ends if a step lowers the cost by less than this share."""
    registration_along: PositiveShare = 0.1
    """Weight of squared distances along a stroke in a registration, relative to those across it."""
    registration_px: Factor = 4.0
    """Distance, pixels, up to which a point always counts in a registration."""
    coarse_side: Annotated[int, Field(ge=32)] = 128
    """Maximum side, pixels, of the image on which strokes are polished first."""
    recursion_gain: Share = 0.3
    """Strokes are polished on the whole image if, on the small one, their squared angle of error is at most this share
    of that of the maps that were found, as the camera of stage 2 sees them."""
    recursion_alike: Share = 0.9
    """Minimum F1 within a pixel of a drawing by strokes that is taken."""
    recursion_contraction: SingularValue = 0.75
    """Limit on smaller singular values in such a search. A mirrored copy of the whole tree would replace a branch."""
    dotted: Share = 0.75
    """Dots are taken if their angle of error is below this factor times the pen's, and a tone curve if its angle is
    below this factor times that of the better of both."""
    turns: Positive = 3
    """Maximum number of times that a code is polished by its renderings and its camera is estimated again."""
    sharpened_steps: Positive = 8
    """Gauss-Newton steps each time."""
    sharpened_maps: Count = 12
    """Maximum number of maps of a code that is polished like this."""
    sharpened_side: Positive = 512
    """Maximum side, pixels, of an image whose code is polished like this."""
    gain: Factor | None = None
    """How fast ink covers the paper, per dot density relative to a uniform one on the canvas; null: estimated."""
    curved_from: Factor = 2.0
    """A tone curve is tried if the angle of error of dots is at most this factor times the pen's."""
    grey_inside: Share = 0.5
    """If more than this share of the lit pixels is grey although all neighbours are lit, the image is also searched as
    a density behind a tone curve; 1: never."""
    faint: Share = 0.05
    """Grey level up to which a pixel of such an image counts as black. A pixel equally close to white does not count as
    grey. If the camera is dots or a tone curve, every brighter pixel belongs to the shape."""
    gamma: Factor | None = None
    """Gamma of the tone curve of a density (`levels=tonemapped`); null: estimated."""
    usual_gamma: Factor = 2.2
    """Gamma with which such an image is searched before the estimate, as of sRGB."""
    gammas: Annotated[tuple[Factor, ...], Some] = (1.5, 2.2, 3.0, 4.0, 6.0)
    """Gammas that are tried."""
    histogram_levels: Annotated[int, Field(ge=16)] = 4096
    """Grey levels by which the histograms of image and rendering are compared."""
    curved_blurs_px: Annotated[tuple[Amount, ...], Some] = (0.0, 0.35, 0.7)
    """Blurs that are tried under a tone curve."""
    pens_px: Annotated[tuple[Amount, ...], Some] = (0.1, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0)
    """Pen radii that are tried."""
    blurs_px: Annotated[tuple[Amount, ...], Some] = (0.0, 0.2, 0.35, 0.5, 0.7, 1.0)
    """Blurs that are tried."""
    stroke_blurs_px: Annotated[tuple[Amount, ...], Some] = (0.35, 0.7)
    """Blurs that are tried for strokes. From less blur, a polish does not find a larger one."""
    gains: Annotated[tuple[Factor, ...], Some] = tuple(0.01 * 2**(k / 2) for k in range(18))
    """Gains that are tried."""
    pen_supersample: Positive = 3
    """Subpixels per side of a pixel where a pen draws."""
    dot_supersample: Positive = 2
    """Subpixels per side of a pixel where dots are blurred."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_order(self, ("tile_words_seen", "tile_words"))
        below(self, "warmup", "trajectory")
        for name in ("pen_px", "gain", "gamma"):
            if not self.estimate and getattr(self, name) is not None:
                raise ParamError(name, f"{NAME} must be null if estimate is false, got {getattr(self, name)}")
        return self
