"""Wrong arguments of every kind end in one line of error, and no kernel reads or writes beyond its arrays."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("hostile_arguments.py")


def attack(calls: int, seed: int, folder: Path) -> None:
    environment = os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(folder)}
    done = subprocess.run([sys.executable, str(PROGRAM), str(calls), str(seed)], env=environment, capture_output=True,
                          text=True)
    print(done.stdout)
    assert done.returncode == 0, f"the process ended with {done.returncode}: {done.stderr[-2000:]}"
    assert done.stdout.splitlines()[-1] == f"tried {calls}, clean {calls}", done.stdout


def test_some_hostile_calls_end_clean(tmp_path):
    attack(40, 0, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
def test_many_hostile_calls_end_clean(tmp_path, seed):
    attack(400, seed, tmp_path)
