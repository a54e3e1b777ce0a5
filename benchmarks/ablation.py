"""Collage search without each of its parts, paired on the same targets, over all kinds of pictures.

    python -m benchmarks.ablation                                    every part, on all sets
    python -m benchmarks.ablation --without roots lines              these parts alone
    python -m benchmarks.ablation --without roots+lines              both off at once
    python -m benchmarks.ablation --sets suite textbook_redrawn --count 8   eight pictures of each of these sets
    python -m benchmarks.ablation --sets trees --targets herb_5             this picture alone
    python -m benchmarks.ablation --report                           the table of what has been fitted so far

The parts are those of conf/without. A limit, where a set has one, counts the seconds of one core that a fit has used,
so that other work on the machine makes no difference; limits are so long that late parts have their time. Every fit is
a JSON line of codes.jsonl in --output, with its scores; what is there already is not fitted again. report.md there
holds the table.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from importlib import resources
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from tqdm import tqdm

from fractal_exp import codes, suite
from fractal_exp.evaluation import evaluate
from fractal_exp.evaluation.code_error import code_error
from fractal_exp.evaluation.summary import bootstrap_interval, without_empty
from fractal_exp.methods.collage.method import Collage
from fractal_exp.runtime import threads

from . import archive
from .record import machine
from .searches import CoreTime

FULL, SEED, HELD_OUT = "nothing", 20261123, 20261122   # seeds of suites on which nothing was chosen
SCORES = ["f1", "recovered", "seconds"]
OUTPUT = Path("benchmarks/results/collage_ablation")


@dataclass(frozen=True)
class Grey:
    """Grey targets of our own renderer. suite: the seed, None for classics; count: of fractals."""

    suite: int | None
    count: int
    resolution: int = 128
    limit: float | None = None

    def targets(self) -> list[int | str]:
        return codes.names()[:self.count] if self.suite is None else list(range(self.count))

    def fit(self, target: int | str, options: dict[str, Any]) -> dict[str, Any]:
        truth = archive.true_code(target, self.suite)
        image = suite.target(truth, self.resolution, "grey")
        method = CoreTime(seconds=self.limit, previews=0, **options)
        start = time.process_time()
        code = method.reconstruct(image).code
        seconds = time.process_time() - start
        f1 = without_empty(evaluate(code, truth, align="bbox", resolution=self.resolution))["f1"].mean()
        exact = code_error(code, truth, align="none", resolution=self.resolution).exact
        return {"f1": float(f1), "recovered": bool(exact), "seconds": seconds, "code": archive.plain(code)}


@dataclass(frozen=True)
class Drawn:
    """Pictures of a set of `benchmarks.pictures` for reporting. f1, recovered: the names of their scores."""

    name: str
    limit: float
    f1: str = "f1_truth"
    recovered: str = "recovered"
    count: int | None = None

    def targets(self) -> list[int | str]:
        from .pictures.sets import SETS

        return [name for name, role in SETS[self.name].roles().items() if role == "reporting"][:self.count]

    def fit(self, target: int | str, options: dict[str, Any]) -> dict[str, Any]:
        from .pictures import fitting

        Collage.deadline = CoreTime.deadline
        line = fitting.fit(self.name, str(target), fitting.Setting(self.limit, "core", options))
        if "error" in line:
            raise RuntimeError(f"{self.name} {target}: {line['error']}")
        return {"f1": line[self.f1], "recovered": line[self.recovered], "seconds": line["core_seconds"],
                "code": line["code"]}


SETS: dict[str, Grey | Drawn] = {
    "suite": Grey(SEED, 30), "held_out": Grey(HELD_OUT, 16), "classics": Grey(None, len(codes.names())),
    "binary": Drawn("binary", 120, "f1_box", "exact"), "textbook_redrawn": Drawn("textbook_redrawn", 120),
    "trees": Drawn("trees", 120), "tone_curves": Drawn("tone_curves", 120),
}


def parts() -> list[str]:
    """The parts that can be left out, the whole first."""
    folder = resources.files("fractal_exp.conf") / "without"
    names = sorted(path.name.removesuffix(".yaml") for path in folder.iterdir())
    return [FULL, *(name for name in names if name != FULL)]


def options_without(several: str) -> dict:
    """The parameters that leave out a part, or several joined by +."""
    options: dict[str, Any] = {}
    for part in several.split("+"):
        text = (resources.files("fractal_exp.conf") / "without" / f"{part}.yaml").read_text()
        options = merged(options, (yaml.safe_load(text) or {}).get("method", {}))
    return options


def merged(options: Mapping[str, Any], more: Mapping[str, Any]) -> dict[str, Any]:
    """Options with more of them, which win; components are merged field by field."""
    return {**options, **{name: merged(options.get(name, {}), value) if isinstance(value, Mapping) else value
                          for name, value in more.items()}}


def problems(names: Iterable[str], count: int | None, targets: Sequence[str] | None = None
             ) -> list[tuple[str, int | str]]:
    """(set, target) of every target, at most `count` of a set; targets: the names of those that are wanted."""
    return [(name, target) for name in names for target in SETS[name].targets()[:count]
            if targets is None or str(target) in targets]


def fit(without: str, name: str, target: int | str) -> dict:
    """Fit one target on one core without a part, and judge the code."""
    threads.use(1)
    chosen = SETS[name]
    options = merged({"search": {"proposals": 1}}, options_without(without))  # one core, one neighbour at a time
    found = chosen.fit(target, options)
    found |= {key: round(value, 4) for key, value in found.items() if isinstance(value, float)}
    return {"without": without, "set": name, "target": target, "limit": chosen.limit, **found,
            **archive.here(), "machine": machine(), "date": time.strftime("%Y-%m-%d")}


def read(folder: Path) -> pd.DataFrame:
    """What has been fitted so far."""
    lines = archive.read_lines(folder / archive.CODES)
    return pd.DataFrame(lines, columns=None if lines else ["without", "set", "target"])


def table(fits: pd.DataFrame) -> pd.DataFrame:
    """A row for each part and set: its means, and their paired differences from the whole, with 95% intervals."""
    keys, rows = ["set", "target"], []
    whole = fits[fits["without"] == FULL].set_index(keys)[SCORES].astype(float)
    for (name, part), group in fits.groupby(["set", "without"], sort=False):
        each = group.set_index(keys)[SCORES].astype(float)
        pairs = each.merge(whole, left_index=True, right_index=True, suffixes=("", "_whole"))
        row = {"set": name, "without": part, "fits": len(pairs)}
        for score in SCORES:
            difference = (pairs[score] - pairs[f"{score}_whole"]).to_numpy()
            low, high = bootstrap_interval(difference)
            row |= {score: pairs[score].mean(), f"{score} difference": difference.mean() if len(pairs) else np.nan,
                    f"{score} worst": difference.min() if len(pairs) else np.nan,
                    f"{score} low": low, f"{score} high": high}
        row["changed"] = int((pairs["f1"] != pairs["f1_whole"]).sum())
        rows.append(row)
    return pd.DataFrame(rows)


def report(folder: Path) -> str:
    """The table as Markdown, written to report.md."""
    fits = read(folder)
    if fits.empty:
        raise SystemExit(f"{folder} holds no fits yet")
    commits = sorted({str(commit)[:9] for commit in fits["commit"]})
    limits = ", ".join(f"{name} {SETS[name].limit or 'none'}" for name in dict.fromkeys(fits["set"]))
    text = [f"Collage search without each part; seconds of one core at most: {limits}; fitted by {', '.join(commits)}.",
            "F1: against the truth, by its own box for our own renderings. Recovered: the exact code for those, and an "
            "equivalent one for the others.", "",
            "| set | without | fits | changed | F1 | difference | worst | recovered | difference | seconds | "
            "difference |", "|" + "---|" * 11]
    text += [_line(row) for _, row in table(fits).iterrows()]
    (folder / "report.md").write_text("\n".join(text) + "\n")
    return "\n".join(text)


def _line(row: pd.Series) -> str:
    whole = row["without"] == FULL
    cells = [row["set"], row["without"], f"{row['fits']}", f"{row['changed']}"]
    for score, digits in zip(SCORES, (3, 2, 1), strict=True):
        interval = "" if np.isnan(row[f"{score} low"]) else (
            f" [{row[f'{score} low']:+.{digits}f}, {row[f'{score} high']:+.{digits}f}]")
        cells += [f"{row[score]:.{digits}f}", "" if whole else f"{row[f'{score} difference']:+.{digits}f}{interval}"]
        if score == "f1":
            cells.append("" if whole else f"{row['f1 worst']:+.3f}")
    return f"| {' | '.join(cells)} |"


def known(several: str) -> str:
    """The names of parts, joined by +; an error if one is unknown."""
    if unknown := set(several.split("+")) - set(parts()):
        raise argparse.ArgumentTypeError(f"there is no part {' or '.join(sorted(unknown))}; choose from "
                                         f"{', '.join(parts())}")
    return several


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--without", nargs="+", type=known, default=parts(), metavar="PART")
    parser.add_argument("--sets", nargs="+", choices=SETS, default=list(SETS))
    parser.add_argument("--count", type=int, help="the first targets of each set alone")
    parser.add_argument("--targets", nargs="+", metavar="TARGET", help="these targets alone")
    parser.add_argument("--workers", type=int, default=threads.available())
    parser.add_argument("--output", type=Path, default=OUTPUT, help=f"folder of the fits (default: {OUTPUT})")
    parser.add_argument("--report", action="store_true", help="only write the table")
    args = parser.parse_args()
    there = {str(target) for _, target in problems(args.sets, args.count)}
    if unknown := sorted(set(args.targets or ()) - there):
        parser.error(f"these sets have no target {', '.join(unknown)}; choose from {', '.join(sorted(there))}")
    if not args.report:
        args.output.mkdir(parents=True, exist_ok=True)
        done = set(read(args.output)[["without", "set", "target"]].itertuples(index=False, name=None))
        jobs = [(part, *problem) for problem in problems(args.sets, args.count, args.targets)
                for part in dict.fromkeys([FULL, *args.without])]
        with ProcessPoolExecutor(args.workers, get_context("spawn")) as pool:
            running = [pool.submit(fit, *job) for job in jobs if job not in done]
            for job in tqdm(as_completed(running), "fitting", len(running), unit="fit"):
                archive.append_line(args.output / archive.CODES, job.result())
    print(report(args.output))


if __name__ == "__main__":
    main()
