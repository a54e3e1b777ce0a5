"""Optional: sweeps by the launchers that need more software (`make test-launchers` brings it); joblib is tested with
the restarts in test_sweeps.py."""

import importlib.util
import os
import shutil
import subprocess

import pytest
from sweeps_helpers import run, stored

pytestmark = pytest.mark.optional


def slurm_is_up() -> bool:
    return shutil.which("sinfo") is not None and "idle" in subprocess.run(
        ["sinfo", "--noheader", "--format=%t"], capture_output=True, text=True, timeout=30).stdout


NEEDS = {
    "submitit_local": lambda: importlib.util.find_spec("hydra_plugins.hydra_submitit_launcher"),
    "submitit_slurm": lambda: importlib.util.find_spec("hydra_plugins.hydra_submitit_launcher") and slurm_is_up(),
    "ray": lambda: importlib.util.find_spec("hydra_plugins.hydra_ray_launcher"),
}


@pytest.mark.parametrize("launcher", NEEDS)
def test_a_launcher_runs_a_sweep_with_a_failing_job_and_skips_what_is_finished(launcher, tmp_path):
    if not NEEDS[launcher]():
        pytest.skip(f"launch={launcher} is not usable here; `make test-launchers` brings what it needs")
    words = ["function_count", "sweep.count=1", "model.maps=0,3", f"launch={launcher}"]
    for again in (False, True):
        status, printed = run(tmp_path, *words)
        assert status == 1 and "1 of 2 jobs finished; 1 failed" in printed, printed
        assert "the number of maps N must be at least 1, got 0" in printed and ("(finished before)" in printed) == again
    sweep, runs = stored(tmp_path, "function_count")
    assert list(sweep.jobs["status"]) == ["FAILED", "FINISHED"] and len(runs) == 3
    assert set(runs["tags.pid"]) - {str(os.getpid())} and runs["tags.pid"].nunique() > 1, "jobs ran elsewhere"
