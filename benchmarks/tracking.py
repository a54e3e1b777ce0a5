"""What tracking costs a fit, and how long a report from a thousand runs takes.

    python -m benchmarks.tracking                 both
    python -m benchmarks.tracking --runs 100      a smaller store

The fit is the paper's at laptop scale, with series of every step, previews and checkpoints, once tracked and once not,
in turn; its processor seconds hold the thread that sends to the store. The store is SQLite, in a folder that goes.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import statistics
import tempfile
import time
from contextlib import redirect_stdout
from pathlib import Path

import numpy as np

from fractal_exp import codes, suite, tracking
from fractal_exp.cli.folders import FitFolder
from fractal_exp.cli.progress import Reporter
from fractal_exp.methods.chaotic.method import laptop
from fractal_exp.runtime import threads
from fractal_exp.runtime.checkpoint import Checkpoint
from fractal_exp.studies import report, writing
from fractal_exp.studies.published import TABLES
from fractal_exp.tracking import Tracker

CHECKPOINT_EVERY = 100  # iterations: oftener than a fit does


def fit_seconds(uri: str | None, folder: Path, iterations: int) -> tuple[float, float]:
    """Wall and processor seconds of a fit and of all that it tells a run (None: no run)."""
    method = laptop(iterations=iterations, starts=1)
    target = suite.target(codes.known("fern"), 256)
    run = tracking.start_run(uri, "overhead", "fit", folder=folder) if uri else Tracker()
    wall, processor = time.perf_counter(), time.process_time()
    with run, redirect_stdout(io.StringIO()), Reporter(run, FitFolder.open(folder, "fit")) as reporter:
        checkpoint = Checkpoint(folder / "checkpoint.safetensors", CHECKPOINT_EVERY, first=run.secure)
        method.reconstruct(target, on_step=reporter, checkpoint=checkpoint)
    return time.perf_counter() - wall, time.process_time() - processor


def fill(uri: str, folder: Path, runs: int) -> None:
    """A sweep of so many jobs, as `fractal-sweep ablations` leaves it, with random scores."""
    rows, rng = list(TABLES["ablations"].rows), np.random.default_rng(0)
    names = [f"{i},{rows[i % len(rows)]}" for i in range(runs)]
    tags = {"kind": "sweep", "sweep": "made-up", "scale": "laptop", "perceptual": "none"}
    with tracking.start_run(uri, "made-up", "made-up", folder=folder, tags=tags) as parent:
        parent.artifact("jobs.json", json.dumps(names))
        parent.artifact("sweep.json", json.dumps({"title": "Made up", "baseline": "full", "published": "ablations"}))
        for i, name in enumerate(names):
            tags = {"kind": "job", "job": name, "row": rows[i % len(rows)], "sample": f"fractal {i // len(rows)}"}
            params = {f"option{k}": k for k in range(60)}
            job = tracking.start_run(uri, "made-up", name, folder=folder, tags=tags, params=params,
                                     parent_run_id=parent.run_id)
            scores = {f"{prefix}{metric}": float(rng.random())
                      for prefix in ("eval/", "trivial/white_", "trivial/black_")
                      for metric in ("f1", "iou", "psnr", "ssim")}
            job.log(scores | {"time/fit_seconds": 60.0})
            job.log({f"train/{name}": 0.5 for name in ("loss", "mse", "ssim", "regularizer", "temperature")}, 800)
            for picture in ("result", "zoomed"):
                job.image(picture, rng.random((64, 64)).astype(np.float32))
            job.finish()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--iterations", type=int, default=300)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--runs", type=int, default=1000)
    args = parser.parse_args()
    threads.use()
    os.environ.pop("MLFLOW_TRACKING_URI", None)  # a server of yours is not to be filled
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        uri = tracking.prepare_store(folder)
        fit_seconds(uri, folder, 10)  # compiles, and imports mlflow
        pairs = [(fit_seconds(uri, folder, args.iterations), fit_seconds(None, folder, args.iterations))
                 for _ in range(args.repeats)]
        for number, name in enumerate(("wall", "processor")):
            tracked, alone = ([pair[k][number] for pair in pairs] for k in (0, 1))
            ratio = statistics.median(a / b for a, b in zip(tracked, alone, strict=True))
            print(f"{args.iterations} iterations, {name} seconds: {statistics.median(tracked):.2f} tracked, "
                  f"{statistics.median(alone):.2f} not: {100 * (ratio - 1):+.1f}%")
        fill(uri, folder, args.runs)
        start = time.perf_counter()
        writing.write(uri, report.read_sweep(uri, "made-up"), folder / "report")
        print(f"report from {args.runs} runs: {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main()
