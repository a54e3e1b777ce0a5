"""Learning Fractals: its maps and its course by hand, its operators against their twins, and what it refuses."""

import math

import pytest
import torch
from rivals_helpers import TARGET, check_it_resumes_bit_for_bit, told

from fractal_exp.ifs.code import View
from fractal_exp.methods.learning_fractals import maps as affine
from fractal_exp.methods.learning_fractals.method import (
    LearningFractals32,
    LearningFractals256,
    LearningFractalsParams,
    LearningFractalsWalk,
    clip_gradients,
)
from fractal_exp.ops.sequences import blob_error, sequence
from fractal_exp.rendering.still import render
from fractal_exp.runtime.seeds import generator

SMALL = {"maps": 3, "iterations": 8, "points": 40, "sequences": 4}
METHODS = [LearningFractals32, LearningFractals256]
both_canvases = pytest.mark.parametrize("method", METHODS, ids=lambda method: method.__name__.lower())


def raw(dtype=torch.float32):
    return {name: value.to(dtype) for name, value in affine.initial(4, generator(7, "test")).items()}


def test_a_matrix_is_a_turn_a_stretch_a_turn_and_signs():
    numbers = {"theta1": torch.tensor([math.pi / 2]), "theta2": torch.tensor([0.0]), "s": torch.tensor([[0.0, 100.0]]),
               "d": torch.tensor([[.2, -.3]]), "b": torch.zeros(1, 2)}
    # diag(sign d) mirrors y, sigmoid(s) = (1/2, 1) stretches, R(pi/2) turns: (1,0) -> (0,1/2), (0,1) -> (1,0)
    assert torch.allclose(affine.matrices(numbers)[0], torch.tensor([[0.0, 1.0], [.5, 0.0]]), atol=1e-6)


def test_the_sign_is_straight_through():
    d = torch.tensor([.005, -2.0, 0.0], requires_grad=True)
    sign = affine.StraightThroughSign.apply(d)
    assert sign.tolist() == [1, -1, 1]
    (sign * torch.tensor([3.0, 5.0, 7.0])).sum().backward()
    assert d.grad.tolist() == [3, 5, 7]


def test_gradients_of_matrices_and_offsets_are_clipped_each_by_itself():
    numbers = {name: value.requires_grad_() for name, value in raw().items()}
    for name, value in numbers.items():
        value.grad = torch.full_like(value, .01 if name == "b" else 10.0)
    clip_gradients(numbers, 1.0)
    norms = {name: float(value.grad.norm()) for name, value in numbers.items()}
    assert math.hypot(*(norms[name] for name in affine.MATRIX)) == pytest.approx(1, abs=1e-4)
    assert norms["b"] == pytest.approx(.01 * math.sqrt(8)), "a small gradient stays as it is"
    numbers["b"].grad.fill_(10.0)
    clip_gradients(numbers, 1.0)
    assert float(numbers["b"].grad.norm()) == pytest.approx(1, abs=1e-4)


def test_a_step_is_adams():
    params = LearningFractalsParams(**SMALL, noise=0.0)
    walk = LearningFractalsWalk(TARGET, params, 0)
    state = walk.start()
    after = walk.step(state, 0)
    # the first step of Adam has the length of its rate, whatever the gradient
    moved = (after["raw/b"] - state["raw/b"]).abs()
    assert float(moved.max()) == pytest.approx(.05, rel=1e-3)
    assert float(after["exp_avg/b"].abs().max()) > 0 and torch.equal(after["best/b"], state["raw/b"])
    assert after["least"] < torch.inf


@pytest.mark.parametrize("backend", ["cpu", "torch"])
def test_a_sequence_begins_at_its_start_and_follows_the_maps(backend):
    one = torch.tensor([[[.5, 0.0], [0.0, .25]]])
    points = sequence(one, torch.tensor([[1.0, 0.0]]), torch.tensor([4.0, 8.0]), sequences=2, length=3, backend=backend)
    assert points.tolist() == [[[3.0, 2.0], [2.5, .5], [2.25, .125]]] * 2


def test_sequences_draw_maps_by_their_chances_and_differ():
    linear, offset = torch.zeros(3, 2, 2), torch.tensor([[0.0, 0], [1, 0], [2, 0]])
    points = sequence(linear, offset, torch.zeros(2), sequences=20, length=500, seed=1,
                      probabilities=torch.tensor([.5, .3, .2]))
    counts = [float((points[..., 0] == k).float().mean()) for k in range(3)]
    assert counts == pytest.approx([.5, .3, .2], abs=.02) and not torch.equal(points[0], points[1])


def test_kernels_agree_with_their_twins_and_so_do_their_gradients():
    image = torch.rand(48, 48, generator=torch.Generator().manual_seed(2))

    def worked(backend: str, dtype: torch.dtype):
        numbers = {name: value.requires_grad_() for name, value in raw(dtype).items()}
        linear = affine.matrices(numbers)
        points = sequence(linear, numbers["b"], affine.fixed_point(linear[0], numbers["b"][0]), sequences=5, length=70,
                          probabilities=affine.probabilities(linear), seed=3, backend=backend)
        errors = blob_error(affine.to_pixels(points, 48), image.to(dtype), backend=backend)
        (errors * torch.arange(1, 6)).sum().backward()
        return [points.detach(), errors.detach(), *(value.grad for value in numbers.values())]

    for ours, exact in zip(worked("cpu", torch.float32), worked("torch", torch.float64), strict=True):
        assert torch.allclose(ours.double(), exact, atol=2e-6 + 2e-5 * float(exact.abs().max()))


def test_the_gradient_of_the_twin_is_right():
    points = 8 * torch.rand(2, 5, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    image = torch.rand(9, 9, dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda x: blob_error(x, image), points.requires_grad_())


@pytest.mark.parametrize("backend", ["cpu", "torch"])
def test_a_blob_is_a_gaussian_about_its_pixel_cut_at_one(backend):
    point = torch.tensor([[[1.0, 2.0]]])
    r, c = torch.meshgrid(torch.arange(5.0), torch.arange(5.0), indexing="ij")
    drawn = torch.exp(-((r - 1) ** 2 + (c - 2) ** 2))
    assert float(blob_error(point, drawn, backend=backend)) == pytest.approx(0, abs=1e-12)
    twice = blob_error(point.expand(1, 2, 2), torch.zeros(5, 5), backend=backend)
    assert float(twice) == pytest.approx(float((2 * drawn).clamp(0, 1).square().mean()), rel=1e-5)


def test_a_code_is_returned_where_the_method_saw_it():
    walk = LearningFractalsWalk(TARGET, LearningFractalsParams(maps=3, side=64, points=2000), 0)
    state = walk.start()
    seen, drawn = walk.draw(state), render(walk.code(state), View(), resolution=64, points_in_view=40_000)
    assert float(seen.sum()) > 50
    assert float(((drawn > 0).float() - seen).abs().sum() / seen.sum()) < .4, "40000 points light more than 600 do"
    assert float((seen * (drawn > 0)).sum() / seen.sum()) > .9


def test_as_released_the_last_state_is_the_result():
    codes = {}
    for released in (False, True):
        walk = LearningFractalsWalk(TARGET, LearningFractalsParams(**SMALL, rate=5.0, as_released=released), 0)
        state = walk.start()
        for number in range(8):
            state = walk.step(state, number)
        codes[released] = walk.code(state)
        prefix = "raw/" if released else "best/"
        expected = affine.code({name: state[prefix + name] for name in raw()}, 32)
        assert torch.equal(codes[released].linear, expected.linear)
    assert not torch.equal(codes[False].linear, codes[True].linear)


@both_canvases
def test_a_fit_gets_better_tells_what_it_does_and_counts_what_it_draws(method):
    seen = told(made := method(**SMALL | {"iterations": 40, "side": 32}, previews=2))
    losses = [progress.scalars["loss"] for progress in seen]
    assert losses == sorted(losses, reverse=True) and losses[-1] < losses[0]
    assert [p.step for p in seen if p.preview is not None] == [20, 40] and seen[-1].preview.shape == (32, 32)
    found = made.reconstruct(TARGET)
    assert found.evaluations == 160 == seen[-1].scalars["evaluations"]
    assert found.stopped == "all 40 iterations done" and len(found.code) == 3


@both_canvases
def test_a_resumed_fit_ends_as_if_it_had_not_been_interrupted(method, tmp_path):
    check_it_resumes_bit_for_bit(lambda: method(**SMALL, seed=3), tmp_path / "checkpoint")
