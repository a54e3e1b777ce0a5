"""A sweep's report in files, on the screen, and on its parent run."""

from __future__ import annotations

import os
from pathlib import Path

from .. import tracking
from ..images.reading import write_image
from ..runtime.files import write_atomically
from ..studies import course, report, report_text
from ..studies.report_figure import figure


def write_tables(run: tracking.Tracker, output: Path, study: str, folder: Path) -> None:
    """Report on the sweep of a parent run that is still open: files into `folder`, the same onto the run."""
    uri = store_uri(output)
    sweep = report.read_sweep(uri, study, run.run_id)
    for path in write_report(uri, sweep, folder):
        run.artifact(f"report/{path.name}", path)
    run.table("summary.json", report.summary(sweep))
    print(f"\n{(folder / 'report.md').read_text()}")
    if output == Path("outputs").absolute():
        print("dashboard: make dashboard, then")
    elif not os.environ.get("MLFLOW_TRACKING_URI"):
        print(f"dashboard: python -m fractal_exp.tracking dashboard '{output}', then")
    print(f"  {tracking.comparison_address(uri, study, sweep.run_id)}\ntables and figure: {folder}/report.*")


def write_report(uri: str, sweep: report.Sweep, folder: Path) -> list[Path]:
    """report.md, .tex, .csv and .png, jobs.csv and spread.csv in `folder`, and course.csv and .png where the sweep has
    quality over time; their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    table = report.summary(sweep)
    written = []
    for name, text in {"report.md": report_text.markdown(sweep, table), "report.tex": report_text.latex(sweep, table),
                       "report.csv": table.to_csv(index=False), "jobs.csv": sweep.jobs.to_csv(index=False),
                       "spread.csv": report.spread(sweep).to_csv()}.items():
        write_atomically(folder / name, text)
        written.append(folder / name)
    sheet = figure(uri, sweep)
    if sheet is not None:
        written.append(write_image(folder / "report.png", sheet))
    courses = course.read_courses(uri, sweep)
    if len(courses):
        for name, data in (("course.csv", courses.to_csv(index=False)), ("course.png", course.drawn(sweep, courses))):
            write_atomically(folder / name, data)
            written.append(folder / name)
    return written


def store_uri(output: Path) -> str:
    """The store of an output folder, or the server that MLFLOW_TRACKING_URI names."""
    return os.environ.get("MLFLOW_TRACKING_URI") or f"sqlite:///{Path(output).absolute()}/mlflow.db"
