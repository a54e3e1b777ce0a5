"""One whole iteration of the paper's method (generator, splat, objective, backward, step) against its plain-torch twin.

    python -m benchmarks.iteration                      laptop scale
    python -m benchmarks.iteration --scale paper --perceptual lpips_alex --weights PATH
    python -m benchmarks.iteration --method chaotic_released --no-twin --parts
                                                        with the processor time of each part, both passes
"""

from __future__ import annotations

import argparse
import resource
import statistics
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from fractal_exp.methods.chaotic.losses import DSSIM, MipMSE, PerceptualTerm, Regularizer, Term, WeightedSum
from fractal_exp.methods.chaotic.method import FitProblem
from fractal_exp.methods.chaotic.model import SVD, ForwardModel, Maps
from fractal_exp.methods.chaotic.optimizers import Alternating
from fractal_exp.methods.chaotic.released import QR, FixedCentre, MeanCondition
from fractal_exp.methods.chaotic.rendering import Rendering
from fractal_exp.runtime import threads
from fractal_exp.runtime.memory import keep_freed

from . import record

SCALES: dict[str, dict[str, Any]] = {
    "laptop": {"resolution": 256, "trajectories": 1000, "length": 110},
    "paper": {"resolution": 1024, "trajectories": 2000, "length": 250},
}


METHODS = {  # what differs: parameterisation, its image in the game's units, optimiser, weight of the first term, terms
    "chaotic": (SVD, 1.0, Alternating, 10, MipMSE, Regularizer),
    "chaotic_released": (QR, 5.0, FixedCentre, 100 / 9, partial(MipMSE, stretch=True), MeanCondition),
}


def fit(method: str, backend: str, scale: str, perceptual: PerceptualTerm | None) -> tuple[FitProblem, Alternating]:
    """A fit of one random code to another, ready for its first iteration."""
    parameterization, start_range, optimizer, weight, mip_mse, regularizer = METHODS[method]
    model = ForwardModel(parameterization(), maps=10, start_range=start_range, backend=backend, **SCALES[scale])
    terms = {"mse": mip_mse(), "ssim": DSSIM(), "perceptual": perceptual, "regularizer": regularizer()}
    objective = WeightedSum({"mse": weight, "ssim": 1, "perceptual": 2, "regularizer": 0.01}, terms)
    raw, other = (parameterization().initial(10, torch.Generator().manual_seed(seed)) for seed in (0, 1))
    with torch.no_grad():
        target = ForwardModel(parameterization(), maps=10, start_range=start_range, **SCALES[scale])(other, 0)
    moves = optimizer()
    moves.start(raw, 0)
    return FitProblem(model, objective, target.image), moves


def iteration_seconds(problem: FitProblem, optimizer: Alternating, repeats: int) -> tuple[list[float], list[float]]:
    """Wall seconds and seconds of processor time, of all threads, of `repeats` iterations after one that warms up (and
    compiles)."""
    wall, busy = [], []
    for i in range(repeats + 1):
        start, worked = time.perf_counter(), time.process_time()
        optimizer.step(problem, i, 1.0)
        wall.append(time.perf_counter() - start)
        busy.append(time.process_time() - worked)
    return wall[1:], busy[1:]


def part_seconds(problem: FitProblem, optimizer: Alternating, repeats: int) -> dict[str, list[float]]:
    """By part of an iteration, the median seconds of processor time of its forward and of its backward pass, each part
    alone and in turns; the smaller ones (parameters, regulariser, step) have no part of their own."""
    model = problem.model
    rendering = model(optimizer.raw, 0)
    maps = model.parameterization.decode(optimizer.raw)

    def game(linear: Tensor, offset: Tensor) -> Tensor:
        return model.play(Maps(linear, offset, maps.singular), 0)

    def of_image(term: Term) -> Callable[[Tensor], Tensor]:
        return lambda image: term(Rendering(image, rendering.points, maps.singular, maps.offset))

    parts = {"chaos game": (game, (maps.linear, maps.offset)),
             "frame": (model.framed, (model.play(maps, 0),)),
             "splat": (model.splat, (rendering.points,))}
    for name, term in problem.objective.terms.items():
        if isinstance(term, PerceptualTerm):
            features = term.distance.features(rendering.image)
            parts["perceptual: features"] = (term.distance.features, (rendering.image,))
            parts["perceptual: comparison"] = (
                lambda *own, to=term: to.distance.compare(own, to.target_features), tuple(features))
        elif isinstance(term, Term) and name != "regularizer":
            parts[name] = (of_image(term), (rendering.image,))
    rounds = [{name: both_passes(*part) for name, part in parts.items()} for _ in range(repeats + 1)][1:]
    return {name: [statistics.median(times) for times in zip(*(each[name] for each in rounds), strict=True)]
            for name in parts}


def both_passes(run: Callable[..., Tensor | list[Tensor]], inputs: Sequence[Tensor]) -> tuple[float, float]:
    """Seconds of processor time of the forward and of the backward pass, the latter from random gradients."""
    leaves = [value.detach().requires_grad_() for value in inputs]
    start = time.process_time()
    outputs = run(*leaves)
    middle = time.process_time()
    gradients = [torch.randn_like(value) for value in ([outputs] if isinstance(outputs, Tensor) else outputs)]
    resumed = time.process_time()
    torch.autograd.grad(outputs, leaves, gradients)
    return middle - start, time.process_time() - resumed


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--method", choices=METHODS, default="chaotic")
    parser.add_argument("--scale", choices=SCALES, default="laptop")
    parser.add_argument("--perceptual", default="none", help="none, lpips_alex, lpips_squeeze or lpips_vgg")
    parser.add_argument("--weights", help="file of the backbone's weights")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--no-twin", action="store_true", help="leave the slow plain-torch twin out")
    parser.add_argument("--parts", action="store_true", help="time each part alone, too")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    args = parser.parse_args()
    count = threads.use()
    keep_freed()
    perceptual = None if args.perceptual == "none" else PerceptualTerm(args.perceptual, args.weights)
    result = {"method": args.method, "scale": args.scale, "perceptual": args.perceptual, "threads": count}
    problem, optimizer = fit(args.method, "auto", args.scale, perceptual)
    wall, busy = iteration_seconds(problem, optimizer, args.repeats)
    result |= {"auto_seconds": statistics.median(wall), "auto_busy_seconds": statistics.median(busy)}
    result["peak_gb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{args.method}, {args.scale}, perceptual={args.perceptual}: "
          f"{result['auto_seconds'] * 1e3:.0f} ms an iteration, "
          f"{result['auto_busy_seconds'] * 1e3:.0f} ms of processor time, {result['peak_gb']:.1f} GB at most")
    if args.parts:
        result["part_busy_seconds"] = part_seconds(problem, optimizer, args.repeats)
        for name, (forward, backward) in result["part_busy_seconds"].items():
            print(f"  {name:23} {forward * 1e3:6.2f} + {backward * 1e3:5.2f} ms")
    if not args.no_twin:
        result["twin_seconds"] = min(iteration_seconds(*fit(args.method, "torch", args.scale, perceptual), 1)[0])
        print(f"plain-torch operators: {result['twin_seconds'] * 1e3:.0f} ms, "
              f"{result['twin_seconds'] / result['auto_seconds']:.1f}× as long")
    if args.record:
        record.append(args.record, "iteration", result, ratios(result))


def ratios(result: dict) -> dict[str, float]:
    """How many times slower an iteration on the twins was."""
    of = "" if result["method"] == "chaotic" else f"{result['method']}, "
    name = f"{of}{result['scale']}, perceptual={result['perceptual']}: twin / kernels"
    return {name: result["twin_seconds"] / result["auto_seconds"]} if "twin_seconds" in result else {}


if __name__ == "__main__":
    main()
