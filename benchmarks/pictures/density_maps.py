"""Density maps of four affine maps, by the law of the published test set.

Yamaguti, Amortized Set Prediction for Inverse IFS Reconstruction from Density Maps (2026). A code is four rows
(φ1, φ2, sx, sy, tx, ty): f(x) = R(φ1) diag(sx, sy) R(φ2) x + t. The published set's 256 codes and densities are read
from a file with `params` (C,4,6) and `density` (C,128,128), named by --density-maps or FRACTAL_EXP_DENSITY_MAPS.
Without it the codes are drawn here, by the law that the published ones follow: angles from all around, singular values
from [0.2, 0.7], and fixed points from [-0.75, 0.75]².
"""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path

import numpy as np
import torch

from fractal_exp.errors import InputError
from fractal_exp.ifs.code import IFS

VARIABLE = "FRACTAL_EXP_DENSITY_MAPS"  # the environment's name of the file
MAPS, BINS, HALF_SIDE = 4, 128, 1.5
PIXEL = 2 * HALF_SIDE / BINS
TRAJECTORIES, STEPS, SKIPPED = 16, 896, 128
LEAST_AREA = 0.02          # p is in proportion to max(|det|, this)
BLUR_PX = 2.0
SINGULAR, FIXED = (0.2, 0.7), 0.75
COUNT, SEED = 64, 2026     # of the codes that are drawn here
PUBLISHED = {  # mean of 256 maps on an RTX 3090
    "network and 30 steps, 0.56 s": {"sse": 2.23e-4, "chamfer": .0259, "hd95": .0913, "covered": .862},
    "1 000 steps": {"sse": 1.55e-4, "chamfer": .0195, "hd95": .070, "covered": .920}}


def parameters(count: int = COUNT, seed: int = SEED) -> np.ndarray:
    """Codes (count,4,6) of the law; the k-th does not depend on how many there are."""
    return np.stack([_drawn(np.random.default_rng([seed, k])) for k in range(count)])


def _drawn(rng: np.random.Generator) -> np.ndarray:
    angles, singular = rng.uniform(-np.pi, np.pi, (MAPS, 2)), rng.uniform(*SINGULAR, (MAPS, 2))
    fixed = rng.uniform(-FIXED, FIXED, (MAPS, 2))
    linear, _ = maps(np.concatenate([angles, singular, fixed], 1))
    return np.concatenate([angles, singular, fixed - np.einsum("nij,nj->ni", linear, fixed)], 1)


def maps(params: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Matrices (N,2,2) and offsets (N,2) of parameters (N,6)."""
    params = np.asarray(params, np.float64)
    return _rotation(params[:, 0]) * params[:, None, 2:4] @ _rotation(params[:, 1]), params[:, 4:6]


def _rotation(angle: np.ndarray) -> np.ndarray:
    return np.stack([np.stack([np.cos(angle), -np.sin(angle)], -1), np.stack([np.sin(angle), np.cos(angle)], -1)], -2)


def true_code(params: np.ndarray) -> IFS:
    """The code in the map's own coordinates, with the law's probabilities."""
    linear, offset = maps(params)
    weights = np.maximum(np.abs(np.linalg.det(linear)), LEAST_AREA)
    return IFS(torch.from_numpy(linear), torch.from_numpy(offset), torch.from_numpy(weights / weights.sum()))


def points(code: IFS, rng: np.random.Generator) -> np.ndarray:
    """16 trajectories of 896 points each, after 128 that do not count, drawn by the code's probabilities: (14336,2)."""
    linear, offset = code.linear.double().numpy(), code.offset.double().numpy()
    chances = code.sampling_probabilities().double().numpy()
    words = rng.choice(len(code), (SKIPPED + STEPS, TRAJECTORIES), p=chances / chances.sum())
    x, kept = np.zeros((TRAJECTORIES, 2)), []
    for letters in words:
        x = np.einsum("tij,tj->ti", linear[letters], x) + offset[letters]
        kept.append(x)
    return np.concatenate(kept[SKIPPED:])


def density(at: np.ndarray) -> np.ndarray:
    """The density (128,128) of points (P,2), first index x, over [-1.5, 1.5]²: blurred by 2 px, with the sum 1."""
    from scipy import ndimage

    counts, _, _ = np.histogram2d(at[:, 0], at[:, 1], bins=BINS, range=[[-HALF_SIDE, HALF_SIDE]] * 2)
    blurred = ndimage.gaussian_filter(counts, BLUR_PX, mode="constant")
    return blurred / max(blurred.sum(), np.finfo(float).tiny)


def picture(values: np.ndarray) -> np.ndarray:
    """A density as a picture (128,128) float32 in [0,1], x to the right and y up, linear in the density."""
    return np.ascontiguousarray((values.T[::-1] / values.max()).astype(np.float32))


@cache
def load(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """The `params` (C,4,6) and the `density` (C,128,128) of a file. Raises `InputError` unless it holds both."""
    try:
        with np.load(path, allow_pickle=False) as file:
            params, values = file["params"], file["density"]
    except (OSError, KeyError, ValueError) as error:
        raise InputError(f"{path} holds no density maps: {error}; take an .npz with params and density") from error
    if params.shape[1:] != (MAPS, 6) or values.shape != (len(params), BINS, BINS):
        raise InputError(f"{path}: params must have shape (C, {MAPS}, 6) and density (C, {BINS}, {BINS}), got "
                         f"{params.shape} and {values.shape}")
    return params, values


def given_file() -> Path | None:
    """The file of published maps, if one is named."""
    return Path(os.environ[VARIABLE]) if os.environ.get(VARIABLE) else None


def problem(name: str) -> tuple[np.ndarray, np.ndarray]:
    """The parameters (4,6) and the density (128,128) of "published-017", from the file, or of "own-005", drawn here."""
    kind, _, number = name.partition("-")
    if kind == "own":
        params = parameters(int(number) + 1)[-1]
        return params, density(points(true_code(params), np.random.default_rng([SEED, int(number), 1])))
    path = given_file()
    if path is None:
        raise InputError(f"{name} is in the published file; name it by --density-maps or {VARIABLE}")
    params, values = load(path)
    return params[int(number)], values[int(number)].astype(np.float64)


def names() -> list[str]:
    """Those of the file, where one is named, and those that are drawn here."""
    path = given_file()
    count = 0 if path is None else len(load(path)[0])
    return [*(f"published-{k:03d}" for k in range(count)), *(f"own-{k:03d}" for k in range(COUNT))]
