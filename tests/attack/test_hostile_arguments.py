"""Wrong arguments of every kind end in one line of error, and no kernel reads or writes beyond its arrays."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM, CALLS = Path(__file__).with_name("hostile_arguments.py"), 400


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_hostile_calls_end_clean(tmp_path, seed):
    """Nothing else compiles the kernels with their bounds checked, which takes most of the time."""
    environment = os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run([sys.executable, str(PROGRAM), str(CALLS), str(seed)], env=environment, capture_output=True,
                          text=True)
    print(done.stdout)
    assert done.returncode == 0, f"the process ended with {done.returncode}: {done.stderr[-2000:]}"
    assert done.stdout.splitlines()[-1] == f"tried {CALLS}, clean {CALLS}", done.stdout
