"""Maps matched to maps: displacement in pixels, what is missed, what is spurious, what nobody can see."""

import math
from dataclasses import replace

import pytest
import torch

from fractal_exp import IFS, InputError, attractor, codes
from fractal_exp.evaluation.code_error import code_error, displacements, maps_that_matter
from fractal_exp.suite import random_suite

SIZE = {"resolution": 128, "points_in_view": 400_000}


def with_map(code: IFS, linear, offset) -> IFS:
    return IFS(torch.cat([code.linear, torch.as_tensor(linear)[None]]),
               torch.cat([code.offset, torch.as_tensor(offset)[None]]))


@pytest.fixture(scope="module")
def triangle() -> IFS:
    return attractor.normalize(codes.known("sierpinski_triangle"))


def test_a_permuted_code_is_exact(triangle):
    shuffled = IFS(triangle.linear[[2, 0, 1]], triangle.offset[[2, 0, 1]])
    error = code_error(shuffled, triangle, **SIZE)
    assert error.exact and [(i, j) for i, j, _ in error.pairs] == [(0, 2), (1, 0), (2, 1)]
    assert error.displacement_px < 0.02 and error.matters == (True, True, True)


def test_displacement_is_in_pixels_of_the_input(triangle):
    moved = replace(triangle, offset=triangle.offset + torch.tensor([[0.0, 0], [3 / 64, 4 / 64], [0, 0]]))
    error = code_error(moved, triangle, **SIZE, align="none")
    assert [px for *_, px in error.pairs] == pytest.approx([0, 5, 0], abs=1e-3)  # (3, 4) pixels of 2/128
    assert error.missed == (1,) and error.spurious == (1,) and not error.exact
    turned = replace(triangle, linear=triangle.linear * 0.9)
    x = displacements(turned, triangle, 128).diagonal()
    # |0.05 x| averaged over the attractor, whose points lie within 0.75 of the middle.
    assert 0.5 < float(x.mean()) < 0.05 * math.hypot(0.75, 0.75) * 64


def test_a_missing_map_is_missed_and_an_extra_one_spurious(triangle):
    without = IFS(triangle.linear[:2], triangle.offset[:2])
    assert code_error(without, triangle, **SIZE, align="none").missed == (2,)
    extra = with_map(triangle, torch.eye(2) * 0.4, [0.2, 0.3])
    error = code_error(extra, triangle, **SIZE, align="none")
    assert error.missed == () and error.spurious == (3,) and not error.exact


def test_maps_that_nobody_sees_do_not_count(triangle):
    dot = with_map(triangle, torch.eye(2) * 1e-3, triangle.offset[0] * 2)  # lands on a corner of the triangle
    error = code_error(dot, triangle, **SIZE, align="none")
    assert error.exact and error.displacement_px < 1e-3
    assert code_error(triangle, dot, **SIZE, align="none").exact
    assert maps_that_matter(dot, 128, 400_000) == [True, True, True, False]


def test_a_doubled_map_is_not_spurious(triangle):
    doubled = with_map(triangle, triangle.linear[0], triangle.offset[0])
    error = code_error(doubled, triangle, **SIZE, align="none")
    assert error.exact


def test_suite_codes_are_exact_against_themselves():
    for code in random_suite(3):
        assert code_error(code, code, **SIZE).exact


def test_one_map_always_matters():
    point = IFS(torch.eye(2)[None] / 2, torch.zeros(1, 2))
    assert code_error(point, point, **SIZE).exact


def test_bad_input(triangle):
    with pytest.raises(InputError, match="bbox or none"):
        code_error(triangle, triangle, resolution=64, align="left")
    with pytest.raises(InputError, match="contractive"):
        code_error(IFS(2 * torch.eye(2)[None], torch.zeros(1, 2)), triangle, resolution=64, align="none")
