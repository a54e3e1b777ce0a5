"""Dimensions of codes, of their measures and of pictures, and the lacunarity of pictures."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..ifs.code import IFS  # at run time, codes ask for this module


@dataclass(frozen=True)
class Dimension:
    """A fractal dimension.

    kind: "similarity", "affinity", "information" or "correlation", see `dimension`, or "boxes", see
    `samples.count_boxes`. value: the number. low, high: where it lies; bounds of a computation, about 95% of an
    estimate. standing: "exact" if it is the dimension of the set or measure, "upper bound" if that may be less,
    "estimate" if it comes from points or pixels. condition: why it stands so, in words.
    """

    kind: str
    value: float
    low: float
    high: float
    standing: str
    condition: str

    def __str__(self) -> str:
        """Such as "1.5850, exact", "1.71 [1.68, 1.74], estimate" or "at most 2, pieces overlap (3.8 by formula)"."""
        wide = self.high - self.low > 1e-3
        number = f"{self.value:.2f} [{self.low:.2f}, {self.high:.2f}]" if wide else f"{self.value:.4f}"
        if self.standing == "upper bound" and self.low > 2:
            return f"at most 2, pieces overlap ({self.value:.3g} by formula)"
        return f"{number}, {self.standing}"


def dimension(code: IFS, kind: str | None = None, *, seed: int = 0) -> Dimension:
    """The fractal dimension of a code's attractor or measure, by formula where there is one.

    kind: of the attractor, "similarity" (Moran 1946), the s with sum r_i^s = 1 for similarities of ratios r_i, or
    "affinity" (Falconer 1988), the same by singular values of words, which is at least the box dimension; None is the
    former where all maps are similarities, else the latter. Of the measure, "information" or "correlation": by formula
    for similarities whose pieces do not overlap, else from 400 000 points of this seed, in some seconds. Maps of
    probability 0 do not count. Above 2, a value tells that pieces overlap; the attractor has at most 2. Raises
    `InputError` if the code is not contractive, if it contracts on average only and the dimension is not that of its
    measure, on an unknown kind, or on "similarity" of other maps.
    """
    from .formulas import of_code  # SciPy and numba, where they are needed

    return of_code(code, kind, seed)
