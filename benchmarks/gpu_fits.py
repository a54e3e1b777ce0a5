"""The paper's method, or collage search, at the paper's sizes on the random suite, one after another until time is up.

    python -m benchmarks.gpu_fits --perceptual lpips_squeeze --weights PATH --seconds 540 --output codes
    python -m benchmarks.gpu_fits --method collage --seconds 540 --output codes_of_collage
    python -m benchmarks.gpu_fits --rehearse --output /tmp/codes

Every code is written as INDEX.json with its suite's seed, its seconds and its setting; the same command goes on with
those that are missing. Judge them wherever there is time: `fractal_exp.evaluation.evaluate(code, truth)`.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

from fractal_exp import IFS, suite
from fractal_exp.methods.base import Method
from fractal_exp.methods.collage.method import Collage

from .gpu import QUICK, TOYS, Sizes, paper_method, perceptual_term


def fit_one(index: int, sizes: Sizes, options: argparse.Namespace) -> IFS:
    """One fractal's reconstruction, with notes on how it was made."""
    truth = suite.random_suite(index + 1, options.suite_seed)[index]
    target = suite.target(truth, sizes.resolution, options.kind)
    method, notes = METHODS[options.method](sizes, options)
    start = time.perf_counter()
    code = method.reconstruct(target).code
    notes |= {"method": options.method, "suite_seed": options.suite_seed, "index": index, "kind": options.kind,
              "seed": options.seed, "resolution": sizes.resolution, "seconds": time.perf_counter() - start}
    return replace(code, meta=dict(code.meta) | notes)


def chaotic(sizes: Sizes, options: argparse.Namespace) -> tuple[Method, dict]:
    """The paper's method, and what to note of it."""
    term = perceptual_term(options.perceptual, options.weights)
    method = paper_method(sizes, term, options.iterations, seed=options.seed)
    return method, {"iterations": options.iterations, "perceptual": options.perceptual}


def collage(sizes: Sizes, options: argparse.Namespace) -> tuple[Method, dict]:
    """Collage search with its own settings."""
    small = QUICK if sizes == TOYS else {}
    return Collage(seed=options.seed, device=sizes.device, previews=0, **small), {}


METHODS = {"chaotic": chaotic, "collage": collage}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, required=True, help="folder of the codes")
    parser.add_argument("--method", choices=list(METHODS), default="chaotic")
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seconds", type=float, default=540, help="no fit is begun that would end later than this")
    parser.add_argument("--iterations", type=int, default=15_000)
    parser.add_argument("--seed", type=int, default=0, help="of the fits")
    parser.add_argument("--suite-seed", type=int, default=suite.SUITE_SEED)
    parser.add_argument("--kind", choices=["grey", "binary"], default="grey")
    parser.add_argument("--perceptual", default="none", help="none, lpips_alex, lpips_squeeze or lpips_vgg")
    parser.add_argument("--weights", help="file of its weights")
    parser.add_argument("--rehearse", action="store_true", help="on the CPU, at toy sizes")
    options = parser.parse_args()
    sizes, start, longest = TOYS if options.rehearse else Sizes(), time.monotonic(), 0.0
    options.output.mkdir(parents=True, exist_ok=True)
    for index in range(options.count):
        path = options.output / f"{index:03d}.json"
        begun = time.monotonic()
        if path.exists():
            continue
        if begun - start + longest > options.seconds:
            print("time is up")
            break
        fit_one(index, sizes, options).save(path)
        longest = max(longest, time.monotonic() - begun)
        print(f"{path} {time.monotonic() - begun:.1f} s", flush=True)


if __name__ == "__main__":
    main()
