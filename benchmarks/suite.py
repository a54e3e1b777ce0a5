"""Fit the random suite, or the classic codes, by one method; keep every recovered code and judge it.

    python -m benchmarks.suite collage                           the hundred fractals of the random suite, grey
    python -m benchmarks.suite collage --kind binary --count 20  binary targets
    python -m benchmarks.suite collage --seed 7 --only 3 5 8     three fractals of another suite, to tune on
    python -m benchmarks.suite collage --classics                the classic codes
    python -m benchmarks.suite collage --options '{"rounds": 1}'   another setting of collage search
    python -m benchmarks.suite chaotic --count 10                the paper's method at laptop scale
    python -m benchmarks.suite chaotic --init collage            the same, begun with what collage search finds

One process and one thread a fractal; its seconds are those that a core worked on it, but for the compilation of
kernels. The codes are kept in --output (`benchmarks.archive`), and what is there already is not fitted again.
`benchmarks.judge` scores them.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from tqdm import tqdm

from fractal_exp import codes, suite
from fractal_exp.methods import METHODS, load
from fractal_exp.methods.base import Method
from fractal_exp.methods.chaotic.method import laptop
from fractal_exp.methods.collage.method import Collage
from fractal_exp.runtime import threads
from fractal_exp.runtime.deadline import core_seconds

from . import archive, judge


def collage(options: dict, init: str | None) -> Method:
    """Collage search on one core."""
    if init:
        raise SystemExit("--init is for the paper's method: collage search begins with nothing")
    return Collage(**{"previews": 0} | options)


def chaotic(options: dict, init: str | None) -> Method:
    """The paper's method at laptop scale."""
    return laptop(**options, init=load(init)(seed=options.get("seed", 0)) if init else None)


FITTERS: dict[str, Callable[[dict, str | None], Method]] = {"collage": collage, "chaotic": chaotic}


def fit(fractal: int | str, seed: int | None, kind: str, resolution: int, method: str, options: dict,
        init: str | None) -> archive.Fit:
    """Fit one fractal on one core."""
    threads.use(1)
    stages = {}

    def keep(progress) -> None:  # noqa: ANN001
        if progress.code is not None:  # the last code of a stage stands for it, whatever the round
            stages[progress.stage] = archive.Stage(progress.stage, round(core_seconds() - start, 2), progress.code)

    truth = archive.true_code(fractal, seed)
    image = suite.target(truth, resolution, kind)
    start = core_seconds()
    code = FITTERS[method](options, init).reconstruct(image, on_step=keep).code
    seconds = round(core_seconds() - start, 2)
    settings = options | ({"init": init} if init else {})
    return archive.Fit(fractal, seed, kind, resolution, method, settings, seconds, code, tuple(stages.values()),
                       **archive.here())


def default_folder(method: str, seed: int | None, kind: str) -> Path:
    """Where a run is kept unless told otherwise; seed: of the suite, None for the classics."""
    return Path("outputs/benchmarks") / f"{method}_{'classics' if seed is None else seed}_{kind}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("method", choices=FITTERS)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--only", type=int, nargs="+", help="these fractals instead")
    parser.add_argument("--classics", action="store_true", help="the classic codes instead")
    parser.add_argument("--seed", type=int, default=suite.SUITE_SEED, help="of the suite (default: 2025)")
    parser.add_argument("--kind", choices=suite.TARGET_KINDS, default="grey")
    parser.add_argument("--resolution", type=int, default=256, help="of the target and of the views")
    parser.add_argument("--options", type=json.loads, default={}, help="of the method, as JSON")
    parser.add_argument("--init", choices=sorted(METHODS.keys() - {"chaotic"}), help="a method to begin with")
    parser.add_argument("--workers", type=int, default=threads.available())
    parser.add_argument("--output", type=Path, help="folder of the run (default: outputs/benchmarks/METHOD_SUITE_KIND)")
    args = parser.parse_args()
    seed = None if args.classics else args.seed
    folder = args.output or default_folder(args.method, seed, args.kind)
    settings = args.options | ({"init": args.init} if args.init else {})
    for old in archive.read(folder):
        if (old.suite, old.kind, old.resolution, old.method, old.options) != (
                seed, args.kind, args.resolution, args.method, settings):
            raise SystemExit(f"{folder} holds another run (suite {old.suite}, {old.kind}, {old.resolution}², "
                             f"{old.method} with {old.options}); name another folder with --output")
    wanted = archive.missing(folder, codes.names() if args.classics else args.only or range(args.count))
    with ProcessPoolExecutor(args.workers, get_context("spawn")) as pool:
        jobs = [pool.submit(fit, each, seed, args.kind, args.resolution, args.method, args.options, args.init)
                for each in wanted]
        for job in tqdm(as_completed(jobs), "fitting", len(jobs), unit="fractal"):
            archive.append(folder, job.result())
    judge.run(folder, args.workers)


if __name__ == "__main__":
    main()
