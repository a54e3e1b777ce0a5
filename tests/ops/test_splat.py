import math
import warnings

import numpy as np
import pytest
import torch
from cuda_helpers import AWKWARD, scatter
from ops_helpers import assert_close, numba_threads
from torch.nn.functional import avg_pool2d

from fractal_exp import InputError
from fractal_exp.ops import splat

BACKENDS = ["cpu", "torch"]


@pytest.mark.parametrize("sigma_px, supersample", [(0.6, 1), (0.9, 2)])
def test_twin_has_the_gradient_of_its_values(sigma_px, supersample):
    side = 5 * supersample
    # Off the pixels' centres, for the gradient does not follow the value where opacity is cut at 0.99.
    pixel = torch.tensor([[0, 0], [1, 2], [4, 2], [4, 3], [-1, 4], [2, 2]]) + 0.3 + 0.1 * scatter(2, 6).double()
    points = ((2 * pixel + 1) / side - 1).requires_grad_()
    assert torch.autograd.gradcheck(
        lambda p: splat(p, 5, sigma_px=sigma_px, supersample=supersample, backend="torch"), points)


@pytest.mark.parametrize("name", AWKWARD)
@pytest.mark.parametrize("resolution, supersample, sigma_px", [
    (7, 3, 2.5), (32, 5, 2.5), (64, 1, 1.0), (1, 1, 0.3), (10, 2, 12.0), (20, 4, 0.05), (3, 200, 15.0),
])
def test_kernel_agrees_with_the_twin(name, resolution, supersample, sigma_px):
    results = []
    for dtype, backend in ((torch.float32, "cpu"), (torch.float64, "torch")):
        points = AWKWARD[name].to(dtype).requires_grad_()
        image = splat(points, resolution, sigma_px=sigma_px, supersample=supersample, backend=backend)
        cotangent = torch.randn(image.shape, generator=torch.Generator().manual_seed(1)).to(dtype)
        results.append((image, *torch.autograd.grad(image, points, cotangent)))
    (image, gradient), (true_image, true_gradient) = results
    assert_close(image, true_image, "image", factor=2)  # the Gaussians' own polynomial is good to 4e-7 of alpha
    # Pixels on opposite sides of a point pull in opposite directions: the sum has fewer digits than its terms. Where
    # all has faded out, none is left to compare.
    assert_close(gradient + 1e-12, true_gradient + 1e-12, "gradient", factor=10)


@pytest.mark.parametrize("backend", BACKENDS)
def test_one_point_is_its_gaussian(backend):
    resolution, sigma_px, (x, y) = 24, 1.7, (0.23, -0.41)
    c = np.arange(resolution)
    px, py = (2 * c + 1) / resolution - 1, 1 - (2 * c + 1) / resolution
    squared = ((px[None, :] - x) ** 2 + (py[:, None] - y) ** 2) * (resolution / 2) ** 2
    alpha = np.exp(-squared / (2 * sigma_px**2))
    expected = np.where(alpha >= 1 / 255, np.minimum(alpha, 0.99), 0)
    image = splat(torch.tensor([[x, y]]), resolution, sigma_px=sigma_px, supersample=1, backend=backend)
    np.testing.assert_allclose(image.numpy(), expected, atol=2e-6)


@pytest.mark.parametrize("backend", BACKENDS)
def test_two_points_multiply_their_transmittances(backend):
    a, b = (torch.tensor([p]) for p in ((0.1, 0.1), (0.17, 0.04)))
    one, two, both = (splat(p, 32, sigma_px=3, supersample=1, backend=backend) for p in (a, b, torch.cat([a, b])))
    torch.testing.assert_close(both, 1 - (1 - one) * (1 - two), atol=1e-6, rtol=0)


@pytest.mark.parametrize("backend", BACKENDS)
def test_gradient_does_not_stop_where_opacity_meets_its_limit(backend):
    resolution, sigma_px, shift = 16, 2.0, 0.1  # the shift from pixel (8, 8)'s centre, in pixels
    center = torch.tensor([[1 / 16 + shift / 8, -1 / 16]], requires_grad=True)
    image = splat(center, resolution, sigma_px=sigma_px, supersample=1, backend=backend)
    assert float(image[8, 8].detach()) == pytest.approx(0.99)
    gradient, = torch.autograd.grad(image[8, 8], center)
    slope = -shift / sigma_px**2 * math.exp(-(shift**2) / (2 * sigma_px**2)) * resolution / 2
    torch.testing.assert_close(gradient, torch.tensor([[slope, 0.0]]), rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("backend", BACKENDS)
def test_supersampling_is_the_mean_of_a_finer_image(backend):
    points = scatter(200)
    fine = splat(points, 60, sigma_px=2, supersample=1, backend=backend)
    coarse = splat(points, 20, sigma_px=2, supersample=3, backend=backend)
    torch.testing.assert_close(coarse, avg_pool2d(fine[None], 3)[0], atol=1e-6, rtol=0)


@pytest.mark.filterwarnings("ignore:points has NaN")
@pytest.mark.parametrize("backend", BACKENDS)
def test_infinite_points_are_not_drawn_and_get_no_gradient(backend):
    inf, nan = math.inf, math.nan
    lost = torch.tensor([[inf, 0], [0, -inf], [nan, 0.1], [0.1, nan], [-3e38, 3e38], [1e20, 0.0]])
    points = torch.cat([scatter(20), lost]).requires_grad_()
    image = splat(points, 16, backend=backend)
    assert torch.equal(image, splat(points[:20], 16, backend=backend))
    image.sum().backward()
    assert torch.isfinite(points.grad).all()
    assert (points.grad[20:] == 0).all()
    assert (points.grad[:20] != 0).any()


def test_results_do_not_depend_on_threads_nor_on_the_batch():
    points, results = scatter(3, 3000), []
    for threads in (1, 2):
        with numba_threads(threads):
            p = points.clone().requires_grad_()
            image = splat(p, 40)
            results.append((image, *torch.autograd.grad(image.square().sum(), p)))
    single = [points[i].clone().requires_grad_() for i in range(3)]
    images = [splat(p, 40) for p in single]
    gradients = torch.autograd.grad(sum(image.square().sum() for image in images), single)
    results.append((torch.stack(images), torch.stack(gradients)))
    for other in results[1:]:
        assert torch.equal(results[0][0], other[0])
        assert torch.equal(results[0][1], other[1])


@pytest.mark.parametrize("change, message", [
    (dict(points=np.zeros((4, 2))), "points must be a torch tensor, got ndarray"),
    (dict(points=torch.zeros(4, 3)), r"points must have shape \(…, P, 2\)"),
    (dict(points=torch.zeros(0, 2)), "points must not be empty"),
    (dict(points=torch.zeros(4, 2).int()), "backend='auto' needs float32"),
    (dict(points=torch.zeros(4, 2).double(), backend="cpu"), "backend='cpu' needs float32 tensors on the CPU"),
    (dict(backend="gpu"), "backend must be one of auto, "),
    (dict(resolution=0), "resolution must be an integer of at least 1"),
    (dict(supersample=0), "supersample must be an integer of at least 1"),
    (dict(sigma_px=0), "sigma_px must be a finite number"),
    (dict(sigma_px=math.nan), "sigma_px must be a finite number"),
])
def test_bad_input_is_refused_in_one_line(change, message):
    arguments = dict(points=scatter(4), resolution=8) | change
    with pytest.raises(InputError, match=message) as caught:
        splat(arguments.pop("points"), arguments.pop("resolution"), **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("exponent", [-90, -60, -30, -6, 9, 60])
def test_a_cotangent_times_a_power_of_two_gives_the_gradient_times_it_bit_for_bit(exponent):
    """No arithmetic meets a denormal number, which would round, and be slow: those that gradients of 1e-6 make with a
    transmittance of 1e-30, say. A dense cloud, so that there are such pixels."""
    points = scatter(2, 4000, spread=0.3).requires_grad_()
    image = splat(points, 32, backend="cpu")
    cotangent = torch.randn(image.shape, generator=torch.Generator().manual_seed(1))
    cotangent[1] *= 2.0**-20  # each code has its own scale
    whole, = torch.autograd.grad(image, points, cotangent, retain_graph=True)
    scaled, = torch.autograd.grad(image, points, cotangent * 2.0**exponent, retain_graph=True)
    expected, tiny = whole * 2.0**exponent, torch.finfo(torch.float32).tiny
    normal = (expected.abs() >= tiny) & (whole.abs() >= tiny)  # what has lost no digits
    assert float(normal.float().mean()) > 0.25
    assert torch.equal(scaled[normal], expected[normal])
    assert float((scaled - expected).abs().max()) <= tiny * 2.0**max(exponent, 0)


def test_points_with_nan_are_warned_of_and_infinite_ones_are_not():
    with pytest.warns(UserWarning, match="points has NaN") as told:
        splat(torch.tensor([[math.nan, 0.0]]), 8)
    assert told[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        splat(torch.tensor([[math.inf, 0.0]]), 8)


def test_a_cotangent_that_is_not_a_number_reaches_the_splats_that_cover_it_alone():
    """On a grid of points whose footprints overlap, by the twin's own answer."""
    steps = torch.linspace(-0.93, 0.96, 9)
    points, answers = torch.cartesian_prod(steps, steps), []
    for backend in BACKENDS:
        p = points.clone().requires_grad_()
        image = splat(p, 40, sigma_px=2.5, supersample=2, backend=backend)
        cotangent = torch.ones_like(image)
        cotangent[17, 23] = math.nan
        answers.append(torch.autograd.grad(image, p, cotangent)[0].isnan().any(-1))
    assert 0 < int(answers[0].sum()) < len(points) / 4
    assert not (answers[0] & ~answers[1]).any()
