"""The colours and blends with which a code's points have the colours of a picture, in the least-squares sense.

The mean colour of the points of the chaos game in a pixel p is Σ_i A_pi(b) c_i: for given blends b it is linear in the
maps' colours c_i, and A is the mean over the points of (1-b)-weighted counts of the maps that led to them. The picture
shows α_p Σ_i A_pi(b) c_i + (1-α_p) g, with the cover α_p and the ground g of `Painted`. So colours for given blends are
a bounded linear least-squares problem (scipy's `lsq_linear`). It is solved for a few blends that are alike in all
maps. From the best of these, colours and blends together are improved within their bounds (scipy's `least_squares`,
trust region reflective), with exact derivatives of the same sampled points.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from scipy.optimize import OptimizeResult, least_squares, lsq_linear

from ..ifs import attractor
from ..ifs.code import IFS
from ..ifs.colours import Colours
from ..images.painted import Painted
from ..runtime.seeds import derive
from . import cpu

GAMES, WARM_UP = 2048, 64
STEPS = 512                   # that are counted: a million points
MOST_PIXELS = 6000            # of the picture that are compared, chosen by lot
FEWEST_PIXELS = 16            # that the shape and the code must share
LEAST_BLEND = 0.01            # of a map that is fitted; below, colours take hundreds of steps to change
ALIKE = (0.12, 0.3, 0.55, 0.85)  # blends that all maps have at the start
EVALUATIONS = 40              # at most, of an improvement
ENOUGH = 1e-3                 # relative change of the error or of the parameters at which it ends


@dataclass(frozen=True, eq=False)
class Sample:
    """Steps of chaos games and the pixels (P,) that their points fell into, with what the picture shows there."""

    letters: np.ndarray
    pixels: np.ndarray
    counts: np.ndarray
    cover: np.ndarray
    seen: np.ndarray
    probabilities: np.ndarray

    def walked(self, rgb: np.ndarray, blends: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The mean weights (P,N) of the maps' colours, and derivatives (P,N,3) of the mean colour by the blends."""
        share = self.probabilities * blends
        weights, slopes = cpu.walked(self.letters, self.pixels, rgb, blends, share / share.sum(), len(self.counts),
                                     WARM_UP)
        return weights / self.counts[:, None], slopes / self.counts[:, None, None]


def fitted(code: IFS, painted: Painted, seed: int = 0) -> IFS | None:
    """The code with the colours and blends that reproduce those of a picture; its maps and probabilities stay.

    code: contractive, in the frame of the picture's canvas, with or without colours of its own, which are not used.
    Blends are from 0.01 to 1. The picture's ground becomes the note "ground" of the code's `meta`, as "#rrggbb".
    Returns None if code and picture share fewer than 16 lit pixels. The same seed gives the same colours. Raises
    `InputError` if the code is not contractive.
    """
    sample = sampled(code, painted, seed)
    if sample is None:
        return None
    start = min((alike(sample, blend) for blend in ALIKE), key=lambda start: start.cost)
    best = improved(sample, start.x)
    rgb, blends = _parts(best.x)
    ground = "#" + bytes(np.rint(255 * painted.ground.clip(0, 1)).astype(np.uint8)).hex()
    return replace(code, meta={**code.meta, "ground": ground},
                   colours=Colours(torch.from_numpy(rgb.clip(0, 1)), torch.from_numpy(blends.clip(LEAST_BLEND, 1))))


def sampled(code: IFS, painted: Painted, seed: int) -> Sample | None:
    """Points of the chaos game in the lit pixels of a picture; None if they share too few."""
    random = np.random.default_rng(derive(seed, "colours"))
    probabilities = code.sampling_probabilities().cpu().double().numpy()
    probabilities /= probabilities.sum()
    letters = random.choice(len(code), (WARM_UP + STEPS, GAMES), p=probabilities).astype(np.uint16)
    linear, offset = code.linear.cpu().double().numpy(), code.offset.cpu().double().numpy()
    side = len(painted.lit)
    number = np.full(side * side + 1, -1, np.int32)  # of a pixel among those compared; the last is none at all
    lit = np.flatnonzero(painted.lit)
    lit = np.sort(random.choice(lit, MOST_PIXELS, replace=False)) if len(lit) > MOST_PIXELS else lit
    number[lit] = np.arange(len(lit))
    pixels = np.empty(letters.shape, np.int32)
    points = np.tile(np.asarray(attractor.random_point(code, derive(seed, "colours", "start"))), (GAMES, 1))
    for step, chosen in enumerate(letters):
        points = (linear[chosen] @ points[..., None])[..., 0] + offset[chosen]
        column, row = np.floor(np.stack([1 + points[:, 0], 1 - points[:, 1]]) * side / 2).astype(np.int64)
        inside = (column >= 0) & (column < side) & (row >= 0) & (row < side)
        pixels[step] = number[np.where(inside, row * side + column, side * side)]
    counts = np.bincount(pixels[WARM_UP:][pixels[WARM_UP:] >= 0], minlength=len(lit))
    hit = counts > 0
    if hit.sum() < FEWEST_PIXELS:
        return None
    again = np.append(np.where(hit, np.cumsum(hit) - 1, -1), -1).astype(np.int32)  # the last for -1
    cover = painted.cover.ravel()[lit[hit]].astype(np.float64)
    seen = painted.seen.reshape(-1, 3)[lit[hit]] - (1 - cover[:, None]) * painted.ground
    return Sample(letters, again[pixels], counts[hit], cover, seen, probabilities)


def alike(sample: Sample, blend: float) -> OptimizeResult:
    """The best colours if all maps have one blend: `x` (4N,) holds them and the blends, `cost` is half the squared
    error."""
    maps = len(sample.probabilities)
    blends = np.full(maps, blend)
    weights, _ = sample.walked(np.zeros((maps, 3)), blends)
    covered = sample.cover[:, None] * weights
    q, r = np.linalg.qr(covered)  # as few equations as unknowns
    rgb = np.stack([lsq_linear(r, channel, (0, 1)).x for channel in (q.T @ sample.seen).T], 1)
    cost = float(np.square(covered @ rgb - sample.seen).sum()) / 2
    return OptimizeResult(x=np.concatenate([rgb.ravel(), blends]), cost=cost)


def improved(sample: Sample, start: np.ndarray) -> OptimizeResult:
    """Colours and blends improved together from x (4N,) on."""
    maps = len(sample.probabilities)
    last: dict[bytes, tuple[np.ndarray, np.ndarray]] = {}

    def walked(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        if x.tobytes() not in last:  # residuals and their derivatives are asked for one after the other
            last.clear()
            last[x.tobytes()] = sample.walked(*_parts(x))
        return last[x.tobytes()]

    def residuals(x: np.ndarray) -> np.ndarray:
        weights, _ = walked(x)
        return (sample.cover[:, None] * (weights @ _parts(x)[0]) - sample.seen).ravel()

    def jacobian(x: np.ndarray) -> np.ndarray:
        weights, slopes = (sample.cover.reshape(-1, *[1] * (each.ndim - 1)) * each for each in walked(x))
        made = np.zeros((len(weights), 3, 4 * maps))
        for channel in range(3):
            made[:, channel, channel:3 * maps:3] = weights
        made[:, :, 3 * maps:] = slopes.transpose(0, 2, 1)
        return made.reshape(-1, 4 * maps)

    exact: Any = jacobian  # scipy's stubs know of names of approximations alone
    least = np.concatenate([np.zeros(3 * maps), np.full(maps, LEAST_BLEND)])
    return least_squares(residuals, start.clip(least + 1e-6, 1 - 1e-6), exact, (least, np.ones(4 * maps)),
                         ftol=ENOUGH, xtol=ENOUGH, gtol=1e-10, max_nfev=EVALUATIONS, tr_solver="lsmr")


def _parts(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    maps = len(x) // 4
    return np.ascontiguousarray(x[:3 * maps].reshape(maps, 3)), np.ascontiguousarray(x[3 * maps:])
