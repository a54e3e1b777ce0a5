"""The table of a sweep: the results of its jobs, row by row, beside published figures."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
import pandas as pd
from scipy.stats import kendalltau

from .. import tracking
from ..errors import InputError
from ..evaluation.summary import METRICS, bootstrap_interval
from ..runtime.files import parse_record
from ..tracking.addresses import dashboard_line, database_path
from .published import AS_PUBLISHED, COLUMNS, FULL, TABLES

MEASURED, TRIVIAL, PUBLISHED = "measured", "trivial", "published"
# Metrics trivial/white_f1 … of a run -> row.
TRIVIAL_ROWS = {"white": "all white", "black": "all black", "truth": "truth, drawn anew"}
SCORE = re.compile(rf"metrics\.(?:eval/|(?:trivial/)?({'|'.join(TRIVIAL_ROWS)})[_/])(.+)")  # once it was white/f1


@dataclass(frozen=True)
class Sweep:
    """A sweep as the tracking store has it.

    jobs: one row per job, in the order of the plan: job, row, sample, status (FINISHED, FAILED, KILLED, RUNNING, or
    ABSENT for a job without a run), reason, seconds, evaluations (NaN if the method does not count them), run_id,
    views_judged and views_empty, then the means over views f1, iou, psnr, ssim and the perceptual distance, and the
    same for an all white image, an all black image and the truth drawn again, as white/f1 … black/f1 … truth/f1 ….
    views: their kind, or None in an old sweep that did not store it.
    """

    study: str
    name: str
    run_id: str
    title: str
    scale: str
    perceptual: str
    baseline: str | None
    published: str | None
    jobs: pd.DataFrame
    views: str | None = None

    @property
    def metrics(self) -> list[str]:
        """The scores that at least one job has, METRICS first."""
        found = [name.removeprefix("metric.") for name in self.jobs if name.startswith("metric.") and "/" not in name]
        return [name for name in METRICS if name in found] + sorted(set(found) - set(METRICS))


def read_sweep(uri: str, study: str, name: str | None = None) -> Sweep:
    """The sweep `name` of a study (None: the newest), from a tracking store.

    Raises `InputError` if the store has no such study or sweep, or the sweep's files in it are damaged.
    """
    parents = tracking.runs_frame(uri, study, "tags.kind = 'sweep'")
    if name is not None and len(parents):
        parents = parents[(parents["name"] == name) | (parents["run_id"] == name)]
    if not len(parents):
        raise _no_sweep(uri, study, name)
    parent = parents.iloc[0]
    about, planned = _plan(uri, study, parent["run_id"])
    runs = tracking.runs_frame(uri, study, tracking.nested_below(parent["run_id"]))
    if len(runs):
        runs = runs.drop_duplicates("tags.job").set_index("tags.job").reindex(planned)
    jobs = pd.DataFrame({
        "job": planned,
        **{name: _column(runs, f"tags.{name}", planned) for name in ("row", "sample")},
        "status": _column(runs, "status", planned).fillna("ABSENT"),
        "reason": _column(runs, "tags.error", planned).fillna(""),
        "seconds": _column(runs, "metrics.time/fit_seconds", planned).astype(float),
        "evaluations": _column(runs, "metrics.time/evaluations", planned).astype(float),
        "run_id": _column(runs, "run_id", planned),
        **{f"views_{name}": _column(runs, f"metrics.views/{name}", planned).astype(float)
           for name in ("judged", "empty")},
    })
    for column in runs.columns:
        if score := SCORE.fullmatch(column):
            jobs[f"metric.{'/'.join(filter(None, score.groups()))}"] = runs[column].to_numpy(dtype=float)
    return Sweep(study, parent["name"], parent["run_id"], about.title, parent["tags.scale"],
                 parent["tags.perceptual"], about.baseline, about.published, jobs,
                 views if isinstance(views := parent.get("tags.views"), str) else None)


def _no_sweep(uri: str, study: str, name: str | None) -> InputError:
    """The error that says what has a table instead: the study's sweeps, or else the studies that have some."""
    own = list(dict.fromkeys(tracking.runs_frame(uri, study, "tags.kind = 'sweep'")["name"]))
    others = [other for other in tracking.studies(uri) if len(tracking.runs_frame(uri, other, "tags.kind = 'sweep'"))]
    database = database_path(uri)
    remedy = (f"it has {', '.join(own)}" if own else
              f"studies with a sweep here: {', '.join(others)}" if others else "fractal-sweep makes one")
    looked = f"; {dashboard_line(database.parent)} shows the fits of any study" if database and not own else ""
    return InputError(f"the study {study!r} has no sweep{f' {name!r}' if name else ''}, and only sweeps have a table; "
                      f"{remedy}{looked}")


@dataclass
class _About:
    title: str
    baseline: str | None
    published: Literal[*TABLES] | None


def _plan(uri: str, study: str, run_id: str) -> tuple[_About, list[str]]:
    """The description of a sweep, and the names of its jobs."""
    about, planned = (parse_record(tracking.read_artifact(uri, run_id, name), schema,
                                   f"the artifact {name} of the run {run_id}",
                                   f"the same fractal-sweep {study} command again writes it anew")
                      for name, schema in (("sweep.json", _About), ("jobs.json", list[str])))
    return about, planned


def _column(runs: pd.DataFrame, name: str, planned: list[str]) -> pd.Series:
    values = runs[name].to_numpy() if name in runs and len(runs) else np.full(len(planned), None, object)
    return pd.Series(values, dtype=object if name.startswith(("tags", "status", "run_id")) else None)


def summary(sweep: Sweep) -> pd.DataFrame:
    """The table: a row for each row of the sweep, then the trivial images, then the published rows (column `source`).

    For each metric: its mean over the finished jobs of the row, NAME_low and NAME_high (bootstrap 95% interval over
    samples, NaN for one sample), and NAME_std, the spread over samples. `finished`, `failed` and `unfinished` count
    jobs; seconds is the mean time of a fit, evaluations the mean number of images drawn for it. `wins` of `compared`
    samples have a higher F1 than the baseline on the same sample; `gain` is the mean difference in F1 on these samples,
    from gain_low to gain_high (bootstrap 95% interval over samples). Absent numbers are NaN.
    """
    jobs = sweep.jobs
    rows = [_measured(sweep, str(row), group) for row, group in jobs.groupby("row", sort=False)]
    reference = jobs[jobs["row"] == sweep.baseline] if sweep.baseline else jobs
    for key, title in TRIVIAL_ROWS.items():
        if f"metric.{key}/f1" in jobs:
            once = reference[reference["status"] == "FINISHED"].drop_duplicates("sample")
            rows.append({"row": title, "source": TRIVIAL, "finished": len(once),
                         **_scores(once, sweep.metrics, f"{key}/")})
    if sweep.published:
        table = TABLES[sweep.published]
        rows += [{"row": row, "source": PUBLISHED, **dict(zip(COLUMNS, values, strict=True)),
                  "seconds": table.seconds.get(row, np.nan)} for row, values in table.rows.items()]
    return pd.DataFrame(rows)


def _measured(sweep: Sweep, row: str, group: pd.DataFrame) -> dict[str, object]:
    finished = group[group["status"] == "FINISHED"]
    failed = int((group["status"] == "FAILED").sum())
    line = {"row": row, "source": MEASURED, "finished": len(finished), "failed": failed,
            "unfinished": len(group) - len(finished) - failed, "seconds": finished["seconds"].mean(),
            "evaluations": finished["evaluations"].mean(), **_scores(finished, sweep.metrics)}
    if sweep.baseline and row != sweep.baseline and "metric.f1" in sweep.jobs:
        baseline = sweep.jobs[(sweep.jobs["row"] == sweep.baseline) & (sweep.jobs["status"] == "FINISHED")]
        pairs = finished.merge(baseline, on="sample", suffixes=("", "_baseline"))
        gains = (pairs["metric.f1"] - pairs["metric.f1_baseline"]).dropna().to_numpy(dtype=float)
        low, high = bootstrap_interval(gains)
        line |= {"wins": int((gains > 0).sum()), "compared": len(gains), "gain_low": low, "gain_high": high,
                 "gain": float(gains.mean()) if len(gains) else np.nan}
    return line


def _scores(jobs: pd.DataFrame, metrics: list[str], prefix: str = "") -> dict[str, float]:
    scores = {}
    for name in metrics:
        column = f"metric.{prefix}{name}"
        values = jobs[column].dropna().to_numpy(dtype=float) if column in jobs else np.empty(0)
        low, high = bootstrap_interval(values)
        scores |= {name: float(values.mean()) if len(values) else np.nan, f"{name}_low": low, f"{name}_high": high,
                   f"{name}_std": float(values.std(ddof=1)) if len(values) > 1 else np.nan}
    return scores


def agreement(table: pd.DataFrame, baseline: str | None = None) -> tuple[float, float, int]:
    """Kendall's tau-b between the orders by F1 of the measured rows and of the published rows of the same names, its
    two-sided p, and the number of these rows; NaN for fewer than three.

    table: of `summary`. Scores of different views may be far apart, while the order of rows can still agree. baseline:
    the row of the full method, as_released for one, whose ablations are then as_released+no_mip and the like. A row of
    `AS_PUBLISHED` stands for the published one, also where a row has its name.
    """
    if "f1" not in table:
        return np.nan, np.nan, 0
    ours, theirs = (table[(table["source"] == source) & table["f1"].notna()].set_index("row")["f1"]
                    for source in (MEASURED, PUBLISHED))
    for mine, name in AS_PUBLISHED.items():
        if mine in ours:
            ours = ours.drop(name, errors="ignore").rename({mine: name})
    if baseline:
        ours = ours.rename(lambda row: FULL if row == baseline else row.removeprefix(f"{baseline}+"))
    common = ours.index.intersection(theirs.index)
    if len(common) < 3:
        return np.nan, np.nan, len(common)
    result = kendalltau(ours[common], theirs[common])
    return float(result.statistic), float(result.pvalue), len(common)


def same_rows(sweep: Sweep) -> list[list[str]]:
    """Groups of rows whose jobs all have the same scores: what these rows vary made no difference."""
    scores = [name for name in sweep.jobs if name.startswith("metric.") and "/" not in name]
    finished = sweep.jobs[sweep.jobs["status"] == "FINISHED"].sort_values("sample")
    groups: dict[tuple, list[str]] = {}
    for row, group in finished.groupby("row", sort=False):
        groups.setdefault((tuple(group["sample"]), group[scores].to_numpy().tobytes()), []).append(str(row))
    return [rows for rows in groups.values() if len(rows) > 1]


def spread(sweep: Sweep) -> pd.DataFrame:
    """The F1 of every finished job, by row of the table and sample, in the order of the plan."""
    finished = sweep.jobs[sweep.jobs["status"] == "FINISHED"]
    table = finished.pivot_table(index="row", columns="sample", values="metric.f1", sort=False)
    order = list(dict.fromkeys(sweep.jobs["sample"].dropna()))
    return table.reindex(columns=[name for name in order if name in table])
