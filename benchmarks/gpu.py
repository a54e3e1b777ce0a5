"""Everything there is to know about a GPU in one command: first the tests that need one, then the times.

    python -m benchmarks.gpu --json benchmarks/results/gpu_h200.json
    python -m benchmarks.gpu --perceptual lpips_squeeze --weights PATH --iterations 15000
    python -m benchmarks.gpu --only collage       one part, or several: checks, operations, views, iteration, fit, ...
    python -m benchmarks.gpu --rehearse           the same script on the CPU at toy sizes: does it still run?

Times are device milliseconds between events, the median of --repeats, each of a CUDA graph's replay (`graph`) and of
plain calls (`plain`). The floor is the time that a case's bytes would take at the rate of a large copy, or its
floating-point operations at that of a large float32 matrix product, whichever is longer, both measured in this run.
The exit status is 1 if a test or a part failed; the other parts are measured all the same.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

from fractal_exp import View, codes, ops, suite
from fractal_exp.evaluation.metrics import f1, inner_crop
from fractal_exp.ifs import attractor
from fractal_exp.methods.base import Progress
from fractal_exp.methods.chaotic.losses import DSSIM, MipMSE, PerceptualTerm, Regularizer, WeightedSum
from fractal_exp.methods.chaotic.method import Chaotic, FitProblem
from fractal_exp.methods.chaotic.model import SVD, ForwardModel
from fractal_exp.methods.chaotic.optimizers import Alternating
from fractal_exp.methods.collage.method import Collage
from fractal_exp.perceptual import distances as perceptual
from fractal_exp.rendering.still import render, render_with_info
from fractal_exp.runtime.precision import full_precision
from fractal_exp.suite import random_suite

from .environment import ROOT, environment
from .ops import FOOTPRINT, SIGMA_PX, SUPERSAMPLE
from .search_steps import descents

GOALS_MS = {"chaos game": 0.15, "splat, paper": 1.5, "iteration": 4.0, "15 000 iterations": 60_000.0,
            "evaluation view, zoom 1": 15.0, "collage, to F1 of at least .9": 10_000.0}


@dataclass(frozen=True)
class Sizes:
    """What is timed: the paper's sizes, or toys for a rehearsal."""

    device: str = "cuda"
    trajectories: int = 2000
    length: int = 250
    resolution: int = 1024
    laptop: int = 256
    points_in_view: int = 50_000_000
    copy: int = 1 << 29  # float32 numbers
    product: int = 8192


TOYS = Sizes("cpu", 64, 30, 64, 32, 20_000, 1 << 20, 256)
QUICK = {"rounds": 1, "search": {"restarts": 1, "moves": 2, "detail_moves": 1}, "moves": {"count": 1}}   # a rehearsal


class Timer:
    """Milliseconds of calls on one device."""

    def __init__(self, device: str, repeats: int):
        self.device, self.repeats = device, repeats

    def plain(self, call: Callable[[], object]) -> float:
        """The median of calls one by one, after three that warm up."""
        for _ in range(3):
            call()
        return statistics.median(self._once(call) for _ in range(self.repeats))

    def graph(self, call: Callable[[], object]) -> float | None:
        """The median of a recorded call's replays; None on a CPU."""
        if self.device == "cpu":
            return None
        side = torch.cuda.Stream()
        with torch.cuda.stream(side):
            for _ in range(3):
                call()
        torch.cuda.synchronize()
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            call()
        return self.plain(graph.replay)

    def _once(self, call: Callable[[], object]) -> float:
        if self.device == "cpu":
            start = time.perf_counter()
            call()
            return 1e3 * (time.perf_counter() - start)
        start, end = (torch.cuda.Event(enable_timing=True) for _ in range(2))
        start.record()
        call()
        end.record()
        end.synchronize()
        return start.elapsed_time(end)


@dataclass(frozen=True)
class Case:
    """An operation at one size: forward(backend) gives its output; bytes and operations are of both passes."""

    name: str
    forward: Callable[[str], Tensor]
    inputs: tuple[Tensor, ...]
    megabytes: float
    megaflops: float

    def both(self, backend: str) -> Callable[[], object]:
        def run() -> object:
            image = self.forward(backend)
            return torch.autograd.grad(image, self.inputs, torch.ones_like(image))
        return run


def operations(sizes: Sizes) -> list[Case]:
    """The chaos game with 10 maps and the splat, at the paper's scale and this package's laptop scale."""
    code = attractor.normalize(next(code for code in random_suite() if len(code) == 10))
    linear, offset = (t.to(sizes.device).requires_grad_() for t in (code.linear, code.offset))
    game = {"trajectories": sizes.trajectories, "length": sizes.length, "warmup": 10}
    seed = torch.ones((), dtype=torch.int64, device=sizes.device)
    points = ops.chaos_game(linear, offset, **game, seed=seed).detach().requires_grad_()
    few = points.detach()[:100_000].clone().requires_grad_()
    steps = sizes.trajectories * sizes.length

    def splat(name: str, points: Tensor, resolution: int) -> Case:
        def forward(backend: str) -> Tensor:
            return ops.splat(points, resolution, sigma_px=SIGMA_PX, supersample=SUPERSAMPLE, backend=backend)

        pixels = (resolution * SUPERSAMPLE) ** 2
        return Case(name, forward, (points,), 24e-6 * len(points) + 8e-6 * pixels, 14e-6 * FOOTPRINT * len(points))

    return [  # bytes and operations as `benchmarks.ops` counts them
        Case("chaos game", lambda backend: ops.chaos_game(linear, offset, **game, seed=seed, backend=backend),
             (linear, offset), 28e-6 * steps, 28e-6 * steps),
        splat("splat, paper", points, sizes.resolution), splat("splat, laptop", few, sizes.laptop)]


def time_operation(case: Case, timer: Timer, rates: dict[str, float]) -> dict:
    with torch.no_grad():
        forward = timer.plain(lambda: case.forward("auto")), timer.graph(lambda: case.forward("auto"))
    both = timer.plain(case.both("auto")), timer.graph(case.both("auto"))
    twin = Timer(timer.device, 3).plain(case.both("torch"))
    return {"case": case.name, "forward_plain_ms": forward[0], "forward_graph_ms": forward[1], "plain_ms": both[0],
            "graph_ms": both[1], "twin_ms": twin, "twin_ratio": twin / (both[1] or both[0]),
            **floor(case.megabytes, case.megaflops, rates, both[1] or both[0])}


def floor(megabytes: float, megaflops: float, rates: dict[str, float], measured_ms: float) -> dict:
    least = 1e9 * max(megabytes / rates["bytes_per_second"], megaflops / rates["flops_per_second"])
    return {"megabytes": megabytes, "megaflops": megaflops, "floor_ms": least, "times_the_floor": measured_ms / least}


def measured_rates(sizes: Sizes, timer: Timer) -> dict[str, float]:
    """Bytes a second of a copy, read and written, and operations a second of a float32 matrix product."""
    source = torch.rand(sizes.copy, device=sizes.device)
    target = torch.empty_like(source)
    copy = timer.plain(lambda: target.copy_(source))
    torch.set_float32_matmul_precision("highest")
    matrix = torch.rand(sizes.product, sizes.product, device=sizes.device)
    product = Timer(timer.device, 5).plain(lambda: matrix @ matrix)
    return {"bytes_per_second": 2e3 * 4 * sizes.copy / copy, "flops_per_second": 2e3 * sizes.product**3 / product}


def perceptual_term(kind: str, weights: str | None) -> PerceptualTerm | None:
    """The term of that name; with weights "random" one of the same cost that judges nothing."""
    if kind == "none" or weights != "random":
        return None if kind == "none" else PerceptualTerm(kind, weights)
    from torchvision.models import get_model

    backbone = next(b for b in perceptual._BACKBONES if b.kind == kind)
    layers = get_model(backbone.model, weights=None).features[:backbone.taps[-1]]
    layers[0] = perceptual._GreyStem(layers[0], *perceptual.INPUT_RANGES["correct"])
    x, heads = torch.rand(1, 1, 64, 64), []
    for count, layer in enumerate(layers, 1):
        x = layer(x)
        if count in backbone.taps:
            heads.append(torch.nn.Parameter(torch.rand(x.shape[1])))
    term = PerceptualTerm.__new__(PerceptualTerm)
    torch.nn.Module.__init__(term)
    term.distance = perceptual.PerceptualDistance(f"{kind}_random", layers, backbone.taps, heads, backbone.smallest_px)
    return term


def paper_method(sizes: Sizes, term: PerceptualTerm | None, iterations: int, cuda_graph: bool = True) -> Chaotic:
    """The paper's method with all losses."""
    model = ForwardModel(SVD(), maps=10, resolution=sizes.resolution, trajectories=sizes.trajectories,
                         length=sizes.length)
    objective = WeightedSum({"mse": 10, "ssim": 1, "perceptual": 2, "regularizer": 0.01},
                            {"mse": MipMSE(), "ssim": DSSIM(), "perceptual": term, "regularizer": Regularizer()})
    return Chaotic(model, objective, Alternating(cuda_graph=cuda_graph), iterations=iterations,
                   device=sizes.device, previews=0)


def some_target(method: Chaotic) -> Tensor:
    """An image of this model's own drawing."""
    raw = {name: value.to(method.device) for name, value in SVD().initial(10, torch.Generator().manual_seed(1)).items()}
    with torch.no_grad():
        return method.model(raw, 0).image.cpu()


@full_precision()  # as in a fit
def time_iteration(sizes: Sizes, term: PerceptualTerm | None, timer: Timer, rates: dict[str, float]) -> dict:
    """One gradient step of the paper's method, replayed and plain, and the memory that it takes. Its floor is that of
    its chaos game and splat, without the losses."""
    result = {}
    if sizes.device == "cuda":
        torch.cuda.reset_peak_memory_stats()
    for name, cuda_graph in (("graph_ms", True), ("plain_ms", False)):
        method, number = paper_method(sizes, term, 1, cuda_graph), iter(range(10**9))
        problem = FitProblem(method.model, method.objective, some_target(method).to(sizes.device))
        method.optimizer.start({k: v.to(sizes.device) for k, v in SVD().initial(
            10, torch.Generator().manual_seed(0)).items()}, 0)
        for _ in range(5):
            method.optimizer.step(problem, 250 * next(number), 1.0)  # never the last before a phase of annealing
        if cuda_graph and sizes.device == "cuda":
            result["recorded"] = method.optimizer._recorded[1].graph is not None
        result[name] = timer.plain(lambda m=method, p=problem, n=number: m.optimizer.step(p, 250 * next(n), 1.0))
    if sizes.device == "cuda":
        result["memory_mb"] = torch.cuda.max_memory_allocated() / 1e6
    game, splat, _ = operations(sizes)
    return result | floor(game.megabytes + splat.megabytes, game.megaflops + splat.megaflops, rates, result["graph_ms"])


def time_fit(sizes: Sizes, term: PerceptualTerm | None, iterations: int) -> dict:
    """Wall seconds of a whole fit, phases of annealing and bookkeeping included."""
    method = paper_method(sizes, term, iterations)
    target = some_target(method)
    start = time.perf_counter()
    method.reconstruct(target, on_step=lambda progress: None)
    seconds = time.perf_counter() - start
    return {"iterations": iterations, "seconds": seconds, "seconds_per_15000": 15_000 * seconds / iterations}


def time_views(sizes: Sizes, rates: dict[str, float]) -> list[dict]:
    """Wall milliseconds of whole renderings for evaluation, from the code to the image on the host."""
    rows = []
    for name, code in (("fern", codes.known("fern")), ("suite 0", random_suite(1)[0])):
        code = attractor.normalize(code)
        for zoom in (1, 8, 64):
            view = View() if zoom == 1 else View(attractor.random_point(code, 1), zoom)
            times = []
            for seed in range(8):
                start = time.perf_counter()
                _, info = render_with_info(code, view, resolution=sizes.resolution, seed=seed, device=sizes.device,
                                           points_in_view=sizes.points_in_view)
                times.append(1e3 * (time.perf_counter() - start))
            median, canvas = statistics.median(times[1:]), (8 * sizes.resolution) ** 2
            # The parts of the pixels are cleared, marked by every point and read; a point takes 16 operations.
            rows.append({"case": f"evaluation view, zoom {zoom}", "code": name, "wall_ms": median, "points": info.drawn,
                         **floor(2e-6 * canvas + 1e-6 * info.drawn, 16e-6 * info.drawn, rates, median)})
    return rows


def time_collage(sizes: Sizes, index: int) -> list[dict]:
    """Wall seconds of collage search on a fractal of the suite, after each of its stages, and the F1 of the whole view
    of what it had found by then, judged on the CPU."""
    truth, found = random_suite(index + 1)[index], []
    target, start = suite.target(truth, sizes.resolution), time.perf_counter()

    def keep(progress: Progress) -> None:
        if progress.code is not None:
            found.append((progress.stage, time.perf_counter() - start, progress.code))

    small = QUICK if sizes == TOYS else {}
    Collage(device=sizes.device, previews=0, **small).reconstruct(target, on_step=keep)
    drawings = [inner_crop(render(attractor.normalize(code), resolution=sizes.laptop, seed=seed))[None]
                for seed, code in enumerate([truth, *(code.to("cpu") for _, _, code in found)])]
    return [{"stage": stage, "seconds": seconds, "maps": len(code), "f1": float(f1(drawing, drawings[0]))}
            for (stage, seconds, code), drawing in zip(found, drawings[1:], strict=True)]


def check() -> dict:
    """Run the tests that need a GPU and keep how they closed."""
    command = [sys.executable, "-m", "pytest", "-m", "gpu", "-q", "-rs", "-p", "no:cacheprovider",
               str(ROOT / "tests" / "ops" / "test_cuda_gpu.py")]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    print(done.stdout[-4000:], flush=True)
    passed = done.returncode == 0 and "skipped" not in done.stdout
    return {"passed": passed, "tail": done.stdout.splitlines()[-40:] if not passed else done.stdout.splitlines()[-1:]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="PATH", help="write the figures here")
    parser.add_argument("--repeats", type=int, default=50)
    parser.add_argument("--perceptual", default="lpips_alex", help="none, lpips_alex, lpips_squeeze or lpips_vgg")
    parser.add_argument("--weights", default="random", help="file of its weights (default: random, for timing alone)")
    parser.add_argument("--iterations", type=int, default=1500, help="of the whole fit that is timed (default 1500)")
    parser.add_argument("--no-checks", action="store_true", help="times only")
    parser.add_argument("--only", nargs="+", metavar="PART", help="parts whose names begin with these words")
    parser.add_argument("--rehearse", action="store_true", help="on the CPU, at toy sizes, without checks")
    arguments = parser.parse_args()

    sizes = TOYS if arguments.rehearse else Sizes()
    timer = Timer(sizes.device, 3 if arguments.rehearse else arguments.repeats)
    report: dict = {}

    def note(name: str, measure: Callable[[], object]) -> None:
        """Measure, print and keep at once: a lease may end at any time, and no part that fails may cost the others."""
        try:
            report[name] = measure()
        except Exception as error:  # whatever a new machine may bring
            report[name] = {"failed": f"{type(error).__name__}: {error}"}
        print(f"{name}: {json.dumps(report[name], indent=1)}", flush=True)
        if arguments.json:
            arguments.json.write_text(json.dumps(report, indent=1) + "\n")

    note("environment", lambda: environment(sizes.device))
    rates = measured_rates(sizes, timer)
    note("rates", lambda: rates)
    term = perceptual_term(arguments.perceptual, arguments.weights)
    name = {"perceptual": "none" if term is None else term.name}
    parts: dict[str, Callable[[], object]] = {
        "checks": check,
        "operations": lambda: [time_operation(case, timer, rates) for case in operations(sizes)],
        "views": lambda: time_views(sizes, rates),
        "iteration": lambda: name | time_iteration(sizes, term, timer, rates),
        "iteration without a perceptual term": lambda: time_iteration(sizes, None, timer, rates),
        "fit": lambda: name | time_fit(sizes, term, 10 if arguments.rehearse else arguments.iterations),
        "descents": lambda: descents(suite.target(random_suite(1)[0], 256).to(sizes.device),
                                     rates["flops_per_second"], 3 if arguments.rehearse else 20),
    } | {f"collage, fractal {index}": lambda index=index: time_collage(sizes, index)
         for index in range(1 if arguments.rehearse else 4)}
    left_out = {"checks"} if arguments.no_checks or arguments.rehearse else set()
    for part, measure in parts.items():
        if part not in left_out and (not arguments.only or any(part.startswith(word) for word in arguments.only)):
            note(part, measure)
    note("goals_ms", lambda: GOALS_MS)
    if any("failed" in part or part.get("passed") is False for part in report.values() if isinstance(part, dict)):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
