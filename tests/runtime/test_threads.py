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


def variables_after(program: str, **given: str) -> str:
    environment = {k: v for k, v in os.environ.items() if k not in ("OMP_WAIT_POLICY", "GOMP_SPINCOUNT")} | given
    program += "; import os; print(os.environ.get('OMP_WAIT_POLICY'), os.environ.get('GOMP_SPINCOUNT'))"
    return subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True,
                          check=True).stdout


def test_idle_threads_are_told_to_spin_briefly():
    assert variables_after("import fractal_exp") == "passive 1000\n"


def test_a_policy_of_the_user_is_left_alone():
    assert variables_after("import fractal_exp", GOMP_SPINCOUNT="300000") == "None 300000\n"
