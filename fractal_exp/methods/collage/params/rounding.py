"""The parameters of rounding."""

from __future__ import annotations

from ....runtime.params import Count, Params


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
