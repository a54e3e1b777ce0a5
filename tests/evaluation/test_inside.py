"""Likeness inside a shape: SSIM around it, and the dark within its outline."""

import numpy as np
import pytest
import torch

from fractal_exp.errors import InputError
from fractal_exp.evaluation.inside import f1_dark, outline, ssim_inside


def disc(side=128, radius=40.0):
    at = torch.arange(side) - (side - 1) / 2
    return (at[:, None].square() + at.square() < radius**2).float()


def crossed(side=128):
    """A white square with thin black crosses left out, to its edges."""
    image = torch.zeros(side, side)
    image[16:112, 16:112] = 1
    for at in (40, 64, 65, 88):
        image[at, 16:112] = image[16:112, at] = 0
    return image


def test_it_is_the_mean_of_the_map_of_the_library():
    structural = pytest.importorskip("skimage.metrics").structural_similarity
    a, b = torch.rand(2, 64, 64, generator=torch.Generator().manual_seed(0))
    b[:20] = 0
    _, full = structural(a.double().numpy(), b.double().numpy(), data_range=1.0, gaussian_weights=True,
                         use_sample_covariance=False, full=True)
    assert ssim_inside(a, b, above=-1) == pytest.approx(full.mean(), abs=1e-9)
    assert ssim_inside(a, torch.zeros(64, 64)) == pytest.approx(ssim_inside(a, torch.zeros(64, 64), above=-1))
    assert ssim_inside(a, b) < ssim_inside(b, b) == pytest.approx(1)


def test_it_looks_at_the_shape_and_little_beyond():
    shape, far, near = disc(radius=20.0), disc(radius=20.0), disc(radius=20.0)
    far[:8, :8] = near[64, 85:88] = 1
    assert ssim_inside(far, shape) == pytest.approx(1) and ssim_inside(near, shape) < 0.995


def test_the_dark_of_crosses_is_lost_in_a_filled_square():
    image, filled = crossed(), torch.zeros(128, 128)
    filled[16:112, 16:112] = 1
    assert f1_dark(filled, image) == 0 and f1_dark(image, image) == 1
    assert f1_dark(image.roll(1, 0), image) == pytest.approx(1, abs=0.03), "to within a pixel"
    assert ssim_inside(filled, image) < 0.6 < 0.999 < ssim_inside(image, image)


def test_the_gaps_of_branches_are_dark_and_lie_within_the_outline():
    comb = torch.zeros(128, 128)
    comb[20:100, 24:104:8] = comb[96:100, 24:104] = 1
    slab = torch.zeros(128, 128)
    slab[20:100, 24:97] = 1
    assert f1_dark(slab, comb) == pytest.approx(0, abs=0.01) and f1_dark(comb, comb) == 1
    whole = outline(comb.numpy() > 0)
    assert whole[30:90, 26:95].all() and not whole[:18].any() and not whole[:, 100:][:90].any()


def test_a_disc_has_no_dark_inside():
    assert f1_dark(disc(), disc()) is None and f1_dark(0 * disc(), disc()) is None
    ring = disc() - disc(radius=20.0)
    assert f1_dark(ring, ring) == 1 and f1_dark(disc(), ring) == 0
    assert f1_dark(disc(), 0 * disc()) is None and not outline(np.zeros((32, 32), bool)).any()


@pytest.mark.parametrize("measure", [ssim_inside, f1_dark])
def test_images_of_other_shapes_are_refused(measure):
    with pytest.raises(InputError, match=r"got \(64, 64\) and \(128, 128\); bring both to one size"):
        measure(disc(64), disc())
