"""The frame as seen by gradients: a picture that is normalised does not change where its code is moved or enlarged."""

import pytest
import torch
from chaotic_helpers import random

from fractal_exp.methods.chaotic.model import SVD, ForwardModel, Naive, frame

SMALL = {"resolution": 32, "maps": 3, "trajectories": 50, "length": 40, "warmup": 20}


def test_the_gradient_of_the_frame_is_that_of_finite_differences():
    points = torch.rand(2, 30, 2, dtype=torch.float64, generator=random()).mul(3).requires_grad_()
    assert torch.autograd.gradcheck(frame, points)


def test_points_in_rows_have_the_frame_of_single_ones_and_its_gradient():
    points = torch.rand(2, 30, 2, dtype=torch.float64, generator=random()).requires_grad_()
    single, rows = frame(points), frame(points.view(2, 6, 10))
    for one, other in zip(single, rows, strict=True):
        torch.testing.assert_close(other, one, rtol=0, atol=0)
        gradients = [torch.autograd.grad(each.square().sum(), points, retain_graph=True)[0] for each in (one, other)]
        torch.testing.assert_close(*gradients)


@pytest.mark.parametrize("change", ["enlarged", "moved"])
def test_no_gradient_asks_for_a_larger_or_a_moved_attractor(change):
    """d/dε of f(x) = A x + b with b (1 + ε), or b + ε (1 - A) t: the attractor enlarged, or moved by ε t."""
    linear = torch.tensor([[[0.5, 0.1], [0, 0.4]], [[0.4, 0], [-0.2, 0.3]], [[0.3, 0.2], [0, 0.5]]])
    offset = torch.tensor([[0.1, -0.3], [0.4, 0.2], [-0.3, 0.1]])
    raw = {name: value.requires_grad_() for name, value in Naive().encode(linear, offset).items()}
    cotangent = torch.randn(50 * 20, 2, generator=random())
    (ForwardModel(Naive(), **SMALL)(raw, 1).points * cotangent).sum().backward()
    by_offset = raw["offset"].grad / (1 - offset**2)  # b = tanh(raw)
    along = offset if change == "enlarged" else torch.tensor([0.7, 0.4]) - linear @ torch.tensor([0.7, 0.4])
    assert abs(float((by_offset * along).sum())) < 1e-3 * float((by_offset * along).abs().sum())


def test_the_maps_of_a_code_come_back_from_their_parameters():
    linear = torch.tensor([[[0.5, 0.3], [-0.1, 0.4]], [[0.2, 0.6], [0.5, -0.1]]])
    for parameterization in (SVD(), Naive()):
        maps = parameterization.decode(parameterization.encode(linear, torch.tensor([[0.1, -0.3], [0.4, 0.2]])))
        torch.testing.assert_close(maps.linear, linear, atol=1e-5, rtol=0)
        torch.testing.assert_close(maps.offset, torch.tensor([[0.1, -0.3], [0.4, 0.2]]))


def test_a_matched_target_lies_where_the_target_does():
    target = torch.zeros(32, 32)
    target[5, 9] = target[20, 15] = 1
    matched = ForwardModel(SVD(), **SMALL).match(target, seed=0)
    around = [matched[row - 4:row + 5, column - 4:column + 5] for row, column in ((5, 9), (20, 15))]
    for patch in around:
        for axis in (0, 1):
            assert float((patch.sum(axis) * torch.arange(-4, 5)).sum() / patch.sum()) == pytest.approx(0, abs=0.05)
