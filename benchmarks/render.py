"""The renderer beside a plain-torch chaos game and a plain single-threaded numba one, whole and zoomed.

    python -m benchmarks.render                   four codes at four zooms: about a minute
    python -m benchmarks.render --evaluation      and the time of judging a fractal at laptop and at paper scale
    python -m benchmarks.render --json render.json

50 million points in the view at 1024² with 8 × 8 parts. Seconds are wall time, the best of --repeats; rates are points
that land in the view, per second. A plain chaos game gets into a zoomed view by rejection alone: its rate there is its
rate for the whole canvas times the share of the attractor that the view holds.
"""

from __future__ import annotations

import argparse
import json
import platform
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from numba import njit

from fractal_exp import IFS, View, codes
from fractal_exp.evaluation import evaluate
from fractal_exp.ifs import attractor
from fractal_exp.rendering.still import render_with_info
from fractal_exp.runtime import threads
from fractal_exp.suite import random_suite

POINTS, RESOLUTION, SUPERSAMPLE = 50_000_000, 1024, 8
PLAIN_POINTS = 2_000_000       # of the plain ones, which are slow
ZOOMS = (1.0, 8.0, 64.0, 1e6)
LIMITS = {1.0: 1.0, 64.0: 3.0, 1e6: 10.0}  # seconds on two cores


def torch_chaos_game(code: IFS, view: View, points: int, size: int, orbits: int = 100_000) -> tuple[torch.Tensor, int]:
    """Occupancy (size,size) of the points that land in the view, and how many do: float32, as one would write it."""
    linear, offset, p = code.linear, code.offset, code.sampling_probabilities()
    left, _, _, top = view.box
    scale = size * view.zoom / 2
    canvas, kept = torch.zeros(size * size, dtype=torch.uint8), 0
    x = torch.zeros(orbits, 2)
    for step in range(32 + points // orbits):
        i = torch.multinomial(p, orbits, replacement=True)
        x = torch.einsum("kij,kj->ki", linear[i], x) + offset[i]
        if step >= 32:
            column, row = ((x[:, 0] - left) * scale).floor(), ((top - x[:, 1]) * scale).floor()
            inside = (column >= 0) & (column < size) & (row >= 0) & (row < size)
            canvas[(row * size + column)[inside].long()] = 1
            kept += int(inside.sum())
    return canvas.view(size, size), kept


@njit
def numba_chaos_game(linear, offset, cumulative, left, top, scale, points, canvas):
    """One thread, one orbit, float64: points land in canvas (S,S); how many do."""
    size = len(canvas)
    x = y = 0.0
    kept = 0
    for step in range(100 + points):
        u, i = np.random.random(), 0  # noqa: NPY002 (numba's own generator)
        while i < len(cumulative) - 1 and u >= cumulative[i]:
            i += 1
        x, y = (linear[i, 0, 0] * x + linear[i, 0, 1] * y + offset[i, 0],
                linear[i, 1, 0] * x + linear[i, 1, 1] * y + offset[i, 1])
        column, row = (x - left) * scale, (top - y) * scale
        if step >= 100 and 0 <= column < size and 0 <= row < size:
            canvas[int(row), int(column)] = 1
            kept += 1
    return kept


def plain_numba(code: IFS, view: View, points: int, size: int) -> int:
    """Points that land in the view, by the plain loop."""
    cumulative = np.cumsum(code.sampling_probabilities().double().numpy())
    left, _, _, top = view.box
    return numba_chaos_game(code.linear.double().numpy(), code.offset.double().numpy(), cumulative, left, top,
                            size * view.zoom / 2, points, np.zeros((size, size), np.uint8))


def best(work: Callable[[], object], repeats: int) -> tuple[float, object]:
    """The shortest wall time, and what the work returned."""
    work()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        result = work()
        seconds.append(time.perf_counter() - start)
    return min(seconds), result


def time_code(name: str, code: IFS, repeats: int) -> list[dict]:
    """A row for each zoom: seconds and points per second of the renderer, and the rates of the two plain ones."""
    code, size = attractor.normalize(code), RESOLUTION * SUPERSAMPLE
    torch_s, (_, torch_kept) = best(lambda: torch_chaos_game(code, View(), PLAIN_POINTS, size), repeats)
    numba_s, numba_kept = best(lambda: plain_numba(code, View(), PLAIN_POINTS, size), repeats)
    rows = []
    for zoom in ZOOMS:
        view = View() if zoom == 1 else View(attractor.random_point(code, 1), zoom)
        seconds, (_, info) = best(lambda view=view: render_with_info(
            code, view, resolution=RESOLUTION, points_in_view=POINTS, supersample=SUPERSAMPLE), repeats)
        rate, plain = info.drawn / seconds, [info.mass * kept / s for kept, s in ((torch_kept, torch_s),
                                                                                  (numba_kept, numba_s))]
        rows.append({"code": name, "zoom": zoom, "seconds": seconds, "limit": LIMITS.get(zoom), "points": info.drawn,
                     "mass": info.mass, "rate": rate, "torch_rate": plain[0], "numba_rate": plain[1]})
        print(f"{name:<16}{zoom:>9g}x{seconds:>9.3f} s" + "".join(f"{r:>11.3g}/s" for r in (rate, *plain))
              + f"{rate / plain[0]:>12.3g}{rate / plain[1]:>12.3g}  {info.reason or ''}", flush=True)
    return rows


def time_evaluation(repeats: int) -> list[dict]:
    """Seconds to judge one fractal on its seven views, LPIPS aside: renderings of the truth and of the result."""
    rows = []
    for scale, size, limit in (("laptop", {"resolution": 256, "points_in_view": 4_000_000}, 3.0),
                               ("paper", {"resolution": 1024, "points_in_view": 50_000_000}, 20.0)):
        for index in (0, 1, 2):
            code = random_suite(index + 1)[index]
            seconds, table = best(lambda code=code, size=size: evaluate(code, code, **size), repeats)
            rows.append({"scale": scale, "suite_index": index, "seconds": seconds, "limit": limit,
                         "ceiling_f1": float(table["f1"].mean())})
            print(f"evaluating suite {index} at {scale} scale: {seconds:.2f} s (limit {limit:g}), "
                  f"ceiling F1 {rows[-1]['ceiling_f1']:.3f}", flush=True)
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--evaluation", action="store_true", help="time the judging of a fractal too")
    parser.add_argument("--json", type=Path, help="write the figures here")
    options = parser.parse_args()
    result = {"threads": threads.use(), "machine": platform.processor() or platform.machine(),
              "torch": torch.__version__, "numpy": np.__version__}
    print(f"{POINTS:,} points at {RESOLUTION}², {SUPERSAMPLE} x {SUPERSAMPLE} parts, {result['threads']} threads")
    print(f"{'code':<16}{'zoom':>10}{'renderer':>11}{'points':>13}{'torch':>13}{'numba':>13}"
          f"{'x torch':>12}{'x numba':>12}")
    suite = random_suite(10)
    cases = {"fern": codes.known("fern"), "heighway_dragon": codes.known("heighway_dragon"), "suite 0": suite[0],
             "suite 9": suite[9]}
    result["render"] = [row for name, code in cases.items() for row in time_code(name, code, options.repeats)]
    if options.evaluation:
        result["evaluation"] = time_evaluation(options.repeats)
    if options.json is not None:
        options.json.write_text(json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    main()
