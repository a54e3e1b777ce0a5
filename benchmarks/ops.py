"""The operations, forward and backward, beside their plain-torch twins, the float64 truth and the machine's limits.

    python -m benchmarks.ops                      every case: about three minutes, most of it for the twins
    python -m benchmarks.ops --no-twin            the kernels alone: seconds
    python -m benchmarks.ops --record benchmarks/results/cpu_ops.jsonl

Times are wall milliseconds, the best of --repeats. The floor is the time that a case's bytes would take at the
bandwidth of a large copy, or its floating-point operations at the rate of a large matrix product, whichever is longer,
both measured in this run on the same threads.
"""

from __future__ import annotations

import argparse
import platform
import resource
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numba
import torch
from torch import Tensor

from fractal_exp import ops, suite
from fractal_exp.ifs import attractor
from fractal_exp.runtime import threads

from . import record

SIGMA_PX, SUPERSAMPLE = 2.5, 5
FOOTPRINT = 217                 # pixels of a splat of sigma 2.5: the disc where its opacity is at least 1/255
GAME = {"trajectories": 2000, "length": 250, "warmup": 10, "seed": 1}


@dataclass
class Case:
    """One operation at one size: `run(inputs, backend)` gives the output; bytes and operations are of both passes."""

    name: str
    run: Callable[[tuple[Tensor, ...], str], Tensor]
    inputs: tuple[Tensor, ...]
    points: int
    megabytes: float
    megaflops: float


def cases() -> list[Case]:
    """The published scale and this package's laptop scale, on a code of the random suite with ten maps."""
    code = attractor.normalize(next(code for code in suite.random_suite() if len(code) == 10))
    points = ops.chaos_game(code.linear, code.offset, **GAME)
    steps = GAME["trajectories"] * GAME["length"]
    # Points 8 bytes and indices 2, written and read; the points' gradients 8, read. 8 operations a step, 20 back.
    game = Case("chaos game 2000 x 250, N = 10", _play, (code.linear, code.offset), len(points), 28e-6 * steps,
                28e-6 * steps)
    few = points.view(2000, 240, 2)[:, :50].reshape(-1, 2)
    return [game, _splat("splat 480 000 points, R = 1024", points, 1024),
            _splat("splat 100 000 points, R = 256", few, 256)]


def _play(inputs: tuple[Tensor, ...], backend: str) -> Tensor:
    return ops.chaos_game(*inputs, **GAME, backend=backend)


def _splat(name: str, points: Tensor, resolution: int) -> Case:
    def run(inputs: tuple[Tensor, ...], backend: str) -> Tensor:
        return ops.splat(*inputs, resolution, sigma_px=SIGMA_PX, supersample=SUPERSAMPLE, backend=backend)

    # The points' 8 bytes thrice, the supersampled transmittance written and read. Per pixel of a footprint: product,
    # comparison, limit, 1 - alpha and product forward, 9 operations back.
    pixels = (resolution * SUPERSAMPLE) ** 2
    return Case(name, run, (points,), len(points), 24e-6 * len(points) + 8e-6 * pixels, 14e-6 * FOOTPRINT * len(points))


def seconds(case: Case, backend: str, repeats: int) -> tuple[float, float]:
    """The best forward and the best backward time, after one run that compiles."""
    inputs = tuple(t.clone().requires_grad_() for t in case.inputs)
    forward, backward = [], []
    for _ in range(repeats + (backend == "cpu")):
        start = time.perf_counter()
        output = case.run(inputs, backend)
        middle = time.perf_counter()
        torch.autograd.grad(output, inputs, torch.ones_like(output))
        forward.append(middle - start)
        backward.append(time.perf_counter() - middle)
    return min(forward), min(backward)


LOSSES: dict[str, Callable[[Tensor], Tensor]] = {  # whose gradients differ in scale
    "sum": Tensor.sum, "mean": Tensor.mean, "sum · 1e-20": lambda image: image.sum() * 1e-20,
    "squared mean": lambda image: image.square().mean()}


def slowest_loss(case: Case, repeats: int) -> dict:
    """The best backward time of the operation by loss, taken in turns, and how much longer the slowest takes than the
    sum: small gradients times faint pixels are denormal numbers, with which a processor may be slow."""
    times: dict[str, list[float]] = {name: [] for name in LOSSES}
    for _ in range(repeats):
        for name, loss in LOSSES.items():
            inputs = tuple(t.clone().requires_grad_() for t in case.inputs)
            output = case.run(inputs, "cpu")
            gradient, = torch.autograd.grad(loss(output), output)
            times[name].append(timed(lambda given=(output, inputs, gradient): torch.autograd.grad(*given)))
    best = {name: min(each) for name, each in times.items()}
    return {"backward_ms_by_loss": {name: 1e3 * each for name, each in best.items()},
            "slowest_loss_ratio": max(best.values()) / best["sum"]}


def gradient_error(case: Case) -> float:
    """|g - g64| / |g64| over all inputs, under one random cotangent."""
    gradients, cotangent = [], None
    for dtype, backend in ((torch.float32, "cpu"), (torch.float64, "torch")):
        inputs = tuple(t.to(dtype, copy=True).requires_grad_() for t in case.inputs)
        output = case.run(inputs, backend)
        if cotangent is None:
            cotangent = torch.randn(output.shape, generator=torch.Generator().manual_seed(0))
        grads = torch.autograd.grad(output, inputs, cotangent.to(dtype))
        gradients.append(torch.cat([g.flatten().double() for g in grads]))
    got, expected = gradients
    return float((got - expected).norm() / expected.norm())


def machine_limits() -> tuple[float, float]:
    """Bytes per second of a large copy (read and written) and operations per second of a large matrix product."""
    source, matrix = torch.ones(1 << 26), torch.ones(2048, 2048)
    target = torch.empty_like(source)
    copy = min(timed(lambda: target.copy_(source)) for _ in range(8))
    product = min(timed(lambda: matrix @ matrix) for _ in range(8))
    return 2 * source.nbytes / copy, 2 * 2048**3 / product


def timed(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def peak_megabytes() -> float:
    """The most memory this process has held so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def kernel_figures(case: Case, repeats: int) -> dict:
    before = peak_megabytes()
    forward, backward = seconds(case, "cpu", repeats)
    total, after = forward + backward, peak_megabytes()
    return {"case": case.name, "forward_ms": 1e3 * forward, "backward_ms": 1e3 * backward, "total_ms": 1e3 * total,
            "points_per_second": case.points / total, "memory_growth_mb": after - before, "memory_peak_mb": after}


def floor_figures(case: Case, total_ms: float, limits: tuple[float, float]) -> dict:
    floor_ms = 1e3 * max(case.megabytes * 1e6 / limits[0], case.megaflops * 1e6 / limits[1])
    return {"megabytes": case.megabytes, "megaflops": case.megaflops, "floor_ms": floor_ms,
            "of_floor": floor_ms / total_ms}


def twin_figures(case: Case, total_ms: float, repeats: int) -> dict:
    forward, backward = seconds(case, "torch", repeats)
    twin_ms = 1e3 * (forward + backward)
    return {"twin_forward_ms": 1e3 * forward, "twin_backward_ms": 1e3 * backward, "twin_total_ms": twin_ms,
            "twin_ratio": twin_ms / total_ms, "gradient_error": gradient_error(case)}


KERNEL = """
{case}
  kernel  {forward_ms:9.2f} + {backward_ms:.2f} = {total_ms:.2f} ms: {points_per_second:.3g} points/s
  losses  {slowest_loss_ratio:9.2f} times a sum's backward time, for the loss that takes longest
  floor   {floor_ms:9.2f} ms for {megabytes:.0f} MB, {megaflops:.0f} MFLOP: {of_floor:.0%} reached
  memory  {memory_growth_mb:9.0f} MB more, {memory_peak_mb:.0f} MB in all"""
TWIN = """\
  twin    {twin_forward_ms:9.2f} + {twin_backward_ms:.2f} = {twin_total_ms:.2f} ms: {twin_ratio:.0f} times slower
  error   {gradient_error:9.1e} of the gradient, against the float64 twin"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=20, help="runs of each kernel (default 20)")
    parser.add_argument("--twin-repeats", type=int, default=2, help="runs of each twin (default 2)")
    parser.add_argument("--no-twin", action="store_true", help="skip the twins, and with them ratio and error")
    parser.add_argument("--threads", type=int, help="threads for both (default: one per core)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    arguments = parser.parse_args()

    count = threads.use(arguments.threads)
    measured = [(case, kernel_figures(case, arguments.repeats)) for case in cases()]  # before the twins take memory
    limits = machine_limits()
    print(f"{platform.machine()}, {count} threads, torch {torch.__version__}, numba {numba.__version__}; "
          f"copy {limits[0] / 1e9:.1f} GB/s, matrix product {limits[1] / 1e9:.0f} GFLOP/s")
    for case, row in measured:
        row |= floor_figures(case, row["total_ms"], limits) | slowest_loss(case, max(3, arguments.repeats // 4))
        print(KERNEL.format(**row))
        if not arguments.no_twin:
            row |= twin_figures(case, row["total_ms"], arguments.twin_repeats)
            print(TWIN.format(**row))
    if arguments.record:
        report = {"threads": count, "bytes_per_second": limits[0], "flops_per_second": limits[1],
                  "cases": [row for _, row in measured]}
        record.append(arguments.record, "ops", report, ratios(report))


def ratios(report: dict) -> dict[str, float]:
    """How many times slower the twins were."""
    return {f"{row['case']}: twin / kernel": row["twin_ratio"] for row in report["cases"] if "twin_ratio" in row}


if __name__ == "__main__":
    main()
