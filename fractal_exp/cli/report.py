"""`fractal-report`: from the tracking store to tables and a figure. A plain command line: nothing to compose."""

from __future__ import annotations

import argparse
from pathlib import Path

from .commands import command, command_parser

DESCRIPTION = """Make the tables and the figure of a sweep from what the tracking store has of it, finished or not.

Written to --out: report (.md, .tex, .csv, .png), jobs.csv, a row a job, and spread.csv, F1 by row and sample. Measured
rows, trivial images and published rows stand apart; a published row is never mixed with measured ones.

examples
  fractal-report ablations                        the newest sweep of the study
  fractal-report ablations --sweep laptop-1f2e3d  another, by the name of its folder"""


def main(arguments: list[str] | None = None) -> None:
    """The command `fractal-report`. arguments: those of the process if None."""
    parser = command_parser("fractal-report", DESCRIPTION)
    parser.add_argument("study", help="the study: ablations, comparisons, …")
    parser.add_argument("--sweep", help="which of its sweeps, by name or run (default: the newest)")
    parser.add_argument("--output", default="outputs", help="folder of the MLflow store")
    parser.add_argument("--out", help="folder to write to (default: OUTPUT/STUDY/SWEEP)")
    command("fractal-report", report_sweep, parser, arguments)


def report_sweep(options: argparse.Namespace) -> None:
    """Report on the sweep that the command line names."""
    from .. import tracking
    from ..studies import report
    from ..studies.writing import write

    uri = tracking.kept_runs(options.output)
    sweep = report.read_sweep(uri, options.study, options.sweep)
    folder = Path(options.out or Path(options.output) / options.study / sweep.name).absolute()
    write(uri, sweep, folder)
    print((folder / "report.md").read_text())
    print(f"{tracking.comparison_address(uri, options.study, sweep.run_id)}\n{folder}/report.*")
