"""A limit of time, and the shares of it that parts of the work may take."""

import time

import pytest

from fractal_exp.runtime import deadline
from fractal_exp.runtime.deadline import Deadline
from fractal_exp.runtime.jit import kernel


@pytest.mark.parametrize(("share", "passed"), [(0.0, [True, True, True]), (0.5, [False, True, True]),
                                               (1.0, [False, False, True])])
def test_a_share_of_the_time_ends_when_it_has_passed(share, passed):
    now = [0.0]
    part = Deadline(10, lambda: now[0]).until(share)
    seen = []
    for now[0] in (0.0, 5.0, 10.0):
        seen.append(part.passed)
    assert seen == passed


def test_no_limit_has_no_shares():
    part = Deadline().until(0.0)
    assert not part.passed and part.used == 0


def test_what_a_first_run_compiles_does_not_count_towards_the_usual_limit():
    @kernel()
    def doubled(x):
        return 2 * x

    spent, before = deadline.core_seconds(), time.process_time()
    assert doubled(1.0) == 2
    compiled = (time.process_time() - before) - (deadline.core_seconds() - spent)
    assert compiled > 0.5 * (time.process_time() - before)
    counted = deadline.core_seconds()
    doubled(2.0)
    assert deadline.core_seconds() >= counted


def test_the_usual_limit_lasts_half_a_minute_however_many_cores_work():
    worked = passed = 0.0
    usual = Deadline.usual(lambda: worked, lambda: passed)
    worked, passed = 160.0, 10.0   # sixteen cores
    assert not usual.passed and usual.used == pytest.approx(1 / 3)
    passed = 30.0
    assert usual.passed
    other = Deadline.usual(lambda: worked, lambda: passed)
    worked, passed = worked + 59, passed + 500   # a core that has other work too
    assert not other.passed and other.words == "60 s of a core"
