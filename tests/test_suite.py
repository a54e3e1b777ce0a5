"""The random suite is the same everywhere, and its codes follow the published distribution."""

import hashlib

import pytest
import torch

from fractal_exp.ifs.code import IFS
from fractal_exp.suite import random_suite, target

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


def test_singular_values_share_the_published_budget():
    for code in random_suite():
        n, singular = len(code), code.singular_values().double()
        assert 3 <= n <= 10
        assert (5 + n) / 2 - 1e-4 <= float((singular @ torch.tensor([1.0, 2.0]).double()).sum()) <= (6 + n) / 2 + 1e-4
        assert float(singular.max()) < 1 and float(singular.min()) >= 0
        assert float(code.offset.abs().max()) <= 1


def test_a_target_is_framed_and_carries_the_density():
    code = random_suite(1)[0]
    image = target(code, 64)
    assert image.shape == (64, 64) and image.dtype == torch.float32
    rows, columns = (image > 0).any(1).nonzero(), (image > 0).any(0).nonzero()
    sides = [float(axis.max() - axis.min() + 1) for axis in (rows, columns)]
    assert 47 <= max(sides) <= 50  # 1.5 of the canvas's 2 units, give or take a pixel
    for axis in (rows, columns):
        assert abs(float(axis.max() + axis.min()) / 2 - 31.5) <= 1
    assert torch.equal(image, target(code, 64)) and not torch.equal(image, target(code, 64, seed=1))


def test_the_grey_level_of_a_target_is_the_density_of_points():
    square = IFS(torch.eye(2).expand(4, 2, 2) / 2, torch.tensor([[-1.0, -1], [-1, 1], [1, -1], [1, 1]]))
    density = -torch.log1p(-target(square, 64)[9:-9, 9:-9].mean())
    assert float(density) == pytest.approx(50e6 / 1024**2 / 16**2 / 0.75**2, rel=0.01)  # points a supersampled pixel


def test_a_binary_target_is_the_grey_one_above_a_quarter():
    code = random_suite(2)[1]
    assert torch.equal(target(code, 32, "binary"), (target(code, 32) > 0.25).float())


def test_a_target_is_drawn_with_the_codes_own_probabilities_or_those_of_the_protocol():
    code = random_suite(1)[0]
    written_out = IFS(code.linear, code.offset, code.sampling_probabilities())
    assert torch.equal(target(written_out, 32), target(code, 32))
    other = IFS(code.linear, code.offset, torch.full((len(code),), 1 / len(code)))
    assert not torch.equal(target(other, 32), target(code, 32))
