"""The random suite is the same everywhere, and its codes follow the published distribution."""

import hashlib

import pytest
import torch

from fractal_exp.errors import InputError
from fractal_exp.suite import random_suite

SUITE_SHA256 = "8f84e1cb576fd0dd1d3d8466e0206f093b4ca4b9a72259fa31e753cf2573c7ac"


def test_the_published_suite_is_pinned():
    digest = hashlib.sha256()
    for code in random_suite():
        digest.update(code.linear.numpy().astype("<f4").tobytes())
        digest.update(code.offset.numpy().astype("<f4").tobytes())
    assert digest.hexdigest() == SUITE_SHA256


def test_a_shorter_suite_is_the_beginning_of_a_longer_one():
    for short, long in zip(random_suite(4), random_suite(7), strict=False):
        assert torch.equal(short.linear, long.linear) and torch.equal(short.offset, long.offset)


def test_another_seed_is_another_suite():
    assert not torch.equal(random_suite(1, seed=1)[0].offset, random_suite(1, seed=2)[0].offset)


def test_singular_values_share_the_published_budget():
    for code in random_suite():
        n, singular = len(code), code.singular_values().double()
        assert 3 <= n <= 10
        assert (5 + n) / 2 - 1e-4 <= float((singular @ torch.tensor([1.0, 2.0]).double()).sum()) <= (6 + n) / 2 + 1e-4
        assert float(singular.max()) < 1 and float(singular.min()) >= 0
        assert float(code.offset.abs().max()) <= 1


def test_sizes_and_reflections_are_all_drawn():
    suite = random_suite(200, seed=3)
    assert {len(code) for code in suite} == set(range(3, 11))
    signs = torch.cat([torch.linalg.det(code.linear) for code in suite]).sign()
    assert 0.4 < float((signs > 0).float().mean()) < 0.6


@pytest.mark.parametrize("arguments", [{"count": 0}, {"count": -1}, {"seed": -5}])
def test_a_suite_needs_a_count_and_a_seed(arguments):
    with pytest.raises(InputError, match="at least"):
        random_suite(**arguments)
