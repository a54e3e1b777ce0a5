"""Maps matched to maps: displacement in pixels, what is missed, what is spurious, what nobody can see."""

import math
from dataclasses import replace

import pandas as pd
import pytest
import torch

from fractal_exp import IFS, InputError, codes, ops
from fractal_exp.evaluation import evaluate
from fractal_exp.evaluation.code_error import code_error, displacements, maps_that_matter
from fractal_exp.ifs import attractor
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


def test_bad_input(triangle):
    with pytest.raises(InputError, match="one of bbox, none"):
        code_error(triangle, triangle, resolution=64, align="left")
    with pytest.raises(InputError, match="contractive"):
        code_error(IFS(2 * torch.eye(2)[None], torch.zeros(1, 2)), triangle, resolution=64, align="none")


def fern() -> IFS:
    """The fern as targets are drawn, by area: its two leaflets are small, its stem is flat."""
    return attractor.normalize(replace(codes.known("fern"), probabilities=None))


def twig(probabilities=None) -> IFS:
    """The Sierpinski triangle with a small map into its hole, of a shape that no mirror or turn leaves alone."""
    gasket = attractor.normalize(codes.known("sierpinski_triangle"))
    code = with_map(gasket, torch.tensor([[0.12, 0.0], [0.05, 0.06]]), torch.tensor([0.0, -0.15]))
    return attractor.normalize(replace(code, probabilities=probabilities))


def changed(code: IFS, i: int, matrix) -> IFS:
    """The code whose map i is followed by a matrix about the middle of the map's image of the attractor."""
    middle = images(code)[i].mean(0).float()
    linear, offset, matrix = code.linear.clone(), code.offset.clone(), torch.as_tensor(matrix)
    linear[i], offset[i] = matrix @ linear[i], matrix @ (offset[i] - middle) + middle
    return replace(code, linear=linear, offset=offset)


def images(code: IFS) -> torch.Tensor:
    x = ops.chaos_game(code.linear, code.offset, trajectories=2000, length=60, warmup=50, seed=1,
                       probabilities=code.sampling_probabilities())
    return torch.einsum("nij,pj->npi", code.linear, x) + code.offset[:, None]


@pytest.mark.parametrize("truth", [fern(), random_suite(4)[3], twig()], ids=["fern", "suite 3", "twig"])
@pytest.mark.parametrize("which", [0, 1])
def test_right_maps_with_one_probability_near_1_are_not_exact(truth, which):
    p = torch.full((len(truth),), 1e-6)
    p[which] += 1 - p.sum()
    error = code_error(replace(attractor.normalize(truth), probabilities=p), truth, **SIZE, align="none")
    assert error.displacement_px < 1e-3 and not error.missed and not error.spurious
    assert not error.exact and error.f1 < error.ceiling_f1 - 0.1 and error.improbable


@pytest.mark.parametrize("matrix", [[[-1.0, 0], [0, 1]], [[1.0, 0], [0, -1]], [[0.0, -1], [1, 0]], [[-1.0, 0], [0, -1]],
                                    [[0.5, 0], [0, 0.5]]], ids=["mirrored", "flipped", "90°", "180°", "half"])
def test_a_small_map_mirrored_turned_or_shrunk_is_missed(matrix):
    truth = twig()
    error = code_error(changed(truth, 3, matrix), truth, resolution=20, points_in_view=100_000, align="none")
    assert error.matters[3] and dict((j, px) for _, j, px in error.pairs)[3] < 1, "and yet within a pixel"
    assert error.missed == (3,) and error.spurious == (3,) and not error.exact


@pytest.mark.parametrize("truth", [fern(), twig(), replace(codes.known("fern"), meta={}), *random_suite(3)],
                         ids=["fern", "twig", "published fern", "suite 0", "suite 1", "suite 2"])
def test_a_recovery_with_a_tiny_error_is_exact(truth):
    framed, noise = attractor.normalize(truth), torch.Generator().manual_seed(3)
    order = torch.randperm(len(truth), generator=noise)
    p = framed.sampling_probabilities() * (1 + 0.05 * torch.rand(len(truth), generator=noise))
    found = IFS((framed.linear + 1e-4 * torch.randn(framed.linear.shape, generator=noise))[order],
                (framed.offset + 1e-4 * torch.randn(framed.offset.shape, generator=noise))[order], (p / p.sum())[order])
    error = code_error(found, truth, **SIZE, align="none")
    assert error.exact, error
    assert not error.equivalent(pd.DataFrame({"f1": [1.0]}), pd.DataFrame({"f1": [1.0]}))


def test_equal_maps_may_be_swapped_and_share_their_probability():
    one = twig()
    truth = IFS(one.linear[[0, 1, 2, 3, 3]], one.offset[[0, 1, 2, 3, 3]], torch.tensor([0.2, 0.3, 0.3, 0.05, 0.15]))
    truth = attractor.normalize(truth)
    apart = torch.tensor([[0.0, 0], [0, 0], [0, 0], [1e-4, 0], [-1e-4, 0]])
    swapped = replace(truth, offset=truth.offset + apart, probabilities=torch.tensor([0.2, 0.3, 0.3, 0.15, 0.05]))
    assert code_error(swapped, truth, **SIZE, align="none").exact
    assert code_error(truth, swapped, **SIZE, align="none").exact
    once = IFS(truth.linear[:4], truth.offset[:4], torch.tensor([0.2, 0.3, 0.3, 0.2]))
    assert code_error(once, truth, **SIZE, align="none").exact and code_error(truth, once, **SIZE, align="none").exact


def test_another_code_of_the_same_attractor_is_equivalent_not_exact(triangle):
    third = 2 * math.pi / 3
    turn = torch.tensor([[math.cos(third), -math.sin(third)], [math.sin(third), math.cos(third)]])
    middle = 2 * triangle.offset.mean(0)
    # x -> f_i(R x), R the triangle's own turn by 120° about its middle.
    turned = replace(triangle, linear=triangle.linear @ turn,
                     offset=triangle.offset + triangle.linear @ (middle - turn @ middle))
    error = code_error(turned, triangle, **SIZE, align="none")
    scores, ceiling = evaluate(turned, triangle, **SIZE, align="none"), evaluate(triangle, triangle, **SIZE)
    assert not error.exact and error.equivalent(scores, ceiling)
    assert not error.equivalent(scores.assign(f1=scores.f1 - 0.05), ceiling)
