"""The parameters of a code's last digits."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from ....runtime.params import Amount, Count, Params, Positive, Share
from ..fields import Factor, Some

Nudge = Annotated[float, Field(gt=-0.5, lt=0.5)]


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
    drawn_near_px: Amount = 0.25
    """The same displacement in a picture that others drew,"""
    drawn_worse: Amount = 1.5
    """the factor on the error there,"""
    drawn_denominators: Annotated[tuple[Positive, ...], Some] = tuple(range(1, 7))
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
