"""How well collage search does on fractals of the random suite, by stage: search, details, picture, last digits.

    python -m benchmarks.collage                             the hundred fractals of the published suite, grey
    python -m benchmarks.collage --kind binary --count 20    binary targets
    python -m benchmarks.collage --seed 7 --only 3 5 8       three fractals of another suite, to tune on
    python -m benchmarks.collage --classics                  the classic codes
    python -m benchmarks.collage --resolution 64 --count 10  smaller pictures, judged at the same size
    python -m benchmarks.collage --options '{"islands": 2}'  another setting of `methods.collage.Collage`

One process and one thread a fractal; its seconds are those that a core worked on it.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import replace
from multiprocessing import get_context
from pathlib import Path

import pandas as pd
from tqdm import tqdm

from fractal_exp import codes, suite, threads
from fractal_exp.evaluation import evaluate
from fractal_exp.evaluation.code_error import code_error
from fractal_exp.evaluation.summary import summarize
from fractal_exp.methods.collage import Collage

METRICS = ["f1", "iou", "psnr", "ssim"]
LAST_STAGES = "picture", "full size", "last digits"   # whose last round counts


def recover(fractal: int | str, seed: int, kind: str, resolution: int, options: dict, folder: Path) -> pd.DataFrame:
    """Invert a fractal of the suite, or a classic by name: a row for each stage, alignment and view."""
    threads.use(1)
    truth = codes.known(fractal) if isinstance(fractal, str) else suite.random_suite(fractal + 1, seed)[fractal]
    truth = replace(truth, probabilities=None)  # as targets are drawn
    image = suite.target(truth, resolution, kind)
    start, found = time.process_time(), {}

    def keep(progress) -> None:  # noqa: ANN001
        first_round = "picture" not in found
        if progress.code is not None and (first_round or progress.stage in LAST_STAGES):
            found[progress.stage] = progress, time.process_time() - start

    method = Collage(**{"proposals": 1, "previews": 0} | options)
    method.reconstruct(image, on_step=keep).code.save(folder / f"{seed}-{kind}-{fractal}.json")
    frames = []
    for stage, (progress, seconds) in found.items():
        for align in ("bbox", "none"):
            scores = evaluate(progress.code, truth, resolution=resolution, align=align)
            frames.append(scores.drop(columns="lpips").assign(
                fractal=fractal, stage=stage, align=align, seconds=seconds, true_maps=len(truth),
                maps=len(progress.code), score=progress.scalars["score"]))
    exact = code_error(progress.code, truth, resolution=resolution, align="none").exact
    return pd.concat(frames).assign(exact=exact)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--only", type=int, nargs="+", help="these fractals instead")
    parser.add_argument("--classics", action="store_true", help="the classic codes instead")
    parser.add_argument("--seed", type=int, default=suite.SUITE_SEED, help="of the suite (default: the published one)")
    parser.add_argument("--kind", choices=["grey", "binary"], default="grey")
    parser.add_argument("--resolution", type=int, default=256, help="of the target and of the views")
    parser.add_argument("--options", type=json.loads, default={}, help="of methods.collage.Collage, as JSON")
    parser.add_argument("--workers", type=int, default=threads.available())
    parser.add_argument("--output", type=Path, default=Path("outputs/collage"))
    parser.add_argument("--resume", action="store_true",
                        help="add what the table in --output, made with the same options, does not have yet")
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    path = args.output / f"{'classics' if args.classics else args.seed}-{args.kind}.csv"
    frames, start = [pd.read_csv(path)] if args.resume and path.exists() else [], time.perf_counter()
    fractals = codes.names() if args.classics else args.only or range(args.count)
    wanted = [each for each in fractals if not any((frame["fractal"] == each).any() for frame in frames)]
    with ProcessPoolExecutor(args.workers, get_context("spawn")) as pool:
        jobs = [pool.submit(recover, each, args.seed, args.kind, args.resolution, args.options, args.output)
                for each in wanted]
        for job in tqdm(as_completed(jobs), total=len(jobs)):
            frames.append(job.result())
            pd.concat(frames).sort_values("fractal", kind="stable").to_csv(path, index=False)
    table = pd.read_csv(path)
    which = "classics" if args.classics else f"fractals of suite {args.seed}"
    print(f"{table['fractal'].nunique()} {which}, {args.kind} targets; {len(wanted)} of them now, in "
          f"{time.perf_counter() - start:.0f} s")
    describe(table)


def describe(table: pd.DataFrame) -> None:
    """Print means with 95% intervals over the fractals by stage and alignment, and the last stage of each fractal."""
    for (align, stage), rows in table.groupby(["align", "stage"], sort=False):
        summary = summarize(rows[["fractal", "view", "zoom", *METRICS]])
        means = summary[summary["zoom_class"] == "all"].set_index("metric")
        scores = "  ".join(f"{name} {means['mean'][name]:.3f} [{means['low'][name]:.3f}, {means['high'][name]:.3f}]"
                           for name in METRICS)
        print(f"{align:5s}{stage:12s} {scores}  at the ceiling {summary.attrs['ceiling_fraction']:.0%}  "
              f"{rows['seconds'].mean():.0f} s (at most {rows['seconds'].max():.0f})")
    last = table[table["stage"] == table.groupby("fractal")["stage"].transform("last")]
    each = last.groupby(["fractal", "align"])
    wide = each[["f1"]].mean().unstack().set_axis(["f1 bbox", "f1 none"], axis=1)
    kept = last[last["align"] == "bbox"].groupby("fractal")
    numbers = kept[["true_maps", "maps", "score", "exact", "seconds"]].first()
    numbers = numbers.join(kept[["iou", "psnr", "ssim"]].mean())
    print(f"recovered exactly: {numbers['exact'].mean():.0%}")
    print(wide.join(numbers).round(3).to_string())


if __name__ == "__main__":
    main()
