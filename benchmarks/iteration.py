"""One whole iteration of the paper's method (generator, splat, objective, backward, step) against its plain-torch twin.

    python -m benchmarks.iteration                      laptop scale
    python -m benchmarks.iteration --scale paper --perceptual lpips_alex --weights PATH
"""

from __future__ import annotations

import argparse
import resource
import statistics
import time
from pathlib import Path

import torch

from fractal_exp.methods.chaotic.losses import DSSIM, MipMSE, PerceptualTerm, Regularizer, WeightedSum
from fractal_exp.methods.chaotic.method import FitProblem
from fractal_exp.methods.chaotic.model import SVD, ForwardModel
from fractal_exp.methods.chaotic.optimizers import Alternating
from fractal_exp.runtime import threads

from . import record

SCALES = {
    "laptop": {"resolution": 256, "trajectories": 1000, "length": 110},
    "paper": {"resolution": 1024, "trajectories": 2000, "length": 250},
}


def iteration_seconds(backend: str, scale: str, perceptual: PerceptualTerm | None,
                      repeats: int) -> tuple[list[float], list[float]]:
    """Wall seconds and seconds of processor time, of all threads, of `repeats` iterations after one that warms up (and
    compiles)."""
    model = ForwardModel(SVD(), maps=10, backend=backend, **SCALES[scale])
    terms = {"mse": MipMSE(), "ssim": DSSIM(), "perceptual": perceptual, "regularizer": Regularizer()}
    objective = WeightedSum({"mse": 10, "ssim": 1, "perceptual": 2, "regularizer": 0.01}, terms)
    raw = SVD().initial(10, torch.Generator().manual_seed(0))
    with torch.no_grad():
        target = ForwardModel(SVD(), maps=10, **SCALES[scale])(SVD().initial(10, torch.Generator().manual_seed(1)), 0)
    problem, optimizer = FitProblem(model, objective, target.image), Alternating()
    optimizer.start(raw, 0)
    wall, busy = [], []
    for i in range(repeats + 1):
        start, worked = time.perf_counter(), time.process_time()
        optimizer.step(problem, i, 1.0)
        wall.append(time.perf_counter() - start)
        busy.append(time.process_time() - worked)
    return wall[1:], busy[1:]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scale", choices=SCALES, default="laptop")
    parser.add_argument("--perceptual", default="none", help="none, lpips_alex, lpips_squeeze or lpips_vgg")
    parser.add_argument("--weights", help="file of the backbone's weights")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--no-twin", action="store_true", help="leave the slow plain-torch twin out")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    args = parser.parse_args()
    count = threads.use()
    perceptual = None if args.perceptual == "none" else PerceptualTerm(args.perceptual, args.weights)
    result = {"scale": args.scale, "perceptual": args.perceptual, "threads": count}
    wall, busy = iteration_seconds("auto", args.scale, perceptual, args.repeats)
    result |= {"auto_seconds": statistics.median(wall), "auto_busy_seconds": statistics.median(busy)}
    result["peak_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{args.scale}, perceptual={args.perceptual}: {result['auto_seconds'] * 1e3:.0f} ms an iteration, "
          f"{result['auto_busy_seconds'] * 1e3:.0f} ms of processor time, {result['peak_gb']:.1f} GB at most")
    if not args.no_twin:
        result["twin_seconds"] = min(iteration_seconds("torch", args.scale, perceptual, 1)[0])
        print(f"plain-torch operators: {result['twin_seconds'] * 1e3:.0f} ms, "
              f"{result['twin_seconds'] / result['auto_seconds']:.1f}× as long")
    if args.record:
        record.append(args.record, "iteration", result, ratios(result))


def ratios(result: dict) -> dict[str, float]:
    """How many times slower an iteration on the twins was."""
    name = f"{result['scale']}, perceptual={result['perceptual']}: twin / kernels"
    return {name: result["twin_seconds"] / result["auto_seconds"]} if "twin_seconds" in result else {}


if __name__ == "__main__":
    main()
