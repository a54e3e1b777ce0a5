import math
import warnings

import pytest
import torch
from ops_helpers import assert_close, numba_threads, random_code

from fractal_exp import InputError
from fractal_exp.ops import chaos_game

GAME = dict(trajectories=5, length=8, warmup=2, seed=3)


def test_twin_has_the_gradient_of_its_values():
    code = random_code(2, maps=3, dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda linear, offset: chaos_game(linear, offset, **GAME, backend="torch"), code)


@pytest.mark.parametrize("batch, maps, game", [
    ((), 1, dict(trajectories=1, length=1, warmup=0)),
    ((), 1, dict(trajectories=3, length=9, warmup=8)),
    ((), 10, dict(trajectories=1, length=250, warmup=10)),
    ((), 33, dict(trajectories=65, length=30, warmup=0)),
    ((3,), 64, dict(trajectories=32, length=20, warmup=5)),
    ((2, 2), 2, dict(trajectories=33, length=12, warmup=3)),
])
@pytest.mark.parametrize("seed", [0, -5, 2**63 - 1])
def test_kernel_agrees_with_the_twin(batch, maps, game, seed):
    results = []
    for dtype, backend in ((torch.float32, "cpu"), (torch.float64, "torch")):
        linear, offset = random_code(*batch, maps=maps, dtype=dtype)
        points = chaos_game(linear, offset, **game, seed=seed, backend=backend)
        cotangent = torch.randn(points.shape, generator=torch.Generator().manual_seed(1)).to(dtype)
        results.append((points, *torch.autograd.grad(points, (linear, offset), cotangent)))
    for name, got, expected in zip(("points", "linear's gradient", "offset's gradient"), *results, strict=True):
        assert_close(got, expected, name)


@pytest.mark.parametrize("maps", [1, 2, 7, 64, 1000])
@pytest.mark.parametrize("given", [False, True])
def test_kernel_draws_exactly_the_twins_numbers(maps, given):
    p = torch.rand(2, maps, generator=torch.Generator().manual_seed(0)) ** 4 if given else None
    p = p / p.sum(-1, keepdim=True) if given else None
    start_only = (torch.eye(2).expand(2, 1, 2, 2), torch.zeros(2, 1, 2))
    number = torch.arange(float(maps))[:, None].expand(2, maps, 2)
    for seed in (0, 7, torch.tensor([1, -1])):
        game = dict(trajectories=40, length=50, warmup=0, seed=seed)
        starts, indices = zip(*(
            (chaos_game(*start_only, **game, backend=backend),
             chaos_game(torch.zeros(2, maps, 2, 2), number, probabilities=p, **game, backend=backend))
            for backend in ("cpu", "torch")), strict=True)
        assert torch.equal(*starts)
        assert torch.equal(*indices)


def test_results_do_not_depend_on_the_number_of_threads():
    results = []
    for threads in (1, 2):
        with numba_threads(threads):
            linear, offset = random_code(2, maps=5)
            points = chaos_game(linear, offset, trajectories=201, length=40)
            results.append((points, *torch.autograd.grad(points.square().sum(), (linear, offset))))
    for one, two in zip(*results, strict=True):
        assert torch.equal(one, two)


@pytest.mark.parametrize("backend", ["cpu", "torch"])
def test_codes_share_random_numbers_unless_each_has_a_seed(backend):
    linear, offset = (t.detach().expand(2, *t.shape) for t in random_code(maps=4))
    shared = chaos_game(linear, offset, **GAME, backend=backend)
    assert torch.equal(shared[0], shared[1])
    seeds = torch.tensor([3, 4])
    own = chaos_game(linear, offset, **{**GAME, "seed": seeds}, backend=backend)
    assert torch.equal(own[0], shared[0])
    assert not torch.equal(own[1], shared[0])
    assert torch.equal(own[1], chaos_game(linear[1], offset[1], **{**GAME, "seed": 4}, backend=backend))


def test_maps_are_drawn_with_their_probabilities():
    p = torch.tensor([0.0, 0.5, 0.0, 0.3, 0.2, 0.0])
    number = torch.arange(6.0)[:, None].expand(6, 2)
    drawn = chaos_game(torch.zeros(6, 2, 2), number, probabilities=p, trajectories=4000, length=26, warmup=1)[:, 0]
    drawn = drawn.long().view(4000, 25)
    n = drawn.numel()
    counts = torch.bincount(drawn.flatten(), minlength=6)
    assert torch.equal(counts == 0, p == 0)
    assert ((counts - n * p).abs() <= 5 * (n * p * (1 - p)).sqrt()).all()
    # Neither successive draws nor neighbouring trajectories know of each other.
    for pair in (drawn[:, :-1] * 6 + drawn[:, 1:], drawn[:-1] * 6 + drawn[1:]):
        q = torch.outer(p, p).flatten()
        counts = torch.bincount(pair.flatten(), minlength=36)
        assert ((counts - pair.numel() * q).abs() <= 5 * (pair.numel() * q * (1 - q)).sqrt()).all()


def test_starts_are_uniform_on_the_canvas():
    start = chaos_game(torch.eye(2)[None], torch.zeros(1, 2), trajectories=40_000, length=1, warmup=0).double()
    assert start.min() >= -1
    assert start.max() < 1
    cells = ((start + 1) * 4).long()
    counts = torch.bincount(cells[:, 0] * 8 + cells[:, 1], minlength=64).double()
    assert ((counts - 625) ** 2 / 625).sum() < 126  # chi-squared, 63 degrees of freedom: 126 is 1 in 200 000


def test_triangle_has_no_point_whose_coordinates_share_a_binary_digit():
    corner = torch.tensor([[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]])
    points = chaos_game(torch.eye(2).expand(3, 2, 2) / 2, corner, trajectories=200, length=100, warmup=40)
    digits = (points.double() * 2**12).floor().long()
    assert (digits[:, 0] & digits[:, 1] == 0).all()


@pytest.mark.parametrize("backend", ["cpu", "torch"])
def test_points_that_run_away_are_held_and_pass_no_gradient_on(backend):
    linear, offset = random_code(maps=3)
    expanding = (20 * linear.detach()).requires_grad_()
    points = chaos_game(expanding, offset, trajectories=20, length=250, backend=backend)
    assert float(points.detach().abs().max()) == 1e6
    (points * torch.rand(points.shape, generator=torch.Generator().manual_seed(0))).sum().backward()
    assert bool(expanding.grad.isfinite().all()) and bool(offset.grad.isfinite().all())


def test_held_points_have_the_twins_gradient():
    linear, offset = (t.detach() for t in random_code(maps=3))
    game = dict(trajectories=20, length=14, warmup=4, seed=1)
    grads = {}
    for backend in ("cpu", "torch"):
        code = ((9 * linear).requires_grad_(), offset.clone().requires_grad_())
        points = chaos_game(*code, backend=backend, **game)
        held = points.detach().abs() == 1e6
        assert 0.02 < float(held.float().mean()) < 0.9
        (points / 1e6).sum().backward()
        grads[backend] = [t.grad for t in code]
    for ours, twin in zip(grads["cpu"], grads["torch"], strict=True):
        assert float((ours - twin).norm() / twin.norm()) < 1e-4


LINEAR, OFFSET = (t.detach() for t in random_code(4, maps=3))


@pytest.mark.parametrize("change, message", [
    (dict(linear=[[1.0]]), "linear must be a torch tensor"),
    (dict(linear=torch.zeros(3, 2)), r"linear must have shape \(…, N, 2, 2\)"),
    (dict(linear=torch.zeros(4, 0, 2, 2)), "linear must not be empty"),
    (dict(offset=torch.zeros(4, 2)), r"offset must have shape \(4, 3, 2\)"),
    (dict(offset=OFFSET.double()), "agree in dtype and device"),
    (dict(linear=LINEAR.half(), offset=OFFSET.half()), "backend='auto' needs float32"),
    (dict(linear=LINEAR.double(), offset=OFFSET.double(), backend="cpu"), "backend='cpu' needs float32 tensors on the"),
    (dict(backend="numpy"), "backend must be one of auto, "),
    (dict(linear=torch.zeros(70_000, 2, 2), offset=torch.zeros(70_000, 2)), "at most 65536 maps"),
    (dict(trajectories=0), "trajectories must be an integer of at least 1"),
    (dict(warmup=250), "warmup must be an integer from 0 to length - 1 = 249"),
    (dict(seed=0.5), "seed must be an integer of 64 bits"),
    (dict(seed=torch.zeros(4)), r"a tensor of seeds must be int64 of the batch's shape \(4,\)"),
    (dict(probabilities=torch.ones(2) / 2), r"probabilities must have shape \(3,\)"),
    (dict(probabilities=torch.tensor([0.5, -0.5, 1.0])), "probabilities must not be negative or NaN, got -0.5"),
    (dict(probabilities=torch.tensor([0.5, math.nan, 1.0])), "probabilities must not be negative or NaN"),
    (dict(probabilities=torch.ones(4, 3)), "probabilities must sum to 1, got 3; divide"),
])
def test_bad_input_is_refused_in_one_line(change, message):
    arguments = dict(linear=LINEAR, offset=OFFSET) | change
    with pytest.raises(InputError, match=message) as caught:
        chaos_game(arguments.pop("linear"), arguments.pop("offset"), **arguments)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("exponent", [-90, -30, 30])
def test_a_cotangent_times_a_power_of_two_gives_the_gradient_times_it_bit_for_bit(exponent):
    """Of the last points alone, whose gradient fades to nothing on the way back through the trajectories."""
    code = random_code(maps=4)
    points = chaos_game(*code, trajectories=40, length=300, backend="cpu")
    cotangent = torch.zeros_like(points)
    cotangent.view(40, 290, 2)[:, -1] = torch.randn(40, 2, generator=torch.Generator().manual_seed(1))
    whole = torch.autograd.grad(points, code, cotangent, retain_graph=True)
    scaled = torch.autograd.grad(points, code, cotangent * 2.0**exponent)
    for ours, expected in zip(scaled, whole, strict=True):
        assert torch.equal(ours, expected * 2.0**exponent)


def test_what_gets_no_gradient_or_has_nan_is_warned_of():
    game = dict(trajectories=2, length=12)
    with pytest.warns(UserWarning, match="probabilities require a gradient and get none here; give .*detach") as told:
        chaos_game(LINEAR, OFFSET, probabilities=(torch.ones(3) / 3).requires_grad_(), **game)
    assert len(told) == 1 and told[0].filename == __file__
    with pytest.warns(UserWarning, match="offset has NaN") as told:
        chaos_game(LINEAR, OFFSET * math.nan, **game)
    assert told[0].filename == __file__
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        chaos_game(LINEAR, OFFSET, probabilities=torch.ones(3) / 3, **game)
