"""What a GPU is asked first: one command that fills the minutes for which there is one.

    python -m benchmarks.gpu_plan --minutes 12 --weights PATH --output FOLDER   what has no answer yet, in order
    python -m benchmarks.gpu_plan --list --output FOLDER                        what that would be
    python -m benchmarks.gpu_plan --rehearse --output FOLDER                    on the CPU, at toy sizes

An item is one or more commands, run side by side. The first begins that will end in time, by what it took before or by
the plan's own guess. What runs on when time is up is ended, and a fit goes on from its checkpoint the next time. Each
answer is a record in FOLDER/plan.jsonl as soon as it is there, with device, versions and commit; an item is done once
it has one for today's kernels. Fits are in FOLDER/plan, and what an item printed is in FOLDER/logs.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import count, islice
from pathlib import Path
from typing import Any

from . import record
from .environment import ROOT

RECORDS, STUDY = "plan.jsonl", "plan"
GRACE = 20.0          # seconds that a command has to end once time is up, of the time that there is
MARGIN = 1.1          # factor on what an item took before
TOGETHER = 4          # fits at once
SHORT = 1500          # iterations of those
NEXT = 12             # items among which one is looked for that will end in time
FIT, SHORT_FIT = 3.2, 0.7   # minutes on an H200: 15 000 iterations took 157 s (benchmarks/results/gpu_h200); judging
TOYS = ["scale=smoke", "resolution=32", "iterations=6", "checkpoint_every=2", "anneal_every=3", "perceptual=none"]
# Rows of table 4 of the paper, those that cost the published method most first
ROWS = "no_mip", "no_gradients", "naive", "no_annealing", "no_ssim", "no_perceptual", "no_multisampling"


@dataclass(frozen=True)
class Item:
    """A question. why: what its answer decides; minutes: how long it may take; commands: the words after `python -m`
    of each command."""

    name: str
    why: str
    minutes: float
    commands: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Place:
    """Where items run: on a GPU, or as a rehearsal on the CPU. weights: a file of those of LPIPS on SqueezeNet."""

    folder: Path
    weights: Path | None = None
    is_rehearsal: bool = False

    def fit(self, name: str, *words: str) -> tuple[str, ...]:
        """The words of a fit at the paper's sizes."""
        device = "cpu" if self.is_rehearsal else "cuda"
        sizes = TOYS if self.is_rehearsal else ["scale=paper", "perceptual=lpips_squeeze",
                                                f"perceptual_weights={self.weights}", "checkpoint_every=1000"]
        return ("fractal_exp.cli", "train", "target=suite", *sizes, f"device={device}", f"evaluation.device={device}",
                f"output={self.folder}", f"study={STUDY}", f"name={name}", "tracking=none", "resume=true", *words)

    def measured(self, *parts: str) -> tuple[str, ...]:
        """The words of `benchmarks.gpu` for some of its parts."""
        end = ["--rehearse", "--perceptual", "none"] if self.is_rehearsal else ["--no-checks"]
        return "benchmarks.gpu", *end, "--only", *parts, "--json", str(self.folder / f"{parts[0]}.json")


def items(place: Place) -> Iterator[Item]:
    """All questions, the most urgent first, without end."""
    tests = ("tests/ops/test_cuda_gpu.py", "-m", "gpu", "-q", "-p", "no:cacheprovider")
    yield Item("tests", "everything else stands on them", 3, (("pytest", *tests),))

    def fit(name: str, why: str, *words: str) -> Item:
        return Item(name, why, FIT, (place.fit(name, *words),))

    yield fit("stretched_levels", "whether stretched mip levels reproduce the paper", "method=chaotic_released",
              "target.index=0", "loss.terms.perceptual.input_range=correct")
    yield fit("released-0", "whether the program's LPIPS, fed with [0,1], does", "method=chaotic_released",
              "target.index=0")
    yield fit("ours-0", "whether |det| + .01 in training and a matched target do", "method=chaotic_ours", "starts=1",
              "target.index=0")
    yield Item("operations", "how far each kernel is from its floor", 1.5, (place.measured("operations"),))
    yield Item("iteration", "the same of an iteration, launched one by one and replayed", 1, (
        place.measured("iteration"),))
    for number in (1, TOGETHER):
        names = [f"{number}_at_once-{k}" for k in range(number)]
        short = [] if place.is_rehearsal else [f"iterations={SHORT}"]
        yield Item(f"{number}_at_once", "how many fits fill the card", number * SHORT_FIT, tuple(
            place.fit(name, "method=chaotic_released", f"target.index={k}", *short) for k, name in enumerate(names)))
    for index in count(1):
        yield fit(f"released-{index}", "table 3", "method=chaotic_released", f"target.index={index}")
        row = ROWS[(index - 1) % len(ROWS)]
        yield fit(f"{row}-{index}", "table 4", "method=chaotic_released", f"ablation={row}", f"target.index={index}")


def kernels() -> str:
    """A digest of the CUDA kernels: answers by others are out of date."""
    sources = sorted((ROOT / "fractal_exp" / "ops").rglob("*cuda*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:12]


def answers(folder: Path) -> list[dict[str, Any]]:
    """The figures of all records so far, oldest first."""
    path = folder / RECORDS
    return [each["figures"] for each in record.read(path)] if path.exists() else []


def open_items(plan: Iterator[Item], known: Sequence[dict[str, Any]]) -> Iterator[Item]:
    """The items that have no answer by today's kernels; a test that fails and a command that stops are answers too."""
    done = {each["item"] for each in known if each["kernels"] == kernels() and each["ended"] != "time was up"}
    return (each for each in plan if each.name not in done)


def expected(item: Item, known: Sequence[dict[str, Any]]) -> float:
    """Seconds that an item may take: by what it took here when it came to its end, or by the plan's guess."""
    took = [each["seconds"] for each in known if each["item"] == item.name and each["ended"] != "time was up"]
    return MARGIN * took[-1] if took else 60 * item.minutes


def run(item: Item, place: Place, seconds: float) -> dict[str, Any]:
    """Run an item for so long at most; its figures: how it ended (`done`, `failed` or `time was up`), after how many
    seconds, the scores of its fits, and the last lines that each command printed."""
    logs = place.folder / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    start, running, files = time.monotonic(), [], []
    for number, words in enumerate(item.commands):
        files.append(logs / f"{item.name}-{number}.txt")
        with files[-1].open("w") as log:
            running.append(subprocess.Popen([sys.executable, "-m", *words], cwd=ROOT, stdout=log,
                                            stderr=subprocess.STDOUT))
    was_late = False
    for process in running:
        with suppress(subprocess.TimeoutExpired):
            process.wait(max(0.0, seconds - (time.monotonic() - start)))
    for process in (each for each in running if each.poll() is None):
        was_late = True
        process.send_signal(signal.SIGTERM)   # a fit keeps its checkpoint
    for process in running:
        try:
            process.wait(GRACE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    failed = any(process.returncode for process in running)
    return {"item": item.name, "kernels": kernels(), "ended": "time was up" if was_late else
            "failed" if failed else "done", "seconds": round(time.monotonic() - start, 1),
            "scores": _scores(item, place), "printed": [_tail(path) for path in files]}


def _scores(item: Item, place: Place) -> list[dict[str, float]]:
    """Those of the fits that have ended."""
    names = [word.removeprefix("name=") for words in item.commands for word in words if word.startswith("name=")]
    finished = [place.folder / STUDY / name / "finished.json" for name in names]
    return [json.loads(path.read_text())["scores"] for path in finished if path.exists()]


def _tail(path: Path) -> list[str]:
    return path.read_text(errors="replace").splitlines()[-10:]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=12, help="that there are (default: 12)")
    parser.add_argument("--output", type=Path, required=True, help="folder of the answers")
    parser.add_argument("--weights", type=Path, help="file of torchvision's SqueezeNet 1.1, for LPIPS")
    parser.add_argument("--items", type=int, help="the first items alone")
    parser.add_argument("--list", action="store_true", help="tell what would run")
    parser.add_argument("--rehearse", action="store_true", help="on the CPU, at toy sizes")
    options = parser.parse_args()
    end = time.monotonic() + 60 * options.minutes
    place = Place(options.output.absolute(), options.weights and options.weights.absolute(), options.rehearse)
    if not (options.rehearse or options.list) and (place.weights is None or not place.weights.is_file()):
        parser.error(f"--weights must name a file of torchvision's SqueezeNet 1.1, got {options.weights}")
    known, tried = answers(place.folder), set[str]()

    def due() -> list[Item]:
        """The next items."""
        plan = islice(items(place), options.items)
        return list(islice((each for each in open_items(plan, known) if each.name not in tried), NEXT))

    if options.list:
        for item in due():
            print(f"{item.name:20} {expected(item, known) / 60:4.1f} min  {item.why}")
        return
    while True:
        there_is = end - time.monotonic() - GRACE
        item = next((each for each in due() if expected(each, known) <= there_is), None)
        if item is None:
            break
        tried.add(item.name)
        print(f"{item.name}: {item.why}; {expected(item, known):.0f} s at most", flush=True)
        found = run(item, place, there_is)
        record.append(place.folder / RECORDS, "gpu_plan", found, {}, "cpu" if place.is_rehearsal else "cuda")
        told = found["scores"] or found["printed"][0][-1:]
        print(f"  {found['ended']} after {found['seconds']} s  {told}", flush=True)
    print(f"left for another time: {', '.join(each.name for each in due()) or 'nothing'}")


if __name__ == "__main__":
    main()
