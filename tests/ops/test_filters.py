"""Separable filters: beside SciPy's, their gradient, and their sum."""

import numpy as np
import torch
from scipy.ndimage import correlate1d

from fractal_exp.ops.filters import filtered


def test_images_are_correlated_along_both_axes_with_zeros_beyond_their_edges():
    images, window = torch.randn(2, 5, 7, dtype=torch.float64), (0.1, 0.2, 0.4, 0.25, 0.05)
    expected = images.numpy()
    for axis in (1, 2):
        expected = correlate1d(expected, window, axis, mode="constant")
    np.testing.assert_allclose(filtered(images, window), expected, atol=1e-12)


def test_a_filter_has_gradients():
    images = torch.randn(1, 4, 5, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(lambda each: filtered(each, (0.2, 0.5, 0.3)), images)
