"""One count of threads for both pools."""

import os
import subprocess
import sys

import pytest

from fractal_exp import InputError
from fractal_exp.runtime import threads


@pytest.mark.skipif(threads.available() < 2, reason="one core: there is nothing to limit")
def test_a_limit_holds_for_both_pools_even_after_torch_has_worked():
    program = ("import fractal_exp, torch; from fractal_exp.runtime import threads; torch.rand(999, 999).sum(); "
               "threads.use(1); import numba; torch.rand(999, 999).sum(); "
               "print(torch.get_num_threads(), numba.get_num_threads())")
    assert subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout == "1 1\n"


@pytest.mark.parametrize("count", [0, -1, threads.available() + 1])
def test_a_count_that_the_machine_has_not_is_refused(count):
    with pytest.raises(InputError, match=f"between 1 and {threads.available()}"):
        threads.use(count)


STATE = """
import os, threading
os.environ.pop("OMP_WAIT_POLICY", None), os.environ.pop("GOMP_SPINCOUNT", None)
{imports}
[team] = [each for each in threading.enumerate() if each.name == "idle OpenMP team"] or [None]
print(os.environ["OMP_WAIT_POLICY"], os.environ["GOMP_SPINCOUNT"], team and (team.is_alive(), team.daemon))
"""


@pytest.mark.skipif(threads.available() < 2 or sys.platform != "linux", reason="GNU's OpenMP on two cores or more")
@pytest.mark.parametrize(("imports", "team"), [
    ("import fractal_exp", "None"),
    pytest.param("import torch, fractal_exp", "(True, True)", marks=pytest.mark.slow),
    ("import torch; torch.set_num_threads(2); import fractal_exp", "(True, True)")])
def test_idle_threads_are_told_to_sleep_whatever_is_imported_first(imports, team):
    """By the environment, and where OpenMP has read that already by a second team. What it brings is measured by
    `benchmarks.import_orders`."""
    done = subprocess.run([sys.executable, "-c", STATE.format(imports=imports)], capture_output=True, text=True,
                          check=True)
    assert done.stdout == f"passive 1000 {team}\n"


def test_a_policy_of_the_user_is_left_alone():
    program = ("import os, threading, torch, fractal_exp; "
               "print(os.environ['OMP_WAIT_POLICY'], 'GOMP_SPINCOUNT' in os.environ, threading.active_count())")
    environment = {k: v for k, v in os.environ.items() if k != "GOMP_SPINCOUNT"} | {"OMP_WAIT_POLICY": "active"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "active False 1\n"
