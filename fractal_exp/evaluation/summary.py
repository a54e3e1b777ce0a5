"""Summaries of tables of views: means with their intervals, by range of zoom."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..runtime.extras import need
from .views import ZOOM_CLASSES, zoom_class

if TYPE_CHECKING:
    import pandas as pd

METRICS = ("f1", "iou", "psnr", "ssim", "lpips")
KEYS = ("view", "zoom", "center_x", "center_y", "empty", "fractal")
ALL_VIEWS = "all"
CEILING_F1 = 0.97        # mean F1 from which a fractal counts as recovered as far as views can tell
CONFIDENCE, RESAMPLES = 0.95, 9999


def metric_columns(frame: pd.DataFrame) -> list[str]:
    """The columns of a per-view table that hold scores: METRICS first, then other distances."""
    scores = [name for name in frame.select_dtypes("number").columns if name not in KEYS]
    return [name for name in METRICS if name in scores] + [name for name in scores if name not in METRICS]


def summarize(frame: pd.DataFrame, *, seed: int = 0) -> pd.DataFrame:
    """Mean scores of per-view tables (see `evaluate`), over all views and by range of zoom.

    `frame` has the rows of one fractal, or of several with a column `fractal`. The result has one row for each range of
    zoom (all, whole, 1-2x, 2-4x, 4-8x) and metric, with these columns:

    - mean: over the views.
    - std: the spread of the means of the fractals.
    - low, high: the bootstrap 95% interval of the mean, by resampling fractals, because the views of one fractal are
      not independent (Efron's percentile interval, 9999 resamples; NaN for a single fractal).
    - views, fractals: their numbers.
    - empty: the number of views that are empty in truth and result. They do not count anywhere else.

    `attrs` are those of the frame, with `ceiling_fraction` and `empty_views`. A metric that is absent (NaN) stays
    absent. Raises `InputError` on a table without rows or without the columns of `evaluate`.
    """
    need("pandas")
    import pandas as pd

    missing = [name for name in ("view", "zoom", "f1") if name not in frame]
    if missing or len(frame) == 0:
        raise InputError(f"expected a table of views as `evaluate` makes it, got {len(frame)} rows and no column "
                         f"{', '.join(missing) or 'missing'}")
    frame = frame.reset_index(drop=True)  # concatenated tables repeat their row numbers
    fractal = frame["fractal"] if "fractal" in frame else pd.Series("", index=frame.index)
    classes = frame["zoom"].map(zoom_class)
    rows = []
    for name in (ALL_VIEWS, *ZOOM_CLASSES):
        chosen = frame if name == ALL_VIEWS else frame[classes == name]
        shown = without_empty(chosen)
        for metric in metric_columns(frame):
            if len(chosen):
                rows.append({"zoom_class": name, "metric": metric, **_statistics(shown[metric], fractal, seed),
                             "empty": len(chosen) - len(shown)})
    summary = pd.DataFrame(rows)
    summary.attrs = {**frame.attrs, "ceiling_fraction": ceiling_fraction(frame),
                     "empty_views": len(frame) - len(without_empty(frame))}
    return summary


def without_empty(frame: pd.DataFrame) -> pd.DataFrame:
    """The rows of a per-view table that count: views that are not empty in both truth and result."""
    return frame[frame["empty"].ne(True)] if "empty" in frame else frame


def ceiling_fraction(frame: pd.DataFrame) -> float:
    """The fraction of fractals with a mean F1 of at least 0.97 over their non-empty views."""
    frame = without_empty(frame)
    if "fractal" not in frame:
        return float(frame["f1"].mean() >= CEILING_F1)
    return float((frame.groupby("fractal")["f1"].mean() >= CEILING_F1).mean())


def _statistics(values: pd.Series, fractal: pd.Series, seed: int) -> dict[str, float | int]:
    means = values.groupby(fractal.loc[values.index]).mean().to_numpy()
    low, high = bootstrap_interval(means, seed)
    spread = float(means.std(ddof=1)) if len(means) > 1 else float("nan")
    return {"mean": float(values.mean()), "std": spread, "low": low, "high": high, "views": len(values),
            "fractals": len(means)}


def bootstrap_interval(means: np.ndarray, seed: int = 0) -> tuple[float, float]:
    """Lower and upper end of the bootstrap 95% interval of the mean of numbers (K,): Efron's percentile interval, 9999
    resamples; NaN for fewer than two numbers, or if one is not finite."""
    if len(means) < 2 or not np.isfinite(means).all():
        return float("nan"), float("nan")
    if np.ptp(means) == 0:
        return float(means[0]), float(means[0])
    from scipy.stats import bootstrap

    interval = bootstrap((means,), np.mean, n_resamples=RESAMPLES, confidence_level=CONFIDENCE, method="percentile",
                         rng=np.random.default_rng(seed)).confidence_interval
    return float(interval.low), float(interval.high)


def describe(summary: pd.DataFrame, row: str = "zoom_class") -> str:
    """A summary as a text table with means and intervals: a line for each value of the column `row`, a column a metric.
    """
    names, lines = list(summary["metric"].unique()), list(summary[row].unique())
    cells = {(getattr(line, row), line.metric): _cell(line) for line in summary.itertuples()}
    head, width = max(map(len, lines)), max(map(len, cells.values())) + 2
    return "\n".join([" " * head + "".join(name.rjust(width) for name in names)]
                     + [line.ljust(head) + "".join(cells[line, name].rjust(width) for name in names) for line in lines])


def _cell(row: object) -> str:
    if np.isnan(row.mean):
        return "absent"
    digits = 2 if row.metric == "psnr" else 3
    interval = "" if np.isnan(row.low) else f" [{row.low:.{digits}f}, {row.high:.{digits}f}]"
    return f"{row.mean:.{digits}f}{interval}"
