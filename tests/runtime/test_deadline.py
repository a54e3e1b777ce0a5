"""A limit of time, and the shares of it that parts of the work may take."""

import pytest

from fractal_exp.runtime.deadline import Deadline


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
