"""Sweeps at sizes that take moments: begun, run in this process, and what they stored."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
from commands import run_here
from hydra.core.global_hydra import GlobalHydra
from omegaconf import OmegaConf

from fractal_exp import tracking
from fractal_exp.cli import configuration
from fractal_exp.cli import sweep as command
from fractal_exp.studies import report

TINY = ["scale=smoke", "resolution=32", "evaluation.resolution=32", "evaluation.points_in_view=20000", "iterations=6",
        "checkpoint_every=2", "anneal_every=3", "threads=1"]


def jobs_of(name: str, *overrides: str) -> list[dict]:
    """The resolved configuration of every job of a sweep."""
    found = []
    with pytest.MonkeyPatch.context() as patch, tempfile.TemporaryDirectory() as output:
        # To compose a job takes a fifth of a second. Here only the launcher does so: not Hydra before it launches any,
        # and neither the check of the words nor the estimate of the cost, which would try a fit of each method too.
        patch.setattr("hydra.plugins.sweeper.Sweeper.validate_batch_is_legal", lambda *_: None)
        loader = SimpleNamespace(load_sweep_config=lambda *_: None, get_group_options=lambda *given, **more:
                                 GlobalHydra.instance().config_loader().get_group_options(*given, **more))
        patch.setattr("fractal_exp.cli.sweeps.GlobalHydra", SimpleNamespace(
            instance=lambda: SimpleNamespace(config_loader=lambda: loader)))
        patch.setattr("fractal_exp.cli.cost.estimate", lambda *_: "")
        patch.setattr("fractal_exp.cli.jobs.run_job",
                      lambda config: found.append(OmegaConf.to_container(configuration.resolve(config))))
        status, printed = run_here(command, name, *overrides, "tracking=none", f"output={output}")
    assert status == 1 and found, printed  # there are no results
    return found


def start(output: Path, *words: str, **environment: str) -> subprocess.Popen:
    line = [sys.executable, "-m", "fractal_exp.cli", "sweep", words[0], *TINY, f"output={output}", *words[1:]]
    return subprocess.Popen(line, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                            env=os.environ | environment)


def run(output: Path, *words: str) -> tuple[int, str]:
    return run_here(command, words[0], *TINY, f"output={output}", *words[1:])


def stored(output: Path, study: str) -> tuple[report.Sweep, pd.DataFrame]:
    """The sweep, and all runs of the study."""
    uri = f"sqlite:///{output / 'mlflow.db'}"
    return report.read_sweep(uri, study), tracking.runs_frame(uri, study)
