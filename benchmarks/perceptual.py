"""How well distances between pictures follow distances between codes, and what they cost.

    python -m benchmarks.perceptual                                     mse, mip_mse, ssim and fractal
    python -m benchmarks.perceptual --lpips-squeeze squeezenet1_1.pth   and LPIPS-squeeze with these weights
    python -m benchmarks.perceptual --weights mine.safetensors          a network of benchmarks.perceptual_training
    python -m benchmarks.perceptual --resolutions                       the cost alone, beside the last correlations

Spearman's correlation of a distance with the displacement of the attractor's points (root mean square, points of one
address), on held-out codes and copies that were moved by a known amount: `within`, the mean over the truths of the
correlation over their copies, and `pooled`, over all pairs; 95% bootstrap intervals over the truths, of the
differences as well. The copies without a map have no displacement: their distance is held against the share of the
points that the map had drawn. FRACTAL_EXP_LPIPS_SQUEEZE names the weights as well as the option does.
"""

from __future__ import annotations

import argparse
import os
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from fractal_exp.methods.chaotic import losses
from fractal_exp.methods.chaotic.ssim import local_statistics, ssim
from fractal_exp.perceptual import distances as perceptual
from fractal_exp.perceptual import fractal_features
from fractal_exp.runtime import threads
from fractal_exp.runtime.seeds import derive

from . import record
from .losses import library_lpips, milliseconds, random_features
from .perceptual_training import held_out
from .perceptual_training.scores import intervals, spearman

Distance = Callable[[Tensor, Tensor], Tensor]
RESULT = record.RESULTS / "perceptual.jsonl"


def measure(truths: list[held_out.Truth], resolution: int, distances: dict[str, Distance]) -> dict[str, dict]:
    """Each distance's correlations at a resolution."""
    moved = {name: np.empty((len(truths), len(truths[0].moved))) for name in distances}
    without: dict[str, list[float]] = {name: [] for name in distances}
    for row, truth in enumerate(tqdm(truths, f"{resolution}²", leave=False)):
        picture = held_out.draw(truth.code, resolution, derive(row, "truth") % 2**31)
        copies, lacking = (torch.stack([held_out.draw(copy.code, resolution, derive(row, kind, k) % 2**31)
                                        for k, copy in enumerate(group)])
                           for kind, group in (("moved", truth.moved), ("without", truth.without)))
        with torch.no_grad():
            for name, distance in distances.items():
                moved[name][row] = [float(distance(copy, picture)) for copy in copies]
                values = np.array([[float(distance(copy, picture)) for copy in lacking]])
                without[name].append(float(spearman(values, np.array([[c.size for c in truth.without]]))[0][0]))
    sizes = np.array([[copy.size for copy in truth.moved] for truth in truths])
    kinds = [copy.kind for copy in truths[0].moved]
    table = {}
    for name, values in moved.items():
        table[name] = intervals(values, sizes)
        if name != "fractal":
            table[name]["fractal above it"] = intervals(moved["fractal"], sizes, values)
        table[name]["removed"] = float(np.mean(without[name]))
        for kind in dict.fromkeys(kinds):
            chosen = [k for k, each in enumerate(kinds) if each == kind]
            table[name][f"pooled {kind}"] = spearman(values[:, chosen], sizes[:, chosen])[1]
    return table


def timings(weights: str | None, resolution: int, repeats: int) -> dict[str, float]:
    """Milliseconds, forward and backward, of one pair, and with the features of the target kept; load is from a file
    in the system's cache. LPIPS has random weights: they change no timing."""
    features = random_features("lpips_alex")
    with tempfile.TemporaryDirectory() as folder:
        torch.save(features, Path(folder) / "alex.pth")
        alex = perceptual.load("lpips_alex", Path(folder) / "alex.pth")
    start = time.perf_counter()
    own = perceptual.load("fractal", weights)
    found = {"load": 1e3 * (time.perf_counter() - start)}
    a, b = torch.rand(2, resolution, resolution, generator=torch.Generator().manual_seed(0))
    a.requires_grad_()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        library = library_lpips("lpips_alex", features)
    kept = {"fractal": own.features(b), "lpips_alex": alex.features(b)}
    found["fractal"] = milliseconds(lambda: own(a, b), [a], repeats)
    found["fractal, target kept"] = milliseconds(lambda: own.compare(own.features(a), kept["fractal"]), [a], repeats)
    found["lpips_alex, lpips package"] = milliseconds(lambda: library(a, b), [a], repeats)
    found["lpips_alex, this package"] = milliseconds(lambda: alex(a, b), [a], repeats)
    found["lpips_alex, this package, target kept"] = milliseconds(
        lambda: alex.compare(alex.features(a), kept["lpips_alex"]), [a], repeats)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=60, help="truths")
    parser.add_argument("--copies", type=int, default=20, help="moved copies of each")
    parser.add_argument("--seed", type=int, default=0, help="of the held-out codes")
    parser.add_argument("--resolutions", type=int, nargs="*", default=[64, 128, 256])
    parser.add_argument("--weights", help="of fractal (default: those in the package)")
    parser.add_argument("--lpips-squeeze", default=os.environ.get("FRACTAL_EXP_LPIPS_SQUEEZE"), metavar="FILE")
    parser.add_argument("--threads", type=int, nargs="+", default=sorted({1, min(2, threads.available())}),
                        help="of the timings; the last of them also draw")
    parser.add_argument("--repeats", type=int, default=30, help="of each timing, the fastest counts")
    parser.add_argument("--record", type=Path, metavar="FILE", default=RESULT, help="add a line of JSON to this file")
    args = parser.parse_args()
    if args.weights and not args.resolutions:
        parser.error("the cost of other weights would stand beside the correlations of those in the package; name "
                     "resolutions as well")
    distances: dict[str, Distance] = {"mse": losses.mse, "mip_mse": losses.mip_mse,
                                      "ssim": lambda a, b: 1 - ssim(a, b, local_statistics(b))}
    if args.lpips_squeeze:
        distances["lpips_squeeze"] = perceptual.load("lpips_squeeze", args.lpips_squeeze)
    distances["fractal"] = perceptual.load("fractal", args.weights)
    costs = {}
    for count in args.threads:
        threads.use(count)
        cost = costs[str(count)] = timings(args.weights, 256, args.repeats)
        print(f"{count} threads, torch {torch.__version__}; forward and backward of one 256² pair, milliseconds")
        for name, value in cost.items():
            print(f"  {name:40s} {value:8.2f}")
        print(f"  lpips_alex (lpips package) over fractal  {cost['lpips_alex, lpips package'] / cost['fractal']:8.1f}")
    if not args.resolutions:
        known = record.read(args.record)[-1]["figures"] if args.record.is_file() else {}
        write(args.record, known | {"milliseconds": costs, "timed with torch": torch.__version__})
        return
    truths = held_out.truths(args.count, args.copies, args.seed)
    tables = {}
    for resolution in args.resolutions:
        table = tables[str(resolution)] = measure(truths, resolution, distances)
        print(f"\n{resolution}², {args.count} truths, {args.copies} copies each\n"
              f"  {'':15s} {'within':24s} {'pooled':24s} removed")
        for name, row in table.items():
            shown = [f"{row[key][0]:.3f} [{row[key][1]:.3f}, {row[key][2]:.3f}]" for key in ("within", "pooled")]
            print(f"  {name:15s} {shown[0]:24s} {shown[1]:24s} {row['removed']:.3f}")
        for name, row in table.items():
            if above := row.get("fractal above it"):
                shown = [f"{above[key][0]:+.3f} [{above[key][1]:+.3f}, {above[key][2]:+.3f}]"
                         for key in ("within", "pooled")]
                print(f"  {'over ' + name:15s} {shown[0]:24s} {shown[1]:24s}")
    recipe = fractal_features.load(args.weights).recipe
    write(args.record, {"count": args.count, "copies": args.copies, "seed": args.seed, "torch": torch.__version__,
                        "timed with torch": torch.__version__, "recipe": recipe, "milliseconds": costs,
                        "spearman": tables})


def write(path: Path, facts: dict) -> None:
    record.append(path, "perceptual", facts, ratios(facts))


def ratios(facts: dict) -> dict[str, float]:
    """What LPIPS costs of what `fractal` costs, by the number of threads."""
    return {f"threads={count}: lpips_alex, lpips package / fractal": cost["lpips_alex, lpips package"] / cost["fractal"]
            for count, cost in facts["milliseconds"].items()}


if __name__ == "__main__":
    main()
