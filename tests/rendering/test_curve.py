"""The tone curve: grey levels of masses, and back."""

from __future__ import annotations

import pytest
import torch

from fractal_exp.rendering.curve import Curve

CURVES = Curve(), Curve(gamma=2.2), Curve(gamma=0.5), Curve(linear=True), Curve(gamma=2.2, linear=True)


@pytest.fixture(params=CURVES, ids=str)
def curve(request):
    return request.param


def test_the_masses_of_grey_levels_show_these_levels(curve):
    grey = torch.linspace(0, 0.9, 50, dtype=torch.float64)
    torch.testing.assert_close(curve.grey(curve.mass(grey, 0.985)), grey)


def test_the_slope_is_the_derivative(curve):
    mass = torch.linspace(0.01, 0.9, 50, dtype=torch.float64, requires_grad=True)
    (derivative,) = torch.autograd.grad(curve.grey(mass).sum(), mass)
    torch.testing.assert_close(curve.slope(mass), derivative)


def test_the_slope_is_finite_at_black(curve):
    assert curve.slope(torch.zeros(1)).isfinite().all()


def test_white_has_the_mass_of_the_whitest_level_that_counts():
    white, almost = Curve().mass(torch.tensor([1.0, 0.9]), 0.9)
    assert white == almost


def test_a_mass_of_one_shows_its_share_of_ink():
    """By hand: 1 - 1/e is .6321, and its square root .7951."""
    one = torch.ones(1)
    assert Curve().grey(one).item() == pytest.approx(0.63212, abs=1e-5)
    assert Curve(gamma=2).grey(one).item() == pytest.approx(0.79506, abs=1e-5)
    assert Curve(gamma=2, linear=True).grey(one / 4).item() == pytest.approx(0.5)


def test_faint_masses_keep_their_digits_under_a_root():
    """In float32, 1 - exp(-1e-9) is 0."""
    faint = torch.tensor([1e-9])
    torch.testing.assert_close(Curve(gamma=6).grey(faint), faint ** (1 / 6))
