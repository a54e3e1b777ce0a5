"""Collage search without each of its parts, paired on the same targets, under the same limit of time.

    python -m benchmarks.ablation                                   every part, on all three sets
    python -m benchmarks.ablation --without roots lines             these parts alone
    python -m benchmarks.ablation --sets suite --count 30           30 fractals of a suite on which nothing was chosen
    python -m benchmarks.ablation --report                          the table of what has been fitted so far

The parts are those of conf/without. The limit counts the seconds of one core that a fit has used, so that other work on
the machine makes no difference. Every fit is a JSON line of codes.jsonl in --output, with its scores; what is there
already is not fitted again. report.md there holds the table.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib import resources
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from tqdm import tqdm

from fractal_exp import codes, suite
from fractal_exp.evaluation import evaluate
from fractal_exp.evaluation.code_error import code_error
from fractal_exp.evaluation.summary import bootstrap_interval, without_empty
from fractal_exp.ifs.code import IFS
from fractal_exp.methods.collage.method import Collage
from fractal_exp.runtime import threads
from fractal_exp.runtime.deadline import Deadline

from . import archive
from .record import machine

FULL, SEED = "nothing", 20261123
SETS = {"suite": "grey", "classics": "grey", "binary": "binary"}   # and the kind of their targets
SCORES = ["f1_box", "f1_frame", "exact", "seconds"]
OUTPUT = "benchmarks/results/collage_ablation_{resolution}"


class CoreTime(Collage):
    """Collage search whose limit counts the seconds that a core has worked."""

    def deadline(self) -> Deadline:
        return Deadline(self.seconds, time.process_time)


def parts() -> list[str]:
    """The parts that can be left out, the whole first."""
    folder = resources.files("fractal_exp.conf") / "without"
    names = sorted(path.name.removesuffix(".yaml") for path in folder.iterdir())
    return [FULL, *(name for name in names if name != FULL)]


def options_without(part: str) -> dict:
    """The parameters that leave a part out."""
    text = (resources.files("fractal_exp.conf") / "without" / f"{part}.yaml").read_text()
    return (yaml.safe_load(text) or {}).get("method", {})


def problems(names: Iterable[str], count: int, classics: Sequence[str]) -> list[tuple[str, int | str]]:
    """(set, fractal) of every target."""
    every = {"suite": range(count), "classics": classics, "binary": range(10)}
    return [(name, fractal) for name in names for fractal in every[name]]


def fit(part: str, name: str, fractal: int | str, limit: float, resolution: int = 128) -> dict:
    """Fit one target on one core without a part, and judge the code."""
    threads.use(1)
    seed = None if isinstance(fractal, str) else SEED
    truth = archive.true_code(fractal, seed)
    image = suite.target(truth, resolution, SETS[name])
    options = options_without(part)
    options["search"] = {"proposals": 1} | options.get("search", {})  # one core, one neighbour at a time
    method = CoreTime(seconds=limit, previews=0, **options)
    start = time.process_time()
    code = method.reconstruct(image).code
    seconds = time.process_time() - start
    return {"without": part, "set": name, "fractal": fractal, "suite": seed, "limit": limit, "resolution": resolution,
            **judged(code, truth, resolution), "seconds": round(seconds, 2), "code": archive.plain(code),
            **archive.here(), "machine": machine(), "date": time.strftime("%Y-%m-%d")}


def judged(code: IFS, truth: IFS, resolution: int) -> dict:
    """F1 in the frame of the code's own box and in the frame of the input, and whether the code is exact."""
    boxed, framed = (without_empty(evaluate(code, truth, align=align, resolution=resolution))["f1"].mean()
                     for align in ("bbox", "none"))
    exact = code_error(code, truth, align="none", resolution=resolution).exact
    return {"f1_box": round(float(boxed), 4), "f1_frame": round(float(framed), 4), "exact": bool(exact)}


def read(folder: Path) -> pd.DataFrame:
    """What has been fitted so far."""
    path = folder / "codes.jsonl"
    lines = path.read_text().splitlines() if path.exists() else []
    return pd.DataFrame([json.loads(line) for line in lines], columns=None if lines else ["without", "set", "fractal"])


def check_same(fits: pd.DataFrame, limit: float, resolution: int, folder: Path) -> None:
    """End with an error if a folder holds fits of another limit or resolution: they cannot be paired."""
    for name, wanted in (("limit", limit), ("resolution", resolution)):
        other = set(fits.get(name, ())) - {wanted}
        if other:
            raise SystemExit(f"{folder} holds fits with --{name} {', '.join(f'{each:g}' for each in sorted(other))}, "
                             f"not {wanted:g}; name another folder with --output")


def table(fits: pd.DataFrame) -> pd.DataFrame:
    """A row for each part and set: its means, and their paired differences from the whole, with 95% intervals."""
    keys, rows = ["set", "fractal"], []
    whole = fits[fits["without"] == FULL].set_index(keys)[SCORES].astype(float)
    for (name, part), group in fits.groupby(["set", "without"], sort=False):
        each = group.set_index(keys)[SCORES].astype(float)
        pairs = each.merge(whole, left_index=True, right_index=True, suffixes=("", "_whole"))
        row = {"set": name, "without": part, "fits": len(pairs)}
        for score in SCORES:
            difference = (pairs[score] - pairs[f"{score}_whole"]).to_numpy()
            low, high = bootstrap_interval(difference)
            row |= {score: pairs[score].mean(), f"{score} difference": difference.mean() if len(pairs) else np.nan,
                    f"{score} low": low, f"{score} high": high}
        row["changed"] = int((pairs["f1_frame"] != pairs["f1_frame_whole"]).sum())
        rows.append(row)
    return pd.DataFrame(rows)


def report(folder: Path) -> str:
    """The tables as Markdown, written to report.md."""
    fits = read(folder)
    if fits.empty:
        raise SystemExit(f"{folder} holds no fits yet")
    limits, commits = sorted(set(fits["limit"])), sorted({str(commit)[:9] for commit in fits["commit"]})
    sides = ", ".join(f"{side}²" for side in sorted(set(fits["resolution"])))
    text = [f"Collage search without each part; targets of {sides}; at most "
            f"{', '.join(f'{each:g}' for each in limits)} s of one core a fit; fitted by {', '.join(commits)}.", ""]
    for name, rows in table(fits).groupby("set", sort=False):
        text += [f"### {name}", "", "| without | fits | changed | F1, own box | difference | F1, frame | difference | "
                 "exact | difference | seconds | difference |", "|" + "---|" * 11]
        text += [_line(row) for _, row in rows.iterrows()] + [""]
    (folder / "report.md").write_text("\n".join(text))
    return "\n".join(text)


def _line(row: pd.Series) -> str:
    cells = [row["without"], f"{row['fits']}", f"{row['changed']}"]
    for score, digits in zip(SCORES, (3, 3, 2, 1), strict=True):
        interval = "" if np.isnan(row[f"{score} low"]) else (
            f" [{row[f'{score} low']:+.{digits}f}, {row[f'{score} high']:+.{digits}f}]")
        whole = row["without"] == FULL
        cells += [f"{row[score]:.{digits}f}", "" if whole else f"{row[f'{score} difference']:+.{digits}f}{interval}"]
    return f"| {' | '.join(cells)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--without", nargs="+", choices=parts(), default=parts(), metavar="PART")
    parser.add_argument("--sets", nargs="+", choices=SETS, default=list(SETS))
    parser.add_argument("--count", type=int, default=30, help="fractals of the suite")
    parser.add_argument("--classics", nargs="+", choices=codes.names(), default=codes.names(), metavar="NAME",
                        help="these classics alone")
    parser.add_argument("--limit", type=float, default=20, help="seconds of one core")
    parser.add_argument("--resolution", type=int, default=128, help="pixels a side of the targets")
    parser.add_argument("--workers", type=int, default=threads.available())
    parser.add_argument("--output", type=Path, help=f"folder of the fits (default: {OUTPUT})")
    parser.add_argument("--report", action="store_true", help="only write the table")
    args = parser.parse_args()
    folder = args.output or Path(OUTPUT.format(resolution=args.resolution))
    if not args.report:
        folder.mkdir(parents=True, exist_ok=True)
        fits = read(folder)
        check_same(fits, args.limit, args.resolution, folder)
        done = set(fits[["without", "set", "fractal"]].itertuples(index=False, name=None))
        jobs = [(part, *problem) for problem in problems(args.sets, args.count, args.classics)
                for part in dict.fromkeys([FULL, *args.without])]
        with ProcessPoolExecutor(args.workers, get_context("spawn")) as pool:
            running = [pool.submit(fit, *job, args.limit, args.resolution) for job in jobs if job not in done]
            with open(folder / "codes.jsonl", "a") as file:
                for job in tqdm(as_completed(running), "fitting", len(running), unit="fit"):
                    file.write(json.dumps(job.result()) + "\n")
                    file.flush()
    print(report(folder))


if __name__ == "__main__":
    main()
