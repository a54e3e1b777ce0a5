"""The methods that the paper compares with: a step by our operators, beside the same in plain torch.

    python -m benchmarks.rivals                      a minute
    python -m benchmarks.rivals --record benchmarks/results/rivals.jsonl

A generation draws 100 candidates of ten maps at 256² and compares them with the image; its twin plays and draws one
candidate after the other by the operators' plain-torch twins (timed on a few). An iteration of Learning Fractals is its
whole step, gradients and Adam included; its twin is the same step with the operators' plain-torch twins.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from torch import Tensor

from fractal_exp import suite
from fractal_exp.ifs.attractor import FRAME_SIDE
from fractal_exp.ifs.code import sampling_probabilities
from fractal_exp.methods.learning_fractals import method as learning
from fractal_exp.methods.population import cuckoo, evolutionary
from fractal_exp.methods.population.search import Canvas
from fractal_exp.methods.stepwise import Walk
from fractal_exp.ops.occupancy import occupancy
from fractal_exp.runtime import threads

from . import record
from .ops import timed

SIDE = 256
GOALS = {"generation": (0.25, 20.0), "iteration": (None, 5.0)}  # seconds, and times a plain-torch twin


def best(call: Callable[[], object], repeats: int) -> float:
    """Seconds, after one run that compiles."""
    call()
    return min(timed(call) for _ in range(repeats))


def generations(image: Tensor, candidates: int, repeats: int) -> list[dict]:
    """Of both population methods. The twin's candidates are played one after another."""
    walks: dict[str, Walk] = {
        "evolutionary": evolutionary.EvolutionaryWalk(image, evolutionary.EvolutionaryParams(), 0),
        "cuckoo": cuckoo.CuckooWalk(image, cuckoo.CuckooParams(), 0)}
    rows = []
    for name, walk in walks.items():
        state = walk.start()
        drawn = (walk.evaluations(1) - walk.evaluations(0)) // 100  # times that each of the hundred is drawn
        seconds = best(partial(walk.step, state, 0), repeats)
        canvas, maps = Canvas(image, cuckoo.CuckooParams(), 0), state["genome" if name == "evolutionary" else "nests"]
        twin = 100 * drawn * best(partial(one_by_one, canvas, maps[:candidates]), 1) / candidates
        rows.append({"step": f"generation of {name}", "drawings": 100 * drawn, "seconds": seconds,
                     "seconds_of_100": seconds / drawn, "twin_seconds": twin, "twin_ratio": twin / seconds})
    return rows


def one_by_one(canvas: Canvas, maps: Tensor) -> None:
    """Candidates in a plain loop of torch."""
    for one in maps:
        linear, offset = canvas.contracted(one[None])
        drawn = occupancy(linear, offset, SIDE, probabilities=sampling_probabilities(linear), frame=FRAME_SIDE,
                          points=SIDE**2, seed=canvas.seed, backend="torch").bool()
        (drawn & canvas.shape).sum(), drawn.sum()


def iterations(image: Tensor, repeats: int) -> list[dict]:
    """Of Learning Fractals on both canvases."""
    rows = []
    for params in (learning.LearningFractalsParams(), learning.LearningFractals256Params()):
        walk = learning.LearningFractalsWalk(image, params, 0)
        state = walk.start()
        seconds = best(partial(walk.step, state, 1), repeats)
        with plain_torch():
            twin = best(partial(walk.step, state, 1), 2)
        rows.append({"step": f"iteration of Learning Fractals at {params.side}²", "seconds": seconds,
                     "twin_seconds": twin, "twin_ratio": twin / seconds})
    return rows


@contextmanager
def plain_torch() -> Iterator[None]:
    """Learning Fractals with the twins of its operators."""
    ours = learning.sequence, learning.blob_error
    learning.sequence, learning.blob_error = (partial(each, backend="torch") for each in ours)
    try:
        yield
    finally:
        learning.sequence, learning.blob_error = ours


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=10)
    parser.add_argument("--candidates", type=int, default=5, help="of the plain loop that are timed")
    parser.add_argument("--threads", type=int, help="default: one a core")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    arguments = parser.parse_args()
    used = threads.use(arguments.threads)
    image = suite.target(suite.random_suite(1)[0], SIDE)
    rows = generations(image, arguments.candidates, arguments.repeats) + iterations(image, arguments.repeats)
    for row in rows:
        print(f"{row['step']}: {1e3 * row['seconds']:.1f} ms on {used} threads; plain torch "
              f"{row['twin_seconds']:.2f} s, {row['twin_ratio']:.1f} times slower")
    if arguments.record:
        record.append(arguments.record, "rivals", {"threads": used, "steps": rows}, ratios(rows))


def ratios(rows: list[dict]) -> dict[str, float]:
    """Of the steps' twins."""
    return {f"{row['step']}: twin / ours": row["twin_ratio"] for row in rows}


if __name__ == "__main__":
    main()
