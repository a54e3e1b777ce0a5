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
import os
os.environ.pop("OMP_WAIT_POLICY", None), os.environ.pop("GOMP_SPINCOUNT", None)
{imports}
torch.rand(999, 999).sum()
from fractal_exp.runtime import threads
numbers = [int(each) for all in threads.numbers_of_openmp() for each in all]
print(os.environ["OMP_WAIT_POLICY"], os.environ["GOMP_SPINCOUNT"], threads.SPINS in numbers,
      threads.USUAL_SPINS in numbers)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="GNU's OpenMP on Linux")
@pytest.mark.parametrize("imports", [
    pytest.param("import fractal_exp, torch", marks=pytest.mark.slow),
    "import torch; torch.set_num_threads(2); torch.rand(999, 999).sum(); import fractal_exp"])
def test_idle_threads_spin_briefly_whatever_is_imported_first(imports):
    """By the environment, and in the memory of an OpenMP that has read that already. What it brings is measured by
    `benchmarks.import_orders`."""
    done = subprocess.run([sys.executable, "-c", STATE.format(imports=imports)], capture_output=True, text=True,
                          check=True)
    assert done.stdout == "passive 1000 True False\n"


def test_a_policy_of_the_user_is_left_alone():
    program = ("import os, torch, fractal_exp; from fractal_exp.runtime import threads; "
               "print(os.environ['GOMP_SPINCOUNT'], 'OMP_WAIT_POLICY' in os.environ, "
               "any(threads.USUAL_SPINS in numbers for numbers in threads.numbers_of_openmp()))")
    environment = {k: v for k, v in os.environ.items() if k != "OMP_WAIT_POLICY"}
    environment["GOMP_SPINCOUNT"] = "300000"
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "300000 False True\n"
