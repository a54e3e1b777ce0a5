"""One fractal through collage search, that of docs/images/stages.png: the code after each stage, beside the true one.

    python -m benchmarks.worked_example
    python -m benchmarks.worked_example --record benchmarks/results/worked_example.jsonl

A true map counts as found where a map of the code differs from it by at most 0.01 in every coefficient.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np

from fractal_exp import IFS, render, suite
from fractal_exp.evaluation.metrics import f1, inner_crop
from fractal_exp.ifs import attractor
from fractal_exp.methods import load
from fractal_exp.methods.base import Progress
from fractal_exp.runtime import threads

from . import record

SUITE_SEED, INDEX, RESOLUTION = 101, 7, 256
FOUND = 0.01


def rows(code: IFS) -> np.ndarray:
    """The maps (N,6), rows a b c d e f."""
    return np.concatenate([code.linear.reshape(-1, 4).numpy(), code.offset.numpy()], 1).astype(float)


def state(code: IFS, truth: IFS, image: Any) -> dict[str, Any]:
    """What a table tells about the code after a stage."""
    drawn = render(code, resolution=RESOLUTION, seed=1)
    found, true = rows(code), rows(truth)
    apart = np.abs(found[:, None] - true).max(2)
    largest = np.abs(np.linalg.det(truth.linear.numpy())).argmax()
    return {"maps": len(code), "found": int((apart.min(0) <= FOUND).sum()), "worst": float(apart.min(0).max()),
            "f1": float(f1(inner_crop(drawn)[None], inner_crop(image)[None])),
            "largest_map": found[apart[:, largest].argmin()].round(4).tolist(), "code": found.round(4).tolist()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    arguments = parser.parse_args()
    threads.use(1)
    truth = attractor.normalize(suite.random_suite(INDEX + 1, SUITE_SEED)[INDEX])
    found: list[tuple[str, float, IFS]] = []
    start = time.perf_counter()

    def keep(progress: Progress) -> None:
        if progress.code is not None:
            found.append((progress.stage, time.perf_counter() - start, progress.code))

    done = load("collage")(resolution=RESOLUTION).reconstruct(suite.target(truth, RESOLUTION), on_step=keep)
    image = render(truth, resolution=RESOLUTION, seed=0)
    stages = [{"stage": stage, "seconds": round(seconds, 1), **state(code, truth, image)}
              for stage, seconds, code in found]
    figures = {"suite": SUITE_SEED, "index": INDEX, "stopped": done.stopped, "stages": stages,
               "truth": state(truth, truth, image)}
    for each in [*stages, figures["truth"]]:
        print({key: value for key, value in each.items() if key != "code"})
    print(done.stopped)
    if arguments.record:
        record.append(arguments.record, "worked_example", figures, {"F1 at the end": stages[-1]["f1"]})


if __name__ == "__main__":
    main()
