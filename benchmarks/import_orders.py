"""What it costs to import torch before the package, and whether it matters who sets torch's threads.

    python -m benchmarks.import_orders --record benchmarks/results/import_orders.jsonl

Every measurement is a process of its own. In each round every order is measured once, so that whatever else the machine
does falls on all of them. Timed are a chaos game of 2000 x 250, a torch operation on a million numbers, and both in
turns, by the clock and in processor time, which counts threads that spin; alone, and beside processes that keep half of
the cores busy. The time of a process is the lower quartile of its repetitions. It is divided by the median over the
orders of its round. The ratio of an order is the geometric mean over the rounds, with a 95% interval: single processes
are slower by half now and then, whatever their order.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from fractal_exp.evaluation.summary import bootstrap_interval

from . import record
from .environment import ROOT

STATES = "alone", "beside a busy process"
ORDERS = {
    "package, torch": "import fractal_exp, torch",
    "torch, package": "import torch, fractal_exp",
    "torch, threads, package": "import torch; torch.set_num_threads({cores}); import fractal_exp",
    "package, torch, threads": "import fractal_exp, torch; torch.set_num_threads({cores})",
    "numba, torch, package": "import numba, torch, fractal_exp",
}
WORK = """
import json, statistics, time
from fractal_exp import ops
generator = torch.Generator().manual_seed(0)
code = 0.4 * torch.rand(10, 2, 2, generator=generator), torch.rand(10, 2, generator=generator)
numbers, room = torch.rand(2, 1 << 20, generator=generator)  # memory of its own would be timed, too
def game(): ops.chaos_game(*code, seed=1)
def operation(): torch.add(numbers, 1, out=room).sum()
def both(): game(), operation()
def time_of(call, clock):
    start = clock()
    call()
    return clock() - start
both()
print(json.dumps({call.__name__ + name: 1e3 * statistics.quantiles([time_of(call, clock) for _ in range(REPEATS)])[0]
                  for name, clock in (("", time.perf_counter), (", processor", time.process_time))
                  for call in (game, operation, both)}))
"""


def measure(order: str, repeats: int) -> dict[str, float]:
    """Milliseconds by kind of work, of one process."""
    program = ORDERS[order].format(cores=os.cpu_count()) + WORK.replace("REPEATS", str(repeats))
    clean = {k: v for k, v in os.environ.items() if k not in ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")}
    done = subprocess.run([sys.executable, "-c", program], env=clean, cwd=ROOT, capture_output=True, text=True,
                          check=True)
    return json.loads(done.stdout)


@contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """So many processes that compute all the while."""
    others = [subprocess.Popen([sys.executable, "-c", "while True: sum(range(100000))"]) for _ in range(count)]
    try:
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def ratios(rounds: list[dict[str, dict[str, float]]]) -> dict[str, dict[str, list[float]]]:
    """By kind of work and order: the ratio to the usual time of a round, and the ends of its interval."""
    result: dict[str, dict[str, list[float]]] = {}
    for kind in next(iter(rounds[0].values())):
        times = np.array([[each[order][kind] for order in ORDERS] for each in rounds])
        logs = np.log(times / np.median(times, axis=1, keepdims=True))
        result[kind] = {order: [float(np.exp(value)) for value in (column.mean(), *bootstrap_interval(column))]
                        for order, column in zip(ORDERS, logs.T, strict=True)}
    return result


def worst(report: dict) -> dict[str, float]:
    """The ratio of the slowest order to the fastest, by state and kind of work."""
    result = {}
    for state in STATES:
        for kind, by_order in report[state]["ratio"].items():
            ratios = [ratio for ratio, *_ in by_order.values()]
            result[f"{kind}, {state}: slowest / fastest order"] = max(ratios) / min(ratios)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=12, help="processes of each order (default 12)")
    parser.add_argument("--repeats", type=int, default=60, help="repetitions in each (default 60)")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    arguments = parser.parse_args()

    report = {"load_before": os.getloadavg()[0]}
    for state, others in zip(STATES, (0, max(1, (os.cpu_count() or 2) // 2)), strict=True):
        with busy_processes(others):
            rounds = [{order: measure(order, arguments.repeats) for order in ORDERS} for _ in range(arguments.rounds)]
        report[state] = {"ratio": ratios(rounds), "milliseconds": rounds}
        for kind, by_order in report[state]["ratio"].items():
            print(f"{state}, {kind}: " + "; ".join(
                f"{order} {ratio:.2f} [{low:.2f}, {high:.2f}]" for order, (ratio, low, high) in by_order.items()))
    for name, ratio in worst(report).items():
        print(f"{name} {ratio:.2f}")
    if arguments.record:
        record.append(arguments.record, "import_orders", report, worst(report))


if __name__ == "__main__":
    main()
