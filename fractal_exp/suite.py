"""The random suite: a hundred codes that anybody can reproduce, and their target images."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from torch import Tensor

from .errors import InputError
from .ifs import attractor
from .ifs.code import IFS
from .images.levels import TARGET_SUPERSAMPLE
from .rendering.still import points_per_view, render

TARGET_KINDS = ("grey", "binary")
THRESHOLD = 0.25  # of a binary target
SUITE_SEED = 2025  # of the project's results; any other seed makes another suite of the same distribution
SUITE_COUNT = 100
FIRST_TRAINING_SEED = 2**62  # seeds from here on are for the training of networks: no suite has them


def random_suite(count: int = SUITE_COUNT, seed: int = SUITE_SEED) -> list[IFS]:
    """`count` random codes of 3 to 10 maps, drawn one after the other from one NumPy PCG64 generator.

    The distribution is that of Anderson and Farrell, "Improving Fractal Pre-training" (WACV 2022, section 4). Singular
    values share a budget sum_i (s1_i + 2 s2_i) ~ U((5+N)/2, (6+N)/2). Orthonormal factors have a uniform angle and may
    reflect. Offsets are uniform in [-1,1]². Nothing is rejected. `attractor.normalize` brings a code to the canvas. A
    shorter suite is the beginning of a longer one of the same seed. Raises `InputError` unless `count` is at least 1
    and `seed` at least 0 and below 2^62: higher ones are for the training of networks, which must not meet a suite.
    """
    if count < 1:
        raise InputError(f"a suite has at least 1 fractal, got count={count}")
    if seed < 0:
        raise InputError(f"a suite's seed must be at least 0, got {seed}")
    if seed >= FIRST_TRAINING_SEED:
        raise InputError("a suite's seed must be below 2^62, as networks are trained on codes of higher seeds, got "
                         f"{seed}")
    rng = np.random.Generator(np.random.PCG64(seed))
    return [draw_code(rng, {"name": f"random-{seed}-{index:03d}", "suite_seed": seed, "suite_index": index})
            for index in range(count)]


def target(code: IFS, resolution: int = 1024, kind: str = "grey", *, seed: int = 0) -> Tensor:
    """The target image (R,R) in [0,1], float32, of a code: what a method is given to reconstruct.

    The code is brought to the canvas by `attractor.normalize`. It is rendered with its own probabilities (|det| + 0.01
    if it has none), 50 million · (R/1024)² points (section 5 of the paper) and 16 × 16 subpixels a pixel (the paper's
    program; section 5 has 8 × 8). So few points leave the image unsaturated: a "grey" target I shows the density of the
    invariant measure, about -log(1 - I) points a subpixel. A "binary" target is I > 0.25. Raises `InputError` on
    another kind, a resolution below 1 or a code that is not contractive.
    """
    if kind not in TARGET_KINDS:
        raise InputError(f"a target is one of {', '.join(TARGET_KINDS)}, got {kind!r}")
    framed = attractor.normalize(code)
    image = render(framed, resolution=resolution, points_in_view=points_per_view(resolution),
                   supersample=TARGET_SUPERSAMPLE, seed=seed)
    return image if kind == "grey" else (image > THRESHOLD).float()


def draw_code(rng: np.random.Generator, meta: dict[str, Any]) -> IFS:
    """A random code of the suite's distribution (Anderson and Farrell 2022), not framed."""
    n = int(rng.integers(3, 10, endpoint=True))
    singular = _singular_values(rng, n, rng.uniform((5 + n) / 2, (6 + n) / 2))
    linear = _orthonormal(rng, n) @ (singular[:, :, None] * _orthonormal(rng, n).transpose(0, 2, 1))
    offset = rng.uniform(-1, 1, (n, 2))
    return IFS(torch.from_numpy(linear), torch.from_numpy(offset), meta=meta)


def _singular_values(rng: np.random.Generator, n: int, budget: float) -> np.ndarray:
    """n pairs 1 >= s1 >= s2 >= 0 with sum s1 + 2 s2 = budget, (n,2): Anderson and Farrell 2022, algorithm 1."""
    pairs = np.empty((n, 2))
    left, least = budget, budget - 3 * n + 3  # what is left to spend; what must be spent here for the rest to absorb it
    for i in range(n - 1):
        s1 = rng.uniform(max(0.0, least / 3), min(1.0, left))
        left, least = left - s1, least - s1
        s2 = rng.uniform(max(0.0, least / 2), min(s1, left / 2))
        left, least = left - 2 * s2, least - 2 * s2 + 3
        pairs[i] = s1, s2
    s2 = rng.uniform(max(0.0, (left - 1) / 2), left / 3)
    pairs[-1] = left - 2 * s2, s2
    return pairs


def _orthonormal(rng: np.random.Generator, n: int) -> np.ndarray:
    """n rotations by uniform angles, each axis flipped with chance one half, (n,2,2)."""
    angle = rng.uniform(0, 2 * math.pi, n)
    rotation = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]).transpose(2, 0, 1)
    return rotation * rng.choice([-1.0, 1.0], (n, 1, 2))
