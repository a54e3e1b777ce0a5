"""The files of a sweep's report, the same from every command."""

from __future__ import annotations

from pathlib import Path

from ..images.pixels import write_image
from ..runtime.files import write_atomically
from . import course, report, report_text
from .report_figure import figure


def write(uri: str, sweep: report.Sweep, folder: Path) -> list[Path]:
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
