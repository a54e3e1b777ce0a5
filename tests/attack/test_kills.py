"""A campaign of kills and interruptions, which prints how many were tried and how many were clean.

It is a slow test. Its seed is fixed, the moments come as they fall.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

SEED = 20
HERE = Path(__file__).parent


def campaign(script: str, *arguments: object) -> dict:
    """Run trials in a process of their own; what they found."""
    done = subprocess.run([sys.executable, str(HERE / script), *map(str, arguments)], capture_output=True, text=True,
                          timeout=1200)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    print(f"{script} {arguments[0]}: {found['tried']} tried, {found['tried'] - len(found['failures'])} clean")
    return found


def test_fits_that_are_killed_again_and_again_come_to_the_same_code_and_the_same_series(tmp_path):
    found = campaign("fit_trials.py", tmp_path, 30, SEED)
    assert found["tried"] >= 30 and found["failures"] == []
