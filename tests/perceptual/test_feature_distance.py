"""The kernels of the distance of features against the formulas that they stand for."""

import pytest
import torch

from fractal_exp.perceptual import distance_kernels as kernels
from fractal_exp.perceptual.feature_distance import squared_distance, unit_distance, unit_length


def features(*batch, channels=32, size=(9, 7), seed=0):
    """Such as a ReLU leaves them: about half of the values are 0."""
    return torch.randn(*batch, channels, *size, generator=torch.Generator().manual_seed(seed)).relu()


@pytest.mark.parametrize("layout", [torch.contiguous_format, torch.channels_last])
@pytest.mark.parametrize("batches", [((2,), ()), ((3,), (3,)), ((1,), (1,)), ((0,), ())])
@pytest.mark.parametrize("channels, size", [(16, (1, 1)), (64, (13, 11)), (272, (8, 16))])
def test_value_and_gradient_are_the_formulas(batches, channels, size, layout):
    a, b = (features(*batch, channels=channels, size=size, seed=seed) for seed, batch in enumerate(batches))
    a, weight = a.contiguous(memory_format=layout).requires_grad_(), features(channels=1, size=(channels, 1)).flatten()
    assert kernels.takes(a, b, weight)
    value = unit_distance([a], [b], [weight])
    cotangent = torch.randn(value.shape, generator=torch.Generator().manual_seed(5))
    (gradient,) = torch.autograd.grad(value, a, cotangent)
    exact = a.detach().double().requires_grad_()
    expected = squared_distance(unit_length(exact), unit_length(b.double()), weight.double())
    torch.testing.assert_close(value.double(), expected, rtol=1e-6, atol=0)
    (expected,) = torch.autograd.grad(expected, exact, cotangent.double())
    assert (gradient - expected).norm() <= 1e-6 * expected.norm()


def test_a_whole_batch_of_two_axes_and_no_batch_at_all():
    a, b, weight = features(2, 3, seed=1), features(2, 3, seed=2), torch.rand(32)
    each = [unit_distance([x], [y], [weight]) for x, y in zip(a.flatten(0, 1), b.flatten(0, 1), strict=True)]
    torch.testing.assert_close(unit_distance([a], [b], [weight]), torch.stack(each).view(2, 3), rtol=0, atol=0)


def test_equal_features_are_at_distance_zero():
    a = features(channels=48, size=(40, 40)).requires_grad_()
    value = unit_distance([a], [a.detach()], [torch.rand(48)])
    (gradient,) = torch.autograd.grad(value, a)
    assert float(value.detach()) == 0 and float(gradient.abs().max()) == 0


def test_pixels_without_features_stay_finite():
    a, b, weight = features(seed=1), features(seed=2), torch.rand(32)
    a[:, :3], b[:, 2:5] = 0, 0
    a.requires_grad_()
    value, twin = unit_distance([a], [b], [weight]), squared_distance(unit_length(a), unit_length(b), weight)
    torch.testing.assert_close(value, twin)
    assert all(torch.autograd.grad(each, a)[0].isfinite().all() for each in (value, twin))


@pytest.mark.parametrize("change", ["dtype", "channels", "target's gradient", "weights' gradient", "broadcast"])
def test_what_the_kernels_do_not_take_goes_by_the_formulas(change):
    a, b, weight = features(2, seed=1), features(2, seed=2), torch.rand(32)
    match change:
        case "dtype":
            a, b, weight = a.double(), b.double(), weight.double()
        case "channels":
            a, b, weight = a[:, :24], b[:, :24], weight[:24]
        case "target's gradient":
            b.requires_grad_()
        case "weights' gradient":
            weight.requires_grad_()
        case "broadcast":
            a = a[:1]
    assert not kernels.takes(a, b, weight)
    expected = squared_distance(unit_length(a), unit_length(b), weight)
    torch.testing.assert_close(unit_distance([a], [b], [weight]), expected, rtol=0, atol=0)
