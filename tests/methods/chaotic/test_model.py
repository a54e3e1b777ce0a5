import pytest
import torch
from chaotic_helpers import random

from fractal_exp.methods.chaotic.model import SVD, ForwardModel, Naive, frame, gram_schmidt

SMALL = {"resolution": 32, "maps": 3, "trajectories": 50, "length": 30}
PARAMETERIZATIONS = [SVD(), Naive()]


def test_initial_svd_parameters_follow_the_paper():
    raw = SVD().initial(4000, random())
    assert 0 <= float(raw["singular"].min()) and float(raw["singular"].max()) <= 1
    assert -1 <= float(raw["offset"].min()) < -0.99 and 0.99 < float(raw["offset"].max()) <= 1
    for factor in (raw["u"], raw["v"]):
        torch.testing.assert_close(factor.mT @ factor, torch.eye(2).expand(4000, 2, 2))
    determinants = torch.linalg.det(SVD().decode(raw).linear)
    assert float((determinants > 0).float().mean()) == pytest.approx(0.5, abs=0.04), "both orientations"
    angle = torch.atan2(raw["u"][:, 1, 0], raw["u"][:, 0, 0])
    assert float(torch.histc(angle, 8).min()) > 400, "uniform angles"


def test_svd_maps_are_contractive_whatever_the_raw_numbers():
    raw = {name: 8 * value for name, value in SVD().initial(200, random()).items()}
    maps = SVD().decode(SVD().project(raw))
    assert float(torch.linalg.matrix_norm(maps.linear, 2).max()) < 1
    assert float(maps.offset.abs().max()) <= 1
    torch.testing.assert_close(maps.singular.sort(descending=True).values, torch.linalg.svdvals(maps.linear),
                               atol=1e-5, rtol=1e-5)


def test_gram_schmidt_keeps_directions_and_orientation():
    matrix = torch.randn(300, 2, 2, generator=random())
    q = gram_schmidt(matrix)
    torch.testing.assert_close(q.mT @ q, torch.eye(2).expand(300, 2, 2))
    assert bool((torch.linalg.det(q).sign() == torch.linalg.det(matrix).sign()).all())
    torch.testing.assert_close(q[:, :, 0], matrix[:, :, 0] / matrix[:, :, 0].norm(dim=1, keepdim=True))
    torch.testing.assert_close(gram_schmidt(q), q)


@pytest.mark.parametrize("parameterization", PARAMETERIZATIONS)
def test_the_two_parameterizations_start_from_the_same_maps_and_take_batches(parameterization):
    raw = parameterization.initial(3, random())
    torch.testing.assert_close(parameterization.decode(raw).linear, SVD().decode(SVD().initial(3, random())).linear)
    batch = parameterization.decode({name: torch.stack([value, value]) for name, value in raw.items()})
    torch.testing.assert_close(batch.linear[1], parameterization.decode(raw).linear)
    torch.testing.assert_close(batch.singular[1], parameterization.decode(raw).singular)


def test_the_frame_centres_and_scales_to_the_padded_canvas():
    points = torch.rand(2, 500, 2, generator=random()) * torch.tensor([3.0, 1.0]) + 5
    scale, shift = frame(points)
    moved = points * scale[..., None, :] + shift[..., None, :]
    low, high = moved.amin(1), moved.amax(1)
    torch.testing.assert_close(high[:, 0] - low[:, 0], torch.full((2,), 1.5))
    torch.testing.assert_close(high + low, torch.zeros(2, 2), atol=1e-4, rtol=0)


@pytest.mark.parametrize("parameterization", PARAMETERIZATIONS)
def test_gradients_reach_every_raw_tensor(parameterization):
    model = ForwardModel(parameterization, **SMALL)
    raw = {name: value.requires_grad_() for name, value in parameterization.initial(3, random()).items()}
    rendering = model(raw, seed=1)
    assert rendering.image.shape == (32, 32) and rendering.points.shape == (50 * 20, 2)
    (rendering.image * torch.rand(32, 32, generator=random())).sum().backward()
    assert all(bool(value.grad.abs().sum() > 0) and bool(value.grad.isfinite().all()) for value in raw.values())


def test_the_seed_makes_the_drawing_and_a_batch_equals_its_parts():
    model = ForwardModel(SVD(), **SMALL)
    one, two = SVD().initial(3, random(1)), SVD().initial(3, random(2))
    assert torch.equal(model(one, 5).image, model(one, 5).image)
    assert not torch.equal(model(one, 5).image, model(one, 6).image)
    batch = model({name: torch.stack([one[name], two[name]]) for name in one}, 5)
    torch.testing.assert_close(batch.image[0], model(one, 5).image)
    torch.testing.assert_close(batch.image[1], model(two, 5).image)


def test_the_code_draws_what_the_model_draws():
    model = ForwardModel(SVD(), **{**SMALL, "trajectories": 500, "length": 60})
    raw = SVD().initial(3, random(4))
    code = model.code(raw, seed=5)
    points = model(raw, 5).points
    i = torch.randint(0, len(points), (200,), generator=random())
    # Every point's image under every map of the code is close to the attractor's points.
    images = torch.einsum("nij,kj->kni", code.linear, points[i]) + code.offset
    distance = torch.cdist(images.reshape(-1, 2), points).amin(1)
    assert float(distance.quantile(0.95)) < 0.02


def test_a_naive_code_that_does_not_contract_gives_no_nan():
    model = ForwardModel(Naive(), **{**SMALL, "length": 250})
    raw = {"linear": 1.5 * torch.eye(2).repeat(3, 1, 1), "offset": torch.randn(3, 2, generator=random())}
    raw = {name: value.requires_grad_() for name, value in raw.items()}
    rendering = model(raw, 0)
    rendering.image.square().sum().backward()
    assert bool(rendering.image.isfinite().all())
    assert all(bool(value.grad.isfinite().all()) for value in raw.values())


def test_a_matched_target_is_drawn_as_the_model_draws():
    model = ForwardModel(SVD(), **{**SMALL, "trajectories": 500, "length": 60})
    truth = model(SVD().initial(3, random(4)), 5)
    pixel = ((truth.points * torch.tensor([1.0, -1.0]) + 1) * 256).long().clamp(0, 511)
    lit = torch.zeros(512, 512)
    lit[pixel[:, 1], pixel[:, 0]] = 1
    target = lit.view(32, 16, 32, 16).mean((1, 3))  # as the points are, without the splats' width
    matched = model.match(target, seed=0)
    assert torch.equal(matched, model.match(target, seed=0))
    raw_error, matched_error = ((truth.image - image).square().mean() for image in (target, matched))
    assert float(matched_error) < 0.1 * float(raw_error)
