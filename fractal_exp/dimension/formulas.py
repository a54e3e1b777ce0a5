"""Dimensions of a code by formula."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from ..errors import InputError
from ..ifs.code import IFS
from ..ifs.contraction import AVERAGE
from ..runtime.checks import check_choice
from . import Dimension
from .affinity import affinity
from .overlap import overlap
from .samples import MEASURES, of_points

KINDS = "similarity", "affinity", *MEASURES
ALIKE = 1e-5  # share up to which singular values, or directions, differ by rounding alone
APART = "the pieces do not overlap (open set condition)"
OPEN = "the attractor's, if the pieces do not overlap (open set condition), which remains open"
OVERLAPPING = "two words are one map but for rounding, so the attractor has less"
BEYOND = "the pieces overlap, and the attractor has at most 2"
KEPT = "all maps keep a direction, where the attractor often has less (Bedford, McMullen)"
MIXED = "the attractor's if no pieces overlap and no directions are kept (Bárány, Hochman, Rapaport 2019)"


def of_code(code: IFS, kind: str | None, seed: int) -> Dimension:
    """See `fractal_exp.dimension.dimension`."""
    if kind is not None:
        check_choice("kind", kind, KINDS)
    code.check_contractive()
    linear, chances = code.linear.cpu().double().numpy(), code.sampling_probabilities().cpu().double().numpy()
    singular = np.linalg.svd(linear, compute_uv=False)
    drawn, similar = chances > 0, singular[:, 0] - singular[:, 1] <= ALIKE * singular[:, 0]
    if code.contraction.kind == AVERAGE:
        if kind in MEASURES:
            return of_points(code, kind, seed)
        raise InputError("the code contracts on average only, so its attractor may have no end, and no dimension by "
                         'formula; kind="information" or "correlation" is one of its points')
    if kind == "similarity" and not similar[drawn].all():
        raise InputError('a "similarity" dimension needs maps that are similarities, but some stretch one direction '
                         'more than another; take kind="affinity"')
    solid = drawn & (singular[:, 0] > 0)  # the others are points
    if solid.sum() < 2 or (kind in MEASURES and (drawn & ~solid).any()):
        return Dimension(kind or "similarity", 0.0, 0.0, 0.0, "exact", "all that is drawn are points")
    if not similar[drawn].all():
        return of_points(code, kind, seed) if kind in MEASURES else _affinity(linear[solid])
    p, ratios = chances[solid] / chances[solid].sum(), singular[solid].mean(1)
    overlaps = overlap(IFS(code.linear.cpu()[solid], code.offset.cpu()[solid]))
    if kind in MEASURES and overlaps is not False:
        return of_points(code, kind, seed)
    if kind == "information":
        value = float(p @ np.log(p) / (p @ np.log(ratios)))
    else:
        value = _moran(p**2, 1 / ratios) if kind == "correlation" else _moran(np.ones(len(p)), ratios)
    if overlaps is False:
        standing, why = "exact", APART
    else:
        standing, why = "upper bound", BEYOND if value > 2 + ALIKE else OVERLAPPING if overlaps else OPEN
    return Dimension(kind or "similarity", value, value, value, standing, why)


def _affinity(linear: np.ndarray) -> Dimension:
    low, value, high = affinity(linear)
    why = BEYOND if low > 2 else KEPT if _keep_a_direction(linear) else MIXED
    return Dimension("affinity", value, low, high, "upper bound", why)


def _moran(weights: np.ndarray, ratios: np.ndarray) -> float:
    """The s >= 0 with sum_i w_i r_i^s = 1, of two ratios or more, all below 1 or all above it."""
    def excess(s: float) -> float:
        return float(np.log(weights @ ratios**s))

    top = 1.0
    while excess(0) * excess(top) > 0:
        top *= 2
    return float(brentq(excess, 0.0, top, xtol=1e-12))


def _keep_a_direction(linear: np.ndarray) -> bool:
    """Whether all matrices (N,2,2) have an eigenvector in common."""
    values, vectors = np.linalg.eig(linear)
    x, y = np.moveaxis(vectors, 1, 2)[values.imag == 0].real.T
    image = linear @ np.stack([x, y])
    return bool((np.abs(image[:, 0] * y - image[:, 1] * x) <= ALIKE * np.abs(linear).max()).all(0).any())
