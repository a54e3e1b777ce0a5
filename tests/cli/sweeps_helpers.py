"""Sweeps at sizes that take moments: begun, run in this process, and what they stored."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
from commands import run_here

from fractal_exp import tracking
from fractal_exp.cli import sweep as command
from fractal_exp.studies import report

TINY = ["scale=smoke", "resolution=32", "evaluation.resolution=32", "evaluation.points_in_view=20000", "iterations=6",
        "checkpoint_every=2", "anneal_every=3", "threads=1"]


def start(output: Path, *words: str, **environment: str) -> subprocess.Popen:
    environment = {name: value for name, value in os.environ.items() if name != "MLFLOW_TRACKING_URI"} | environment
    line = [sys.executable, "-m", "fractal_exp.cli", "sweep", words[0], *TINY, f"output={output}", *words[1:]]
    return subprocess.Popen(line, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, env=environment)


def run(output: Path, *words: str) -> tuple[int, str]:
    return run_here(command, words[0], *TINY, f"output={output}", *words[1:])


def stored(output: Path, study: str) -> tuple[report.Sweep, pd.DataFrame]:
    """The sweep, and all runs of the study."""
    uri = f"sqlite:///{output / 'mlflow.db'}"
    return report.read_sweep(uri, study), tracking.runs_frame(uri, study)


def wait_for(condition, what: str, process: subprocess.Popen, seconds: float = 120):
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline and process.poll() is None, f"{what} in vain: {process.communicate()[0]}"
        time.sleep(0.01)
    return found
