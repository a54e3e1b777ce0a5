"""Quality over time: the F1 of the codes that methods came to on their way, as a table and as a figure."""

from __future__ import annotations

import io
import math
from dataclasses import dataclass

import numpy as np
import pandas as pd

from .. import tracking
from ..runtime.files import parse_record
from .report import Sweep

COLUMNS = ("row", "sample", "seconds", "f1", "step")
MOMENTS = 200  # at which a row's curves are averaged


@dataclass
class _Point:
    seconds: float
    f1: float
    step: float = math.nan  # in a file of an earlier version


def read_courses(uri: str, sweep: Sweep) -> pd.DataFrame:
    """A line for each code of each finished job: row, sample, the seconds of the fit until then, its f1 on the whole
    view, and the number of the method's step (NaN where that is not known). Empty if the sweep keeps no courses. Raises
    `InputError` on a damaged one."""
    lines = []
    for job in sweep.jobs[sweep.jobs["status"] == "FINISHED"].itertuples():
        try:
            data = tracking.read_artifact(uri, job.run_id, "course.json")
        except tracking.NoArtifact:  # a sweep without courses, or a fit by an earlier version
            continue
        points = parse_record(data, list[_Point], f"the artifact course.json of the run {job.run_id}",
                              "fit that job again")
        lines += [(job.row, job.sample, point.seconds, point.f1, point.step) for point in points]
    return pd.DataFrame(lines, columns=list(COLUMNS))


def mean_course(part: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Seconds and the mean over samples of the F1 reached until then, from the moment at which all samples have a
    code. Later codes count even where they are worse, as the method would have returned them."""
    samples = [each.sort_values("seconds") for _, each in part.groupby("sample")]
    first = max(each["seconds"].iloc[0] for each in samples)
    last = max(part["seconds"].max(), first)
    moments = np.geomspace(max(first, 1e-3), max(last, 1e-3), MOMENTS)
    moments[0], moments[-1] = first, last  # rounding must not put a moment before the first code
    curves = [each["f1"].to_numpy()[np.searchsorted(each["seconds"].to_numpy(), moments, side="right") - 1]
              for each in samples]
    return moments, np.mean(curves, 0)


def drawn(sweep: Sweep, courses: pd.DataFrame) -> bytes:
    """The figure as PNG: F1 of the whole view against seconds (logarithmic), a line for each row."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5), layout="constrained")
    axes = figure.subplots()
    for row, part in courses.groupby("row", sort=False):
        moments, f1 = mean_course(part)
        axes.plot(moments, f1, label=str(row), marker="o", markevery=[len(f1) - 1], drawstyle="steps-post")
    samples = courses["sample"].nunique()
    axes.set(xscale="log", xlabel="seconds of a fit", ylabel="F1 of the whole view", ylim=(0, 1),
             title=f"{sweep.title}, {sweep.scale} scale, mean of {samples} sample{'s' * (samples > 1)}")
    axes.grid(alpha=.3)
    axes.legend(loc="best", fontsize="small")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120)
    return buffer.getvalue()
