"""What collage search does all the time: descents and tiles, beside their plain-torch twins, and drawings, beside
others.

    python -m benchmarks.search_steps                      half a minute
    python -m benchmarks.search_steps --record benchmarks/results/search_steps.jsonl

One thread, as `benchmarks.suite` gives each fractal. A descent is 40 steps on a fractal of the random suite at 64²;
its floor is the time of its floating-point operations at the rate of a large matrix product, measured in the same run,
which scattered sums cannot reach. A drawing is that of 3.1 million points on 4096² subpixels by which a code is judged
at 256²: with a point of the invariant measure under up to eight words, with each under one (as targets are drawn), and
by the chaos game; its floor is the time of writing and reading the subpixels, at the rate of a large copy. The tiles
are those that one estimate of the camera tries on such an image.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np
import torch

from fractal_exp import IFS, ops, suite
from fractal_exp.cameras import tiles
from fractal_exp.cameras.levels import REUSE, Density
from fractal_exp.cameras.params import CameraParams
from fractal_exp.cameras.pens import PEN_SUPERSAMPLE, TILES_PX
from fractal_exp.ifs import attractor
from fractal_exp.methods.collage.bins import binned
from fractal_exp.ops.backends import choose
from fractal_exp.ops.collage import Descent, descend
from fractal_exp.rendering.still import render_with_info
from fractal_exp.runtime import threads

from . import record
from .ops import machine_limits, timed

STEPS, GRID, SIDE = 40, 64, 256
OPERATIONS = 55, 12   # of a step: for each sample and map, and for each bin
BATCHES = {"24 births of one map": (24, 1), "6 codes of eight maps": (6, 8)}
CAMERA = CameraParams()
DRAWINGS = {"as the search": REUSE, "with each point used once": 1}


def best(call: Callable[[], object], repeats: int) -> float:
    """Milliseconds, after one run that compiles."""
    call()
    return 1e3 * min(timed(call) for _ in range(repeats))


def descents(image: torch.Tensor, flops: float, repeats: int) -> list[dict]:
    """On the device of the image, by its kernel and by plain torch."""
    measure = binned(Density(CAMERA).measure(image), GRID)
    rows, generator = [], torch.Generator().manual_seed(0)
    for name, (codes, maps) in BATCHES.items():
        start = 0.3 * torch.randn(codes, maps, 6, generator=generator).to(image.device)
        weights = torch.full_like(start[..., 0], 1 / maps)

        def call(backend: str, start: torch.Tensor = start, weights: torch.Tensor = weights) -> None:
            descend(start, weights, measure, Descent(STEPS), backend=backend)
            if image.is_cuda:
                torch.cuda.synchronize()

        kernel, twin = best(partial(call, "auto"), repeats), best(partial(call, "torch"), 2)
        counted = maps * len(measure.samples) * OPERATIONS[0] + len(measure.roots) * OPERATIONS[1]
        floor = 1e3 * STEPS * codes * counted / flops
        rows.append({"descent": name, "backend": choose("auto", start), "samples": len(measure.samples), "ms": kernel,
                     "twin_ms": twin, "twin_ratio": twin / kernel, "floor_ms": floor, "of_floor": floor / kernel})
    return rows


def drawings(code: IFS, bandwidth: float, repeats: int) -> list[dict]:
    points = round(CAMERA.points_per_pixel * SIDE**2)
    floor = 1e3 * 2 * (CAMERA.supersample * SIDE)**2 / bandwidth
    draw = partial(render_with_info, code, resolution=SIDE, supersample=CAMERA.supersample, points_in_view=points)
    calls = {name: partial(draw, reuse=reuse) for name, reuse in DRAWINGS.items()}
    calls["of the chaos game"] = partial(_played, code, points)
    times = {name: best(call, repeats) for name, call in calls.items()}
    return [{"drawing": name, "ms": ms, "ratio": ms / times["as the search"], "floor_ms": floor, "of_floor": floor / ms}
            for name, ms in times.items()]


def _played(code: IFS, points: int) -> torch.Tensor:
    """The operations of this package that are there for the gradient, and torch's for the rest."""
    played = ops.chaos_game(code.linear, code.offset, trajectories=points // 1000, length=1010, warmup=10,
                            probabilities=code.sampling_probabilities())
    side = CAMERA.supersample * SIDE
    column, row = ((played * torch.tensor([1.0, -1.0]) + 1) * (side / 2)).long().clamp(0, side - 1).unbind(-1)
    canvas = torch.zeros(side * side)
    canvas[row * side + column] = 1
    return torch.nn.functional.avg_pool2d(canvas.view(1, side, side), CAMERA.supersample)[0]


def tilings(image: torch.Tensor, code: IFS, repeats: int) -> dict:
    """All sizes of tiles, by the kernels and by plain torch."""
    def call() -> None:
        for size in TILES_PX:
            tiles.tiled(image, code, 2 / SIDE * size, SIDE, PEN_SUPERSAMPLE)

    kernel = best(call, repeats)
    with patch.multiple(tiles, collect=_collected, mark=_marked):
        twin = best(call, 2)
    return {"sizes": len(TILES_PX), "ms": kernel, "twin_ms": twin, "twin_ratio": twin / kernel}


def _sent(words: np.ndarray, places: np.ndarray) -> torch.Tensor:
    """Where maps (M,6) send points (K,2), with rows counted downwards: (M,K,2)."""
    maps = torch.from_numpy(words)
    at = torch.from_numpy(places) @ maps[:, :4].unflatten(1, (2, 2)).transpose(1, 2) + maps[:, None, 4:]
    return at * at.new_tensor([1, -1])


def _collected(image: np.ndarray, words: np.ndarray, shares: np.ndarray, places: np.ndarray, levels: np.ndarray
               ) -> None:
    seen = torch.nn.functional.grid_sample(torch.from_numpy(image)[None, None], _sent(words, places)[None],
                                           align_corners=False)[0, 0]
    levels[:] = (torch.from_numpy(shares) @ seen).numpy()


def _marked(words: np.ndarray, places: np.ndarray, occupied: np.ndarray) -> None:
    side = len(occupied)
    column, row = ((_sent(words, places) + 1) * (side / 2)).long().clamp(0, side - 1).unbind(-1)
    torch.from_numpy(occupied).view(-1)[row * side + column] = 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    arguments = parser.parse_args()
    threads.use(1)
    code = replace(attractor.normalize(next(code for code in suite.random_suite() if len(code) == 8)),
                   probabilities=None)
    bandwidth, flops = machine_limits()
    image = suite.target(code, SIDE)
    report = {"bytes_per_second": bandwidth, "flops_per_second": flops,
              "descents": descents(image, flops, arguments.repeats),
              "tiles": tilings(image, code, arguments.repeats),
              "drawings": drawings(code, bandwidth, arguments.repeats)}
    for row in report["descents"]:
        print(f"descent of {row['descent']}, {row['samples']} samples: {row['ms']:.1f} ms; plain torch "
              f"{row['twin_ms']:.0f} ms, {row['twin_ratio']:.0f} times slower; floor {row['floor_ms']:.2f} ms, "
              f"{row['of_floor']:.0%} reached")
    row = report["tiles"]
    print(f"tiles of {row['sizes']} sizes: {row['ms']:.0f} ms; plain torch {row['twin_ms']:.0f} ms, "
          f"{row['twin_ratio']:.0f} times slower")
    for row in report["drawings"]:
        print(f"drawing {row['drawing']}: {row['ms']:.1f} ms, {row['ratio']:.1f} times the search's; floor "
              f"{row['floor_ms']:.1f} ms, {row['of_floor']:.0%} reached")
    if arguments.record:
        record.append(arguments.record, "search_steps", report, ratios(report))


def ratios(report: dict) -> dict[str, float]:
    """Of the descents' twins, and of other ways to draw."""
    return ({f"descent of {row['descent']}: twin / kernel": row["twin_ratio"] for row in report["descents"]}
            | {"tiles: twin / kernel": report["tiles"]["twin_ratio"]}
            | {f"drawing {row['drawing']} / as the search": row["ratio"] for row in report["drawings"][1:]})


if __name__ == "__main__":
    main()
