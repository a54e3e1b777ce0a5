"""Judge the codes of published runs again, without fitting again.

    python -m benchmarks.judge benchmarks/results/collage_2025_grey [MORE FOLDERS]
    python -m benchmarks.judge --stages benchmarks/results/collage_2025_grey    the code after each stage as well

Each code is judged on the attractor's views in both frames, and on the released views, beside which the published rows
stand. Written into the folder: per_view.csv, a row a view, and report.txt, which is printed as well.
"""

from __future__ import annotations

import argparse
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

import pandas as pd
from tqdm import tqdm

from fractal_exp.evaluation import evaluate, summarize
from fractal_exp.evaluation.code_error import code_error
from fractal_exp.evaluation.scoring import TRIVIAL
from fractal_exp.evaluation.summary import describe
from fractal_exp.runtime import threads

from . import archive
from .environment import environment

METRICS = ["f1", "iou", "psnr", "ssim"]
FRAMES = {"frame of its own box": "bbox", "frame of the input": "none"}
PROTOCOLS = [("attractor", "bbox"), ("attractor", "none"), ("released", "bbox")]
RESULT, CEILING = "result", "truth, drawn anew"


def judge(fit: archive.Fit, stages: bool = False) -> pd.DataFrame:
    """The per-view table of one fit: a row for each protocol, thing drawn (result, truth, trivial images) and view.

    Whether the code is exact, or another code of the same attractor, is told in the frame of the input.
    """
    threads.use(1)
    size = {"resolution": fit.resolution}
    stages_too = {f"after {stage.name}": stage.code for stage in fit.stages} if stages else {}
    tables = {}
    for views, align in PROTOCOLS:
        drawn = {RESULT: fit.code, **stages_too, CEILING: fit.truth, **TRIVIAL}
        tables |= {(views, align, name): evaluate(thing, fit.truth, views=views, align=align, **size)
                   for name, thing in drawn.items() if align == "bbox" or name not in (CEILING, *TRIVIAL)}
    error = code_error(fit.code, fit.truth, align="none", **size)
    equivalent = error.equivalent(tables["attractor", "none", RESULT], tables["attractor", "bbox", CEILING])
    frames = [table.drop(columns="lpips").assign(views=views, align=align, method=name)
              for (views, align, name), table in tables.items()]
    return pd.concat(frames).assign(fractal=fit.fractal, seconds=fit.seconds, true_maps=len(fit.truth),
                                    maps=len(fit.code), exact=error.exact, equivalent=equivalent)


def run(folder: Path, workers: int, stages: bool = False) -> None:
    """Judge all fits of a run; write and print what came out."""
    fits = archive.read(folder)
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        jobs = [pool.submit(judge, fit, stages) for fit in fits]
        tables = [job.result() for job in tqdm(as_completed(jobs), "judging", len(jobs), unit="code")]
    table = pd.concat(tables).sort_values("fractal", kind="stable")
    table.to_csv(folder / "per_view.csv", index=False, float_format="%.5g")
    text = report(fits, table)
    (folder / "report.txt").write_text(text + "\n")
    print(text)


def report(fits: list[archive.Fit], table: pd.DataFrame) -> str:
    """Means with 95% intervals over the fractals by protocol, and a line a fractal."""
    first, commits = fits[0], sorted({str(fit.commit)[:9] for fit in fits})
    of = "classic codes" if first.suite is None else f"fractals of suite {first.suite}"
    facts = environment("cpu")
    lines = [f"{len(fits)} {of}, {first.kind} targets of {first.resolution}², by {first.method}"
             + (f" with {first.options}" if first.options else ""),
             f"fitted by {', '.join(commits)} on {', '.join(sorted({str(fit.machine) for fit in fits}))}; "
             f"judged by {str(facts['commit'])[:9]}"]
    for (views, align), rows in table.groupby(["views", "align"], sort=False):
        summaries = {name: summarize(each[["fractal", "view", "zoom", "empty", *METRICS]])
                     for name, each in rows.groupby("method", sort=False)}
        overall = pd.concat([summary[summary["zoom_class"] == "all"].assign(method=name)
                             for name, summary in summaries.items()])
        frame = {value: key for key, value in FRAMES.items()}[align]
        lines += ["", f"{views} views, {frame}", describe(overall, "method")]
        lines += [f"  at the ceiling (mean F1 >= .97): {summaries[RESULT].attrs['ceiling_fraction']:.0%}; empty pairs, "
                  f"left out: {summaries[RESULT].attrs['empty_views']} of "
                  f"{len(rows[rows['method'] == RESULT])}"]
    lines += ["", *_fractals(table)]
    return "\n".join(lines)


def _fractals(table: pd.DataFrame) -> list[str]:
    """A line a fractal: mean F1 by protocol, and what is known of the code."""
    results = table[table["method"] == RESULT]
    wide = results.pivot_table(index="fractal", columns=["views", "align"], values="f1", sort=False)
    wide.columns = [f"f1 {views} {align}" for views, align in wide.columns]
    each = results.groupby("fractal", sort=False)[["true_maps", "maps", "exact", "equivalent", "seconds"]].first()
    seconds = each["seconds"]
    return [f"exact: {each['exact'].mean():.0%} ({each['exact'].sum()}); another code of the same attractor: "
            f"{each['equivalent'].sum()}",
            f"seconds of one core: median {seconds.median():.0f}, mean {seconds.mean():.0f}, at most "
            f"{seconds.max():.0f}", "", wide.join(each).round(3).to_string()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--stages", action="store_true", help="also the code after each stage")
    parser.add_argument("--workers", type=int, default=threads.available())
    args = parser.parse_args()
    for folder in args.folders:
        run(folder, args.workers, args.stages)


if __name__ == "__main__":
    main()
