"""Dimensions of a code by formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from scipy.optimize import brentq

from ..errors import InputError, did_you_mean
from ..ifs.code import IFS
from . import Dimension
from .affinity import affinity
from .overlap import overlap
from .samples import RANGES, of_points

KINDS = "similarity", "affinity", *RANGES
ALIKE = 1e-5  # share up to which singular values, or directions, differ by rounding alone


def of_code(code: IFS, kind: str | None, seed: int) -> Dimension:
    """See `fractal_exp.dimension.dimension`."""
    if kind not in (None, *KINDS):
        raise InputError(f"kind must be one of {', '.join(KINDS)}, got {kind!r}{did_you_mean(str(kind), KINDS)}")
    code.check_contractive()
    chances = code.sampling_probabilities().cpu()
    code = IFS(code.linear.cpu()[chances > 0], code.offset.cpu()[chances > 0], chances[chances > 0])
    singular = np.linalg.svd(code.linear.double().numpy(), compute_uv=False)
    if (singular.prod(1) >= 1).any():
        raise InputError("a dimension needs maps that contract together, but one of these shrinks no areas; drop it")
    similar = bool((singular[:, 0] - singular[:, 1] <= ALIKE * singular[:, 0]).all())
    if kind == "similarity" and not similar:
        raise InputError('a "similarity" dimension needs maps that are similarities, but some stretch one direction '
                         'more than another; take kind="affinity"')
    ratios = singular.mean(1) if similar else singular[:, 0]
    if kind in RANGES:
        return _of_measure(code, kind, ratios, similar, seed)
    return replace(_similarity(code, ratios), kind=kind or "similarity") if similar else _affinity(code)


def _similarity(code: IFS, ratios: np.ndarray) -> Dimension:
    s, overlaps = _moran(np.ones(len(ratios)), ratios), _overlap(code, ratios)
    standing, why = "upper bound", "two words are one map but for rounding, so the attractor has less"
    if s > 2 + ALIKE:
        why = "the pieces overlap, and the attractor has at most 2"
    elif overlaps is None:
        why = "the attractor's, if the pieces do not overlap (open set condition), which remains open"
    elif not overlaps:
        standing, why = "exact", "the pieces do not overlap (open set condition)"
    return Dimension("similarity", s, s, s, standing, why)


def _affinity(code: IFS) -> Dimension:
    linear = code.linear.double().numpy()
    low, s, high = affinity(linear)
    why = "the attractor's if no pieces overlap and no directions are kept (Bárány, Hochman, Rapaport 2019)"
    if low > 2:
        why = "the pieces overlap, and the attractor has at most 2"
    elif _keep_a_direction(linear):
        why = "all maps keep a direction, where the attractor often has less (Bedford, McMullen)"
    return Dimension("affinity", s, low, high, "upper bound", why)


def _of_measure(code: IFS, kind: str, ratios: np.ndarray, similar: bool, seed: int) -> Dimension:
    if len(code) == 1 or not ratios.all():
        return Dimension(kind, 0.0, 0.0, 0.0, "exact", "a map shrinks all to a point, so the measure is one of points")
    if not similar or _overlap(code, ratios) is not False:
        return of_points(code, kind, seed)
    p = code.sampling_probabilities().double().numpy()
    p = p / p.sum()
    value = float(p @ np.log(p) / (p @ np.log(ratios))) if kind == "information" else _moran(p**2, 1 / ratios)
    return Dimension(kind, value, value, value, "exact", "the pieces do not overlap (open set condition)")


def _moran(weights: np.ndarray, ratios: np.ndarray) -> float:
    """The s >= 0 with sum_i w_i r_i^s = 1 over all r_i > 0, all below 1 or all above it; 0 for less than two."""
    weights, logs, top = weights[ratios > 0], np.log(ratios[ratios > 0]), 1.0
    if len(weights) < 2:
        return 0.0

    def excess(s: float) -> float:
        return float(np.log(weights @ np.exp(s * logs)))

    while excess(0) * excess(top) > 0:
        top *= 2
    return float(brentq(excess, 0.0, top, xtol=1e-12))


def _overlap(code: IFS, ratios: np.ndarray) -> bool | None:
    """`overlap` of the pieces that are no points."""
    solid = torch.from_numpy(ratios > 0)
    return overlap(IFS(code.linear[solid], code.offset[solid])) if solid.sum() > 1 else False


def _keep_a_direction(linear: np.ndarray) -> bool:
    """Whether all matrices (N,2,2) have an eigenvector in common."""
    values, vectors = np.linalg.eig(linear)
    x, y = np.moveaxis(vectors, 1, 2)[values.imag == 0].real.T
    image = linear @ np.stack([x, y])
    return bool((np.abs(image[:, 0] * y - image[:, 1] * x) <= ALIKE * np.abs(linear).max()).all(0).any())
