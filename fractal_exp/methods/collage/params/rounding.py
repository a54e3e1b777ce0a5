"""The parameters of rounding."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ....runtime.params import Amount, Count, Params, Positive, Share
from .fields import Factor, Some

Nudge = Annotated[float, Field(gt=-0.5, lt=0.5)]


class RoundingParams(Params):
    """Rounding of a code that is nearly found: simple numbers, symmetry, the exact frame."""

    enabled: bool = True
    """Whether this stage runs."""
    near_error: Amount = 0.5
    """Error up to which this stage runs even if the noise ratio is above `frame.far`."""
    fill: bool = True
    """Whether the frame is filled exactly."""
    matrices: bool = True
    """Whether matrices near simple ones are rounded to them."""
    axis_lines: bool = True
    """Whether maps that nearly are lines along an axis become such lines."""
    symmetric: bool = True
    """Whether nearly mirror-symmetric offsets are made exactly so."""
    worse: Amount = 1.02
    """Factor on the least error so far up to which simple numbers are kept."""
    line_worse: Amount = 1.0
    """The same factor for lines along an axis."""
    symmetric_worse: Amount = 1.05
    """Factor on the error up to which symmetric offsets are kept."""
    filled_worse: Amount = 1.2
    """Factor on the error up to which the exact frame is kept."""
    near_px: Amount = 0.05
    """Displacement (rms over the attractor, pixels) within which a matrix is near a simple one."""
    denominators: Annotated[tuple[Positive, ...], Some] = (*range(1, 13), 100)
    """Denominators of the proper fractions that count as simple entries of a matrix. These fractions and their
    square roots are also the simple ratios of a similarity."""
    ratios: tuple[Annotated[float, Field(gt=0, lt=1)], ...] = (((5**0.5 - 1) / 2) ** 2,)
    """Further simple ratios: the squared inverse of the golden ratio."""
    degrees: Annotated[tuple[Positive, ...], Some] = (15, 18)
    """A simple similarity rotates by a multiple of one of these angles, degrees."""
    symmetries: bool = True
    """Whether maps may be preceded by a symmetry of the shape, in a picture that others drew."""
    symmetry_orders: tuple[Annotated[int, Field(ge=2)], ...] = tuple(range(2, 9))
    """Orders of the rotations that are tried as symmetries of the shape."""
    symmetry_axes_degrees: Annotated[float, Field(gt=0, le=180)] = 7.5
    """Angle between the axes of the reflections that are tried as symmetries of the shape."""
    turn_tolerance: Factor = 1e-3
    """Angle, radians, within which two maps count as rotating by the same angle. A simple code has maps that rotate
    little."""
    symmetric_level: Share = 0.25
    """Grey level above which a pixel belongs to the shape whose symmetries are sought."""
    symmetric_likeness: Share = 0.93
    """Minimum F1 within 1 px between a shape and its image under a symmetry."""
    drawn_near_px: Amount = 0.25
    """`near_px` in a picture that others drew."""
    drawn_worse: Amount = 1.5
    """`worse` and `symmetric_worse` in such a picture; the limit also holds for codes with fewer or simpler maps."""
    drawn_noise: Amount = 0.06
    """Error of a rendering, radians rms, that counts as noise in such a picture: a code with fewer or simpler maps may
    have up to `drawn_worse` times the error of this angle, even if the code so far has less."""
    drawn_denominators: Annotated[tuple[Positive, ...], Some] = tuple(range(1, 7))
    """`denominators` in such a picture."""
    least_side: Positive = 256
    """Side, pixels. In a smaller image, `near_px` counts in pixels of an image of this side."""
    line_px: Amount = 1.0
    """Maximum standard deviation, pixels, across an image that may be a line along an axis."""
    line_thin: Amount = 0.1
    """Maximum ratio of that standard deviation to the one along the image."""
    lines_tried: Positive = 3
    """Number of lines that are polished."""
    line_steps: Count = 3
    """Gauss-Newton steps of each line."""
    line_factors: Annotated[tuple[Factor, ...], Some] = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4)
    """Factors on the length of a line that are tried."""
    line_scales: Positive = 3
    """Number of simple scales of a line that are tried."""
    line_shifts: Positive = 9
    """Number of places along the line in which each scale is tried."""
    line_shift_px: Amount = 1.0
    """Maximum distance of these places from the line's own, pixels."""
    polish: Count = 8
    """Gauss-Newton steps of the entries that are not fixed."""
    symmetric_px: Amount = 0.1
    """Difference, pixels, up to which offsets are made the same."""
    off_middle: Annotated[float, Field(gt=0, lt=0.01)] = 1e-6
    """Distance from the middle of the canvas, canvas units, of offsets that would be zero. It chooses a side of the
    edge between two pixels."""
    framed_px: Amount = 0.5
    """Misfit, pixels, up to which a frame is meant to be filled."""
    exact_px: Factor = 0.002
    """`sigma_px` of a frame that is filled exactly."""
    nudges: Annotated[tuple[Nudge, ...], Some] = (0.0, 1e-6, -1e-6, 1e-5, -1e-5, 5e-5, -5e-5)
    """Relative changes of size that are tried, because a shape may end at edges of pixels."""
    points: Positive = 20_000
    """Points that estimate the mean and covariance of an attractor."""

    def of_drawn(self) -> RoundingParams:
        """The parameters for a picture that others drew, which determines a code less precisely."""
        return self.updated(near_px=self.drawn_near_px, worse=self.drawn_worse, symmetric_worse=self.drawn_worse,
                            denominators=self.drawn_denominators)
