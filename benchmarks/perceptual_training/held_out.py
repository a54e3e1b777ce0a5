"""Pairs to judge a distance by: a truth and a copy that is moved by a known amount, drawn as the project draws targets.

They share no code with training nor with any suite: the seeds come from streams of their own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from torch import Tensor

from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.rendering.still import points_per_view, render
from fractal_exp.runtime.seeds import derive
from fractal_exp.suite import TARGET_SUPERSAMPLE, draw_code
from fractal_exp.training.codes import rows

from .perturbations import KINDS, LARGEST_SINGULAR, displacement, ifs, orbits_of_one_address, perturbed

STREAM = "perceptual-test"
SMALLEST, LARGEST = 1e-3, 0.5  # displacements in units of the canvas: an eighth of a pixel at 256² to a quarter of it
TRIES = 200


@dataclass(frozen=True)
class Copy:
    """A code near the truth, framed as it is drawn, how it was made, and by how much the points of the truth's
    addresses are moved: root mean square, in units of the canvas [-1,1]. Without a map nothing is moved: the size is
    then the share of the points that it had drawn."""

    code: IFS
    kind: str
    size: float


@dataclass(frozen=True)
class Truth:
    """A code in its frame, its moved copies, and its copies without one map."""

    code: IFS
    moved: tuple[Copy, ...]
    without: tuple[Copy, ...]


def truths(count: int, copies: int, seed: int = 0) -> list[Truth]:
    """`count` codes of the random suite's distribution with `copies` moved copies each."""
    return [_truth(derive(seed, STREAM, number), copies) for number in range(count)]


def draw(code: IFS, resolution: int, seed: int) -> Tensor:
    """The image (R,R) of a framed code, as `suite.target` draws it."""
    return render(code, resolution=resolution, points_in_view=points_per_view(resolution),
                  supersample=TARGET_SUPERSAMPLE, seed=seed)


def _truth(seed: int, count: int) -> Truth:
    rng = np.random.Generator(np.random.PCG64(seed))
    code = draw_code(rng, {})
    while float(code.singular_values().max()) > LARGEST_SINGULAR:  # a copy would be shrunk, however little it moved
        code = draw_code(rng, {})
    code = attractor.normalize(code)
    moved = tuple(_copy(code, KINDS[k % len(KINDS)], own_frame=k // len(KINDS) % 2 == 0, rng=rng)
                  for k in range(count))
    chance = code.sampling_probabilities()
    without = tuple(Copy(IFS(_other(code.linear, i), _other(code.offset, i)), "removed", float(chance[i]))
                    for i in range(len(code)))
    return Truth(code, moved, without)


def _copy(truth: IFS, kind: str, own_frame: bool, rng: np.random.Generator) -> Copy:
    """A copy perturbed by an amount drawn evenly over its logarithm, moved by neither too little nor too much; framed
    by its own box, as a fit's reconstruction is, or left in the truth's frame."""
    maps = rows(truth)
    for _ in range(TRIES):
        amount = float(np.exp(rng.uniform(np.log(SMALLEST), np.log(2 * LARGEST))))
        copy = ifs(perturbed(maps, kind, amount, np.zeros(2), rng))
        copy = attractor.normalize(copy) if own_frame else copy
        size = displacement(*orbits_of_one_address(maps, [rows(copy)], int(rng.integers(2**31))))
        if SMALLEST <= size <= LARGEST:
            return Copy(copy, kind, size)
    raise RuntimeError(f"{TRIES} copies of kind {kind} moved by less than {SMALLEST} or more than {LARGEST}")


def _other(rows: Tensor, without: int) -> Tensor:
    return rows[[row for row in range(len(rows)) if row != without]]
