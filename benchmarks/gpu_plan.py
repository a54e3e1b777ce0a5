"""What a GPU is asked first: one command that fills the minutes for which there is one.

    python -m benchmarks.gpu_plan --minutes 9 --weights PATH --output FOLDER    what has no answer yet, in order
    python -m benchmarks.gpu_plan --list --output FOLDER                        what that would be
    python -m benchmarks.gpu_plan --rehearse --output FOLDER                    on the CPU, at toy sizes

An item is one or more commands, run side by side. The first begins that will end in time, by what it took before or by
the plan's own guess; one that takes twice as long is ended. A fit that was ended goes on from its checkpoint the next
time, if FOLDER and PATH are where they were. Each answer is a record in FOLDER/plan.jsonl as soon as it is there, with
device, versions and commit; an item is done once it has one for today's kernels. Two failures in a row end the plan:
the machine lacks something. Fits are in FOLDER/plan-KERNELS, what an item printed is in FOLDER/logs, and a rehearsal is
in FOLDER/rehearsal.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from itertools import count, islice
from pathlib import Path
from typing import Any

import torch

from . import record
from .environment import ROOT

RECORDS = "plan.jsonl"
DONE, FAILED, CUT_SHORT = "done", "failed", "time was up"   # how an item ended
FAILURES = 2          # in a row, after which the plan ends
GRACE = 20.0          # seconds that the commands of an item have to end once time is up, of the time that there is
MARGIN = 1.1          # factor on what an item took before
AT_MOST = 2.0         # factor on the time that is expected, after which an item is ended
TOGETHER = 4          # fits at once
SHORT = 1500          # iterations of those
NEXT = 12             # items among which one is looked for that will end in time
# Minutes on an H200, judging included, by benchmarks/results/gpu_h200: 15 000 iterations took 157 s, and an iteration
# of which no CUDA graph can be made takes 17 ms
FIT, SHORT_FIT, UNRECORDED_FIT = 3.2, 0.7, 5.5
TOYS = ["scale=smoke", "resolution=32", "iterations=6", "checkpoint_every=2", "anneal_every=3", "perceptual=none"]
# Rows of table 4 of the paper, those that cost the published method most F1 first
ROWS = ("no_mip", "no_gradients", "moments", "no_perceptual", "no_multisampling", "noisy_gradients", "naive",
        "no_annealing", "no_regularizer", "no_ssim")
UNRECORDED = {"naive", "noisy_gradients"}   # those of which no CUDA graph can be made


@dataclass(frozen=True)
class Item:
    """A question. why: what its answer decides; minutes: how long it may take; commands: the words after `python -m`
    of each command; file: of the JSON that they write, if they do."""

    name: str
    why: str
    minutes: float
    commands: tuple[tuple[str, ...], ...]
    file: Path | None = None


@dataclass(frozen=True)
class Place:
    """Where items run: on a GPU, or as a rehearsal on the CPU. weights: a file of those of LPIPS on SqueezeNet."""

    folder: Path
    weights: Path | None = None
    is_rehearsal: bool = False

    @property
    def fits(self) -> Path:
        """The folder of the fits by today's kernels."""
        return self.folder / f"plan-{kernels()}"

    def fit(self, name: str, *words: str) -> tuple[str, ...]:
        """The words of a fit at the paper's sizes."""
        device = "cpu" if self.is_rehearsal else "cuda"
        sizes = TOYS if self.is_rehearsal else ["scale=paper", "perceptual=lpips_squeeze",
                                                f"perceptual_weights={self.weights}", "checkpoint_every=1000"]
        return ("fractal_exp.cli", "train", "target=suite", *sizes, f"device={device}", f"evaluation.device={device}",
                f"output={self.folder}", f"study={self.fits.name}", f"name={name}", "tracking=none", "resume=true",
                *words)

    def measured(self, part: str, why: str, minutes: float) -> Item:
        """A part of `benchmarks.gpu`."""
        file, rehearsed = self.folder / f"{part}.json", ["--rehearse"] if self.is_rehearsal else []
        return Item(part, why, minutes, (("benchmarks.gpu", "--only", part, "--perceptual", "none", "--json", str(file),
                                          *rehearsed),), file)


def items(place: Place) -> Iterator[Item]:
    """All questions, the most urgent first, without end."""
    def fit(name: str, why: str, *words: str, minutes: float = FIT) -> Item:
        return Item(name, why, minutes, (place.fit(name, *words),))

    yield place.measured("checks", "everything else stands on these tests", 3)
    yield fit("stretched-0", "whether the paper's text with stretched mip levels reproduces it",
              "method=chaotic_written", "loss.terms.mse.stretch=true", "target.index=0")
    yield fit("released-0", "whether the released program does", "method=chaotic_released", "target.index=0")
    yield fit("area-0", "whether |det| + .01 in training and a matched target do", "method=chaotic_written",
              "model.probabilities=area", "match_target=true", "target.index=0", minutes=UNRECORDED_FIT)
    yield place.measured("operations", "how far each kernel is from its floor", 1.5)
    yield place.measured("iteration", "the same of an iteration, launched one by one and replayed", 1)
    for number in (1, TOGETHER):
        short = [] if place.is_rehearsal else [f"iterations={SHORT}"]
        yield Item(f"{number}_at_once", "how many fits fill the card", number * SHORT_FIT, tuple(
            place.fit(f"{number}_at_once-{k}", "method=chaotic_released", f"target.index={k}", "resume=false", *short)
            for k in range(number)))
    for index in count(1):
        yield fit(f"released-{index}", "table 3", "method=chaotic_released", f"target.index={index}")
        row = ROWS[(index - 1) % len(ROWS)]
        yield fit(f"{row}-{index}", "table 4", "method=chaotic_released", f"ablation={row}", f"target.index={index}",
                  minutes=UNRECORDED_FIT if row in UNRECORDED else FIT)


@cache
def kernels() -> str:
    """A digest of the CUDA kernels: answers by others are out of date."""
    sources = sorted((ROOT / "fractal_exp" / "ops").rglob("*cuda*.py"))
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()[:12]


def answers(folder: Path) -> list[dict[str, Any]]:
    """The figures of all records so far, oldest first."""
    path = folder / RECORDS
    return [each["figures"] for each in record.read(path)] if path.exists() else []


def open_items(plan: Iterable[Item], known: Sequence[dict[str, Any]]) -> Iterator[Item]:
    """The items that have no answer by today's kernels. Tests that fail are an answer, too."""
    done = {each["item"] for each in known if each["kernels"] == kernels() and (
        each["ended"] == DONE or each["ended"] == FAILED and each["item"] == "checks")}
    return (each for each in plan if each.name not in done)


def expected(item: Item, known: Sequence[dict[str, Any]]) -> float:
    """Seconds that an item may take: by what it took here when it came to its end, or by the plan's guess."""
    took = [each["seconds"] for each in known if each["item"] == item.name and each["ended"] == DONE]
    return MARGIN * took[-1] if took else 60 * item.minutes


def run(item: Item, place: Place, seconds: float) -> dict[str, Any]:
    """Run an item for so long at most; its figures: how it ended, after how many seconds, the scores of its fits, what
    it measured, and the last lines that each command printed."""
    logs = place.folder / "logs"
    logs.mkdir(parents=True, exist_ok=True)
    start, running = time.monotonic(), list[subprocess.Popen]()
    files = [logs / f"{item.name}-{number}.txt" for number in range(len(item.commands))]
    try:
        for words, file in zip(item.commands, files, strict=True):
            with file.open("w") as log:
                running.append(subprocess.Popen([sys.executable, "-m", *words], cwd=ROOT, stdout=log,
                                                stderr=subprocess.STDOUT))
        _wait(running, start + seconds)
        late = [process for process in running if process.poll() is None]
        for process in late:
            process.terminate()   # a fit keeps its checkpoint
        _wait(late, start + seconds + GRACE)
    finally:
        for process in running:
            process.kill()
            process.wait()
    ended = CUT_SHORT if late else FAILED if any(process.returncode for process in running) else DONE
    measured = json.loads(item.file.read_text()) if item.file is not None and item.file.exists() else None
    return {"item": item.name, "kernels": kernels(), "ended": ended, "seconds": round(time.monotonic() - start, 1),
            "scores": _scores(item, place) if ended == DONE else [], "measured": measured,
            "printed": [file.read_text(errors="replace").splitlines()[-10:] for file in files]}


def _wait(running: Sequence[subprocess.Popen], until: float) -> None:
    """Until all have ended, or until this time of the clock."""
    for process in running:
        with suppress(subprocess.TimeoutExpired):
            process.wait(max(0.0, until - time.monotonic()))


def _scores(item: Item, place: Place) -> list[dict[str, float]]:
    """Those of its fits."""
    names = [word.removeprefix("name=") for words in item.commands for word in words if word.startswith("name=")]
    return [json.loads((place.fits / name / "finished.json").read_text())["scores"] for name in names]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=9, help="that there are (default: 9)")
    parser.add_argument("--output", type=Path, required=True, help="folder of the answers")
    parser.add_argument("--weights", type=Path, help="file of torchvision's SqueezeNet 1.1, for LPIPS")
    parser.add_argument("--items", type=int, help="the first items alone")
    parser.add_argument("--list", action="store_true", help="tell what would run")
    parser.add_argument("--rehearse", action="store_true", help="on the CPU, at toy sizes")
    options = parser.parse_args()
    end = time.monotonic() + 60 * options.minutes
    folder = options.output.absolute()
    place = Place(folder / "rehearsal" if options.rehearse else folder, options.weights and options.weights.absolute(),
                  options.rehearse)
    known, tried, failures = answers(place.folder), set[str](), 0

    def due() -> list[Item]:
        """The next items."""
        plan = islice(items(place), options.items)
        return list(islice((each for each in open_items(plan, known) if each.name not in tried), NEXT))

    if options.list:
        for item in due():
            print(f"{item.name:20} {expected(item, known) / 60:4.1f} min  {item.why}")
        return
    if not options.rehearse and (place.weights is None or not place.weights.is_file()):
        parser.error(f"--weights must name a file of torchvision's SqueezeNet 1.1, got {options.weights}")
    if not options.rehearse and not torch.cuda.is_available():
        parser.error("torch sees no GPU here; --rehearse runs the plan on the CPU")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit("the plan was ended"))   # and so are its commands
    while failures < FAILURES:
        there_is = end - time.monotonic() - GRACE
        item = next((each for each in due() if expected(each, known) <= there_is), None)
        if item is None:
            break
        tried.add(item.name)
        needed = expected(item, known)
        print(f"{item.name}: {item.why}; {needed:.0f} s", flush=True)
        found = run(item, place, min(there_is, AT_MOST * needed))
        record.append(place.folder / RECORDS, "gpu_plan", found, {}, "cpu" if place.is_rehearsal else "cuda")
        failures = failures + 1 if found["ended"] == FAILED else 0
        told = found["scores"] or ("" if found["measured"] else found["printed"][0][-1:])
        print(f"  {found['ended']} after {found['seconds']} s  {told}", flush=True)
    if failures == FAILURES:
        sys.exit(f"{failures} items failed in a row; see {place.folder / 'logs'}")
    print(f"left for another time: {', '.join(each.name for each in due()) or 'nothing'}")


if __name__ == "__main__":
    main()
