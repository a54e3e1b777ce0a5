"""Pictures of codes in any number, drawn as they are asked for."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import IterableDataset, get_worker_info

from ..errors import InputError
from ..ifs.code import IFS, PROBABILITY_FLOOR
from ..images.levels import TARGET_SUPERSAMPLE
from ..ops.histogram.pool import choice
from ..rendering.still import points_per_view
from ..runtime import seeds, threads
from ..runtime.checks import check_choice, check_count, check_number
from . import kernels

KINDS = {"points": kernels.POINTS, "patches": kernels.PATCHES, "density": kernels.DENSITY}
LEAST_SIZE, LARGEST_SIZE = 16, 4096
MOST_POINTS = 10_000_000
STRONGEST = 0.5         # jitter: there an entry may vanish
LEAST_FACTOR = 0.01     # which FractalDB then has in the place of 0
FLIPS = ((1, 1), (-1, 1), (1, -1), (-1, -1))  # steps through rows and columns
TRIED = 10_000          # points within which a code that does not contract is found out

Chances = Callable[[np.ndarray, np.ndarray, int], np.ndarray]  # of own (N,), maps (N,6) and a seed, in any unit
PROBABILITIES: dict[str, Chances] = {
    "own": lambda own, maps, seed: own,
    "areas": lambda own, maps, seed: np.where(
        own > 0, np.abs(maps[:, 0] * maps[:, 3] - maps[:, 1] * maps[:, 2]) + PROBABILITY_FLOOR, 0.0),
    "random": lambda own, maps, seed: np.where(own > 0, np.random.default_rng(seed).exponential(size=len(own)), 0.0),
}


class Fractals(IterableDataset[tuple[Tensor, Tensor]]):
    """Pictures of codes for pre-training: batches of images (B,1,S,S) uint8 and labels (B,) int64, the places of their
    codes in `codes`, from 0 on.

    Use it with `DataLoader(fractals, batch_size=None, num_workers=…)`. Each worker draws every so many batches on one
    thread, and the batches are the same, bit for bit, for any number of workers. Without workers, all cores draw.
    `len()` is the number of batches in an epoch, `pictures` that of pictures. `set_epoch` gives another order and other
    points.

    A code has `per_code` pictures: it is jittered in 25 ways, each is drawn `repeats` times, and each drawing is shown
    in four flips. Picture k is flip k % 4 of drawing k // 4. Jitter multiplies one of a … f in all maps by 1 - 2j,
    1 - j, 1 + j or 1 + 2j, and is one of 25 ways since none is another; 0 leaves the code alone. An instance that runs
    away gets a picture of few dots, as in FractalDB.

    draw: "points", grey dots (127); "patches", squares of 3 × 3 pixels with some dots, at random for each point;
    "density", the tone of the suite's grey targets. The first two are those of FractalDB (Kataoka et al., IJCV 2022):
    one chaos game of so many `points`, from the origin on, stretched so that the outermost points are six pixels from
    the edges. probabilities: "own", the code's or, if it has none, |det| + 0.01; "areas", |det| + 0.01 of the jittered
    maps; "random", uniform over all distributions, others for each drawing.

    Raises `InputError` on options out of range, no code, or a code that runs away.
    """

    def __init__(self, codes: Sequence[IFS], *, batch: int = 64, size: int = 362, points: int = 100_000,
                 draw: str = "patches", jitter: float = 0.4, repeats: int = 10, flips: bool = True,
                 probabilities: str = "own", seed: int = 0) -> None:
        check_count("batch", batch)
        check_count("size", size, LEAST_SIZE, LARGEST_SIZE)
        check_count("points", points, 2, MOST_POINTS)
        check_count("repeats", repeats, 1, 10_000)
        check_count("seed", seed, 0)
        check_number("jitter", jitter, f"a number from 0 to {STRONGEST}", 0, STRONGEST)
        check_choice("draw", draw, KINDS)
        check_choice("probabilities", probabilities, PROBABILITIES)
        if not codes:
            raise InputError("a data set needs at least one code, got none")
        self.options: dict[str, Any] = {
            "size": size, "points": points, "draw": draw, "jitter": jitter, "repeats": repeats, "flips": bool(flips),
            "probabilities": probabilities, "seed": seed}
        self.rows = [np.concatenate([code.linear.cpu().double().flatten(1), code.offset.cpu().double(),
                                     code.sampling_probabilities().cpu().double()[:, None]], 1) for code in codes]
        self._factors = factors(jitter)
        self._shape = len(codes), len(self._factors), repeats, len(FLIPS) if flips else 1
        self.per_code, self.pictures = math.prod(self._shape[1:]), math.prod(self._shape)
        self.batch, self.epoch = batch, 0
        for number, rows in enumerate(self.rows, 1):
            self._check(number, rows)

    def set_epoch(self, epoch: int) -> None:
        """Have the next iteration go through another order of other drawings. Workers that persist do not hear of
        it. Raises `InputError` unless `epoch` is at least 0."""
        check_count("epoch", epoch, 0)
        self.epoch = epoch

    def __len__(self) -> int:
        """The number of batches in an epoch."""
        return -(-self.pictures // self.batch)

    def __iter__(self) -> Iterator[tuple[Tensor, Tensor]]:
        """The batches of an epoch, or a worker's part of them."""
        worker, order = get_worker_info(), self.order()
        first, step = (worker.id, worker.num_workers) if worker else (0, 1)
        with ThreadPoolExecutor(1 if worker else threads.available()) as pool:
            for start in range(first * self.batch, self.pictures, step * self.batch):
                indices = order[start:start + self.batch]
                images = torch.from_numpy(np.stack(list(pool.map(self.picture, indices))))[:, None]
                yield images, torch.from_numpy(indices // self.per_code)

    def order(self) -> np.ndarray:
        """The order (pictures,) int64 of the epoch."""
        return np.random.default_rng(seeds.derive(self.options["seed"], "order", self.epoch)).permutation(self.pictures)

    def picture(self, index: int) -> np.ndarray:
        """Picture `index` of the epoch, (S,S) uint8; its code is number index // per_code."""
        code, way, repeat, flip = np.unravel_index(index, self._shape)
        rows, options = self.rows[code], self.options
        seed = seeds.derive(options["seed"], "drawing", self.epoch, *map(int, (code, way, repeat)))
        maps = rows[:, :6] * self._factors[way]
        chances = PROBABILITIES[options["probabilities"]](rows[:, 6], maps, seed)
        image, _ = self._drawn(maps, chances, seed, KINDS[options["draw"]], options["points"])
        return np.ascontiguousarray(image[::FLIPS[flip][0], ::FLIPS[flip][1]])

    def _drawn(self, maps: np.ndarray, chances: np.ndarray, seed: int, kind: int, points: int
               ) -> tuple[np.ndarray, int]:
        size = self.options["size"]
        image, tone = np.zeros((size, size), np.uint8), points_per_view(size) / TARGET_SUPERSAMPLE**2 / points
        xs, ys = np.empty((2, points))
        return image, kernels.draw(maps, *choice(chances), np.uint64(seed), kind, tone, xs, ys, image)

    def _check(self, number: int, rows: np.ndarray) -> None:
        _, count = self._drawn(np.ascontiguousarray(rows[:, :6]), rows[:, 6], 0, kernels.POINTS, TRIED)
        if count < TRIED:
            raise InputError(f"code {number} does not contract, not even on average: its points run away; shrink its "
                             "maps, or leave it out")


def factors(jitter: float) -> np.ndarray:
    """What the ways of jitter multiply a b c d e f by, (25,6) in the order of FractalDB, or (1,6) without jitter."""
    steps = [max(1 - 2 * jitter, LEAST_FACTOR), 1 - jitter, 1.0, 1 + jitter, 1 + 2 * jitter]
    table = [[value if column == entry else 1.0 for column in range(6)]
             for entry, value in itertools.product(range(6), steps)]
    ways = np.unique(table, axis=0, return_index=True)[1]
    return np.array(table)[np.sort(ways)]
