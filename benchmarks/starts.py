"""Collage search begun with the answer of the amortised network, paired with the search begun with random maps.

    python -m benchmarks.starts                     20 fractals of a suite on which nothing was chosen
    python -m benchmarks.starts --limit 5           at most 5 seconds of one core a fit
    python -m benchmarks.starts --report            the table of what has been fitted so far

The network's maps take the place of the first restart's random maps. The other restarts begin with random maps either
way. Every fit is a line of codes.jsonl in --output; what is there already is not fitted again.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import pandas as pd
from torch import Tensor
from tqdm import tqdm

from fractal_exp import suite
from fractal_exp.cameras.kinds import levels_of
from fractal_exp.evaluation import evaluate
from fractal_exp.evaluation.code_error import code_error
from fractal_exp.evaluation.summary import bootstrap_interval, without_empty
from fractal_exp.ifs.affine import from_code
from fractal_exp.ifs.code import IFS
from fractal_exp.images.levels import meaning_of
from fractal_exp.methods.amortized.method import Amortized
from fractal_exp.methods.base import CodeReconstruction
from fractal_exp.methods.collage.stages.base import SearchProblem
from fractal_exp.methods.collage.stages.measure import Restart
from fractal_exp.methods.collage.state import Candidate, State
from fractal_exp.runtime import threads

from . import archive
from .ablation import SEED
from .record import machine
from .searches import CoreTime, Given

OUTPUT = "benchmarks/results/collage_starts_{limit:g}s"
RANDOM, NETWORK = "random maps", "network"
SCORES = ["f1_box", "f1_frame", "exact", "seconds"]


def random_maps(image: Tensor, method: CoreTime) -> Given:
    """Nothing to go on from."""
    return Given(None)


def network(image: Tensor, method: CoreTime, guess: Callable[[Tensor], CodeReconstruction] | None = None) -> Given:
    """The first restart with the network's maps, moved and pruned on its measure, in place of random maps. guess: what
    finds them, if not the network."""
    code, params = (guess or Amortized().reconstruct)(image).code, method.params
    restart = Restart(SearchProblem(image, levels_of(image, meaning_of(image), params.camera), params, method.seed))
    given = State(current=Candidate(from_code(code).float(), None, math.inf))
    restart.open(given)
    return Given(State(current=restart.search.resume(given.now)).snapshot())


STARTS: dict[str, Callable[[Tensor, CoreTime], Given]] = {RANDOM: random_maps, NETWORK: network}


def fit(start: str, fractal: int, limit: float, resolution: int) -> dict:
    """Fit a fractal on one core, and judge the code. The time of the start is part of the limit."""
    threads.use(1)
    truth = archive.true_code(fractal, SEED)
    image = suite.target(truth, resolution, "grey")
    method = CoreTime(seconds=limit, previews=0, search={"proposals": 1})
    began = time.process_time()
    given = STARTS[start](image, method)
    method.seconds = max(limit - (time.process_time() - began), 0.1)
    code = method.reconstruct(image, checkpoint=given).code
    seconds = time.process_time() - began
    return {"start": start, "fractal": fractal, "suite": SEED, "limit": limit, "resolution": resolution,
            **judged(code, truth, resolution), "seconds": round(seconds, 2), "code": archive.plain(code),
            **archive.here(), "machine": machine(), "date": time.strftime("%Y-%m-%d")}


def judged(code: IFS, truth: IFS, resolution: int) -> dict:
    """F1 in the frame of the code's own box and in the frame of the input, and whether the code is exact."""
    boxed, framed = (without_empty(evaluate(code, truth, align=align, resolution=resolution))["f1"].mean()
                     for align in ("bbox", "none"))
    exact = code_error(code, truth, align="none", resolution=resolution).exact
    return {"f1_box": round(float(boxed), 4), "f1_frame": round(float(framed), 4), "exact": bool(exact)}


def check_same(fits: pd.DataFrame, limit: float, resolution: int, folder: Path) -> None:
    """End with an error if a folder holds fits of another limit or resolution: they cannot be paired."""
    for name, wanted in (("limit", limit), ("resolution", resolution)):
        other = set(fits.get(name, ())) - {wanted}
        if other:
            raise SystemExit(f"{folder} holds fits with --{name} {', '.join(f'{each:g}' for each in sorted(other))}, "
                             f"not {wanted:g}; name another folder with --output")


def report(folder: Path) -> str:
    """Means of both starts and their paired differences with 95% intervals, written to report.md."""
    fits = pd.DataFrame(archive.read_lines(folder / archive.CODES))
    if fits.empty or set(fits["start"]) != set(STARTS):
        raise SystemExit(f"{folder} does not hold fits with both starts yet")
    pairs = fits.pivot(index="fractal", columns="start", values=SCORES).astype(float).dropna()
    commits = sorted({commit[:9] for commit in fits["commit"]})
    lines = [f"{len(pairs)} fractals of the suite with seed {SEED}, at most {fits['limit'].max():g} s of one core a "
             f"fit; fitted by {', '.join(commits)}.", "",
             "| | begun with random maps | with the network's | difference |", "|---|---|---|---|"]
    for score in SCORES:
        random, net = pairs[score][RANDOM], pairs[score][NETWORK]
        low, high = bootstrap_interval((net - random).to_numpy())
        lines.append(f"| {score} | {random.mean():.3f} | {net.mean():.3f} | {(net - random).mean():+.3f} "
                     f"[{low:+.3f}, {high:+.3f}] |")
    text = "\n".join([*lines, ""])
    (folder / "report.md").write_text(text)
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=20, help="fractals")
    parser.add_argument("--limit", type=float, default=20, help="seconds of one core")
    parser.add_argument("--resolution", type=int, default=128, help="pixels a side of the targets")
    parser.add_argument("--workers", type=int, default=threads.available())
    parser.add_argument("--output", type=Path, help=f"folder of the fits (default: {OUTPUT})")
    parser.add_argument("--report", action="store_true", help="only write the table")
    args = parser.parse_args()
    folder = args.output or Path(OUTPUT.format(limit=args.limit))
    if not args.report:
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / archive.CODES
        check_same(pd.DataFrame(archive.read_lines(path)), args.limit, args.resolution, folder)
        done = {(fit["start"], fit["fractal"]) for fit in archive.read_lines(path)}
        jobs = [(start, fractal) for fractal in range(args.count) for start in STARTS]
        with ProcessPoolExecutor(args.workers, get_context("spawn")) as pool:
            running = [pool.submit(fit, *job, args.limit, args.resolution) for job in jobs if job not in done]
            for job in tqdm(as_completed(running), "fitting", len(running), unit="fit"):
                archive.append_line(path, job.result())
    print(report(folder))


if __name__ == "__main__":
    main()
