"""Densities behind a tone curve, as flame renderers and logarithmic plots show them.

Points of the chaos game are counted by NumPy, not by our renderer. A curve turns the counts into grey levels.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from fractal_exp import codes
from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS

from .. import archive
from . import judging

RESOLUTION, WALKERS, STEPS, SETTLING = 256, 2000, 1000, 30
SEEDS = {"tuning": 20261125, "reporting": 20261126}  # of suites that nothing else uses
COUNT = 6                                            # fractals of each suite
CLASSICS = {"fern": "tuning", "heighway_dragon": "reporting", "maple_leaf": "reporting"}
BRIGHT = 0.999                                       # this quantile of lit pixels is white, and so is what exceeds it


def gamma(counts: np.ndarray) -> np.ndarray:
    """Counts in proportion to the light, on a display of gamma 2.2."""
    return (counts / np.quantile(counts[counts > 0], BRIGHT)).clip(0, 1) ** (1 / 2.2)


def logarithm(counts: np.ndarray) -> np.ndarray:
    """log(1 + count), relative to its largest value."""
    return np.log1p(counts) / np.log1p(counts.max())


def flame(counts: np.ndarray) -> np.ndarray:
    """The logarithm followed by a gamma of 2.2, as in the flame algorithm (Draves and Reckase 2003)."""
    return logarithm(counts) ** (1 / 2.2)


CURVES = {"gamma": gamma, "logarithm": logarithm, "flame": flame}


@cache
def problems() -> dict[str, tuple[int | str, str, str]]:
    """Name -> fractal, curve, role. A fractal is a classic by name, or one of a suite by number."""
    drawn = [(name, name, role) for name, role in CLASSICS.items()]
    drawn += [(f"suite-{k}-{role}", k, role) for role in SEEDS for k in range(COUNT)]
    return {f"{name}-{curve}": (fractal, curve, role) for name, fractal, role in drawn for curve in CURVES}


@cache
def truth(fractal: int | str, role: str) -> IFS:
    """A classic with its textbook probabilities, or a suite's fractal with |det| + 0.01, on the canvas."""
    return attractor.normalize(codes.known(fractal) if isinstance(fractal, str) else
                               archive.true_code(fractal, SEEDS[role]))


@cache
def counts(fractal: int | str, role: str) -> np.ndarray:
    """How many points of the chaos game fall into each pixel (256,256) of the canvas."""
    code, rng = truth(fractal, role), np.random.default_rng(0)
    linear, offset = code.linear.double().numpy(), code.offset.double().numpy()
    chances = code.sampling_probabilities().double().numpy()
    points, found = np.zeros((WALKERS, 2)), np.zeros((RESOLUTION, RESOLUTION))
    for step in range(SETTLING + STEPS):
        chosen = rng.choice(len(code), WALKERS, p=chances / chances.sum())
        points = np.einsum("pij,pj->pi", linear[chosen], points) + offset[chosen]
        if step >= SETTLING:
            found += np.histogram2d(-points[:, 1], points[:, 0], RESOLUTION, [[-1, 1], [-1, 1]])[0]
    return found


def picture(name: str) -> np.ndarray:
    """The picture (256,256), uint8."""
    fractal, curve, role = problems()[name]
    return np.rint(255 * CURVES[curve](counts(fractal, role))).astype(np.uint8)


def score(name: str, code: IFS) -> dict[str, float | bool | int | str]:
    """F1 within a pixel of the drawings of a code and the truth, and whether the code is the true one."""
    fractal, curve, role = problems()[name]
    true = truth(fractal, role)
    likeness = judging.f1_within_a_pixel(*(judging.drawing(each, RESOLUTION) for each in (code, true)))
    return {"curve": curve, "f1_truth": likeness, "true_maps": len(true),
            **judging.against_code(code, true, likeness, RESOLUTION)}
