import numpy as np
import pytest
from numba import float32, njit

from fractal_exp.runtime.vectors import LANES, at_least, at_most, count_up, load, no_less, repeat, store, total, zeros

A, B = np.random.default_rng(0).standard_normal((2, 2 * LANES)).astype(np.float32)
HERE = slice(3, 3 + LANES)  # not where a register begins in memory
CASES = {
    "sum": (lambda a, b, k: load(a, k) + load(b, k), A[HERE] + B[HERE]),
    "difference from a number": (lambda a, b, k: 1 - load(a, k), 1 - A[HERE]),
    "product with a number": (lambda a, b, k: load(a, k) * 0.1, A[HERE] * np.float32(0.1)),
    "quotient": (lambda a, b, k: load(a, k) / load(b, k), A[HERE] / B[HERE]),
    "repeated": (lambda a, b, k: zeros() + repeat(a, k), np.full(LANES, A[3])),
    "counted up": (lambda a, b, k: count_up(a[k]), A[3] + np.arange(LANES, dtype=np.float32)),
    "at most": (lambda a, b, k: at_most(load(a, k), float32(0.2)), np.minimum(A[HERE], np.float32(0.2))),
    "no less": (lambda a, b, k: no_less(load(a, k), float32(0.2)), np.maximum(A[HERE], np.float32(0.2))),
    "at least": (lambda a, b, k: at_least(load(a, k), float32(0.2), load(b, k)), np.where(A[HERE] >= 0.2, B[HERE], 0)),
}


@pytest.mark.parametrize("name", CASES)
def test_operations_are_numpys_lane_by_lane(name):
    operation, expected = CASES[name]
    operation = njit(operation)

    @njit
    def run(a, b, k, out):
        store(out, k, operation(a, b, k))

    out = np.full(2 * LANES, np.nan, np.float32)
    run(A, B, 3, out)
    np.testing.assert_array_equal(out[HERE], expected)
    assert np.isnan(np.delete(out, HERE)).all()


def test_in_place_operations_and_the_sum_of_the_lanes():
    @njit
    def run(a, b):
        value = load(a, 0)
        value *= load(b, 0)
        value -= 1
        return total(value)

    assert run(A, B) == pytest.approx(float((A[:LANES] * B[:LANES] - 1).sum()), rel=1e-5)


def test_not_a_number_is_left_out_with_the_lanes_that_are():
    @njit
    def run(a, b):
        return total(at_least(load(a, 0), float32(0), load(b, 0)))

    number, value = np.where(np.arange(LANES) % 2 == 0, 1, -1).astype(np.float32), np.full(LANES, 2, np.float32)
    value[1::2] = np.nan
    assert run(number, value) == LANES
