"""The terms of the objective against independent formulas, scikit-image and SciPy; their gradients; their guards."""

import numpy as np
import pytest
import torch
from scipy import stats
from skimage.metrics import structural_similarity

from fractal_exp.methods.chaotic import losses
from fractal_exp.methods.chaotic.losses import DSSIM, MipMSE, Moments, Regularizer, WeightedSum
from fractal_exp.methods.chaotic.rendering import Rendering
from fractal_exp.methods.chaotic.ssim import RADIUS, WINDOW, local_statistics, shifted_sums, ssim
from fractal_exp.methods.chaotic.ssim_kernels import TAPS, blurred

IMAGE_TERMS = {"mse": lambda: MipMSE(levels=1), "mip": MipMSE, "mip_stretch": lambda: MipMSE(stretch=True),
               "dssim": DSSIM, "moments": Moments}
IMAGE_FUNCTIONS = {
    "mse": losses.mse, "mip": losses.mip_mse, "moments": lambda image, target: moment_distance(image, target),
    "dssim": lambda image, target: 1 - ssim(image, target, local_statistics(target)),
    "mip_stretch": lambda image, target: losses.mip_mse(image, target, stretch=True),
}
each_term = pytest.mark.parametrize("name", IMAGE_TERMS)


def images(*shape, seed=0, dtype=torch.float32):
    """Random images with structure at several scales, about half of it black."""
    generator = torch.Generator().manual_seed(seed)
    side = shape[-1]
    coarse = torch.rand(*shape[:-2], 1, 8, 8, generator=generator, dtype=torch.float64)
    coarse = torch.nn.functional.interpolate(coarse.reshape(-1, 1, 8, 8), (side, side), mode="bilinear")
    fine = torch.rand(*shape, generator=generator, dtype=torch.float64)
    return (1.5 * coarse.reshape(shape) + 0.5 * fine - 0.75).clamp(0, 1).to(dtype)


def rendering(image, maps=3):
    batch = image.shape[:-2]
    return Rendering(image, torch.zeros(*batch, 1, 2), torch.full((*batch, maps, 2), 0.5), torch.zeros(*batch, maps, 2))


def moment_distance(image, target):
    return Moments().prepare(target)(rendering(image))


def blocks(image):
    side = image.shape[-1] // 2
    return image.reshape(side, 2, side, 2).mean((1, 3))


# --- values ---------------------------------------------------------------------------------------------------------

def test_mip_mse_is_the_mean_over_levels_of_the_mean_squared_error():
    a, b = images(64, 64, seed=1).numpy(), images(64, 64, seed=2).numpy()
    expected, (x, y) = [], (a, b)
    while len(x) >= 2:
        expected.append(((x - y) ** 2).mean())
        x, y = blocks(x), blocks(y)
    assert len(expected) == 6
    assert float(losses.mip_mse(torch.tensor(a), torch.tensor(b))) == pytest.approx(np.mean(expected), rel=1e-5)
    three = losses.mip_mse(torch.tensor(a), torch.tensor(b), levels=3)
    assert float(three) == pytest.approx(np.mean(expected[:3]), rel=1e-5)
    summed = losses.mip_mse(torch.tensor(a), torch.tensor(b), levels=3, summed=True)
    assert float(summed) == pytest.approx(np.sum(expected[:3]), rel=1e-5), "as in equation 5"


def test_stretched_mip_mse_stretches_before_the_error_and_before_the_next_level():
    a, b = images(64, 64, seed=1).numpy(), images(64, 64, seed=2).numpy()
    expected = [((a - b) ** 2).mean()]
    while len(a) > 2:
        a, b = ((x - x.min()) / (x.max() - x.min()) for x in (blocks(a), blocks(b)))
        expected.append(((a - b) ** 2).mean())
    got = losses.mip_mse(images(64, 64, seed=1), images(64, 64, seed=2), stretch=True)
    assert float(got) == pytest.approx(np.mean(expected), rel=1e-5)


@pytest.mark.parametrize("side", [11, 37, 128])
def test_dssim_agrees_with_scikit_image(side):
    a, b = images(2, side, side, seed=1), images(2, side, side, seed=2)
    options = dict(data_range=1.0, gaussian_weights=True, sigma=1.5, use_sample_covariance=False)
    expected = [1 - structural_similarity(x.numpy(), y.numpy(), **options)
                for x, y in zip(a.double(), b.double(), strict=True)]
    found = IMAGE_FUNCTIONS["dssim"](a, b).double()
    torch.testing.assert_close(found, torch.tensor(expected).double(), atol=2e-6, rtol=1e-5)


def test_moments_agree_with_scipy():
    counts = np.random.default_rng(0).integers(0, 9, (24, 24)) * (np.arange(24) > 15)  # light on the right
    centres = (2 * np.arange(24) + 1) / 24 - 1
    expected = []
    for weights, x in ((counts.sum(0), centres), (counts.sum(1), -centres)):  # y runs upwards
        sample = np.repeat(x, weights)
        expected += [sample.mean(), sample.var(), stats.skew(sample), stats.kurtosis(sample, fisher=False)]
    got = losses.moments(torch.tensor(counts, dtype=torch.float64))
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-12)


def test_moment_distance_adds_up_eight_squared_differences():
    a, b = images(32, 32, seed=1), images(32, 32, seed=2)
    difference = losses.moments(a) - losses.moments(b)
    assert difference.shape == (8,)
    torch.testing.assert_close(moment_distance(a, b), (difference**2).sum())


def test_regularizer_by_hand():
    singular = torch.tensor([[0.5, 0.2], [0.9, 0.9]])
    offset = torch.tensor([[0.3, -0.4], [0.0, 1.0]])
    expected = 0.25 + 0.04 + 0.25 + 10 * (1.5 / 1.2 - 1) ** 2 + 0.81 + 0.81 + 1.0
    assert float(losses.regularizer(singular, offset)) == pytest.approx(expected, rel=1e-6)
    assert float(losses.regularizer(singular.flip(-1), offset)) == pytest.approx(expected, rel=1e-6)
    assert float(losses.regularizer(singular, offset, condition_weight=0)) == pytest.approx(expected - 0.625, rel=1e-6)


# --- gradients ------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("name", IMAGE_FUNCTIONS)
def test_gradients_with_respect_to_both_images(name):
    generator = torch.Generator().manual_seed(0)  # no two pixels equal: the stretch has no gradient at a tied extreme
    a, b = (torch.rand(2, 16, 16, generator=generator, dtype=torch.float64, requires_grad=True) for _ in range(2))
    assert torch.autograd.gradcheck(IMAGE_FUNCTIONS[name], (a, b), fast_mode=True)
    assert torch.autograd.gradcheck(IMAGE_FUNCTIONS[name], (a[0].detach().requires_grad_(), b[1].detach()))


def test_gradients_of_the_regularizer():
    generator = torch.Generator().manual_seed(0)
    singular, offset = (torch.rand(2, 3, 2, generator=generator, dtype=torch.float64, requires_grad=True)
                        for _ in range(2))
    assert torch.autograd.gradcheck(losses.regularizer, (singular, offset))


@pytest.mark.parametrize("size", [(11, 11), (11, 40), (53, 12), (64, 64)])
def test_the_kernel_of_ssim_is_its_twin(size):
    image = torch.rand(2, *size, generator=torch.Generator().manual_seed(0))
    expected = shifted_sums(shifted_sums(image.double(), -1), -2)
    found = torch.from_numpy(blurred(image.numpy(), np.array(WINDOW)))
    torch.testing.assert_close(found.double(), expected, rtol=1e-7, atol=0)
    assert len(WINDOW) == TAPS == 2 * RADIUS + 1


@pytest.mark.parametrize("name", IMAGE_FUNCTIONS)
def test_the_gradient_in_single_precision_is_that_in_double(name):
    """Of the term as a fit has it: the target prepared, the image not a batch."""
    image, target = images(64, 64, seed=1).requires_grad_(), images(64, 64, seed=2)
    exact = image.detach().double().requires_grad_()
    term = IMAGE_TERMS[name]()
    gradients = [torch.autograd.grad(term.prepare(against)(rendering(each)), each)[0]
                 for each, against in ((image, target), (exact, target.double()))]
    assert (gradients[0] - gradients[1]).norm() < 1e-5 * gradients[1].norm()


# --- guards ---------------------------------------------------------------------------------------------------------

@each_term
@pytest.mark.parametrize("target", [torch.zeros(32, 32), torch.ones(32, 32), images(32, 32)],
                         ids=["black target", "white target", "target"])
@pytest.mark.parametrize("level", [0.0, 0.3, 1.0])
def test_constant_images_give_finite_values_and_gradients(name, target, level):
    image = torch.full((32, 32), level, requires_grad=True)
    value = IMAGE_TERMS[name]().prepare(target)(rendering(image))
    (gradient,) = torch.autograd.grad(value, image)
    assert torch.isfinite(value) and torch.isfinite(gradient).all()
    assert gradient.abs().max() < 100


# --- terms ----------------------------------------------------------------------------------------------------------

@each_term
def test_a_batch_equals_a_loop_and_the_function(name):
    batch, target = images(3, 32, 32, seed=1), images(32, 32, seed=2)
    term = IMAGE_TERMS[name]().prepare(target)
    got = term(rendering(batch))
    assert got.shape == (3,)
    torch.testing.assert_close(got, torch.stack([term(rendering(image)) for image in batch]))
    torch.testing.assert_close(got, IMAGE_FUNCTIONS[name](batch, target))


# --- weighted sum ---------------------------------------------------------------------------------------------------

def test_weighted_sum_adds_up_and_names_its_unweighted_terms():
    image, target = images(2, 32, 32, seed=1), images(32, 32, seed=2)
    terms = {"mse": MipMSE(), "ssim": DSSIM(), "regularizer": Regularizer()}
    objective = WeightedSum({"regularizer": 0.01, "mse": 10, "ssim": 1}, terms).prepare(target)
    total, named = objective(rendering(image))
    assert list(named) == ["mse", "ssim", "regularizer"]
    torch.testing.assert_close(named["mse"], losses.mip_mse(image, target))
    torch.testing.assert_close(total, 10 * named["mse"] + named["ssim"] + 0.01 * named["regularizer"])
    assert total.shape == (2,)
