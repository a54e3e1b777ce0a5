"""The CUDA kernels and the fit on a real GPU: python -m pytest -m gpu. Skipped where there is none."""

import gc

import pytest
import torch
from cuda_helpers import AWKWARD, check_chaos_game, check_histogram, check_numbers, check_splat, scatter
from ops_helpers import assert_close, check_descent, check_pushforward, random_code, tiling_problem

from fractal_exp import View, codes
from fractal_exp.ifs import attractor
from fractal_exp.methods.chaotic.cuda_graph import WARM_UP
from fractal_exp.methods.chaotic.losses import DSSIM, MipMSE, Regularizer, WeightedSum
from fractal_exp.methods.chaotic.method import Chaotic, FitProblem
from fractal_exp.methods.chaotic.model import SVD, ForwardModel
from fractal_exp.methods.chaotic.optimizers import Alternating, GradientDescent
from fractal_exp.ops import chaos_game, cuda_launch, splat
from fractal_exp.ops.collage import Descent, descend

MISSING = ("torch finds no CUDA device here" if not torch.cuda.is_available() else
           "numba-cuda is not installed (pip install 'fractal-exp[cuda]')" if not cuda_launch.INSTALLED else
           "numba's simulator has taken CUDA's place" if cuda_launch.SIMULATED else None)
pytestmark = [pytest.mark.gpu, pytest.mark.skipif(MISSING is not None, reason=MISSING or "")]

PAPER = dict(trajectories=2000, length=250, warmup=10, seed=3)


@pytest.mark.parametrize("maps", [1, 2, 3, 7, 10, 16, 31, 33, 48, 63, 64, 65, 300])
@pytest.mark.parametrize("batch, game", [
    ((), dict(trajectories=65, length=30, warmup=0, seed=0)), ((2, 3), dict(trajectories=33, length=12, warmup=11,
                                                                           seed=-5)), ((), PAPER),
])
def test_chaos_game_agrees_with_the_twin(batch, maps, game):
    check_chaos_game(batch, maps, game)


@pytest.mark.parametrize("maps", [1, 2, 7, 64, 1000, 65_536])
@pytest.mark.parametrize("given", [False, True])
def test_chaos_game_draws_exactly_the_twins_numbers(maps, given):
    check_numbers(maps, given, trajectories=70, length=50)


@pytest.mark.parametrize("name", AWKWARD)
@pytest.mark.parametrize("resolution, supersample, sigma_px", [
    (7, 3, 2.5), (33, 5, 2.5), (64, 1, 1.0), (1, 1, 0.3), (10, 2, 12.0), (20, 4, 0.05), (3, 200, 15.0), (9, 3, 60.0),
])
def test_splat_agrees_with_the_twin(name, resolution, supersample, sigma_px):
    check_splat(AWKWARD[name], resolution, supersample, sigma_px)


@pytest.mark.parametrize("points, sigma_px", [
    (lambda: scatter(2_000_000), 0.8),  # most of the image is neither black nor white
    (lambda: scatter(2_000_000, spread=0.02), 2.5),  # all in a few tiles
    (lambda: fern(2_000_000), 2.5),
], ids=["spread", "crowded", "fern"])
def test_two_million_points_splatted_agree_with_the_twin(points, sigma_px):
    # Of so many opacities some are so near to 1/255 that rounding decides whether they count.
    check_splat(points(), 1024, 5, sigma_px, factor=50)


def fern(count):
    code = attractor.normalize(codes.known("fern"))
    return chaos_game(code.linear, code.offset, probabilities=code.sampling_probabilities(), trajectories=count // 200,
                      length=300, warmup=100, seed=0)


@pytest.mark.parametrize("maps", [1, 3, 9, 64, 300])
@pytest.mark.parametrize("size", [16, 128])
def test_measures_are_pushed_forward_as_the_twin_does(maps, size):
    check_pushforward("cuda", "cuda", maps=maps, size=size)


@pytest.mark.parametrize("tied", [False, True])
@pytest.mark.parametrize("problem", [{"maps": 1, "grids": 1, "size": 16}, {"maps": 3}, {"maps": 9, "size": 128},
                                     {"maps": 64}, {"maps": 300, "size": 128}], ids=str)
def test_descents_go_as_the_twins_do(tied, problem):
    check_descent("cuda", Descent(10, rate=0.01, tied=tied), "cuda", astray=0.1, **problem)


def test_descents_repeat_bit_for_bit_and_do_not_wait():
    measure, maps, weights = tiling_problem(size=64, maps=8)
    measure = type(measure)(measure.samples.cuda(), measure.bins.cuda())
    first = descend(maps.cuda(), weights.cuda(), measure, Descent(150))
    maps, weights, done = maps.cuda(), weights.cuda(), torch.cuda.Event()
    torch.cuda._sleep(2_000_000_000)
    again = descend(maps, weights, measure, Descent(150))
    done.record()
    assert not done.query(), "the host waited"
    assert all(torch.equal(a, b) for a, b in zip(first, again, strict=True))


def both(code, game=PAPER, resolution=256):
    """Forward and backward of the two operations in a row."""
    points = chaos_game(*code, **game)
    image = splat(points, resolution)
    return points, image, *torch.autograd.grad(image.square().sum(), code)


def gpu_code(*batch, maps=10):
    return tuple((t.detach() * 0.7).cuda().requires_grad_() for t in random_code(*batch, maps=maps))


def test_results_repeat_bit_for_bit_and_do_not_depend_on_the_batch():
    code = gpu_code(3)
    first = both(code)
    for again in (both(code) for _ in range(5)):
        assert all(torch.equal(a, b) for a, b in zip(first, again, strict=True))
    single = both(tuple(t[1].detach().requires_grad_() for t in code))
    for name, a, b in zip(("points", "image", "linear", "offset"), first, single, strict=True):
        # torch sums the warps' gradients, in an order that depends on the shape.
        assert_close(a[1], b, name, factor=0 if name in ("points", "image") else 1)


def test_a_thousand_iterations_take_no_more_memory_than_one():
    code = gpu_code()
    both(code)
    torch.cuda.synchronize()
    gc.collect()  # of the tests before this one
    held, free = torch.cuda.memory_allocated(), torch.cuda.mem_get_info()[0]
    for _ in range(1000):
        both(code)
    torch.cuda.synchronize()
    gc.collect()
    assert torch.cuda.memory_allocated() == held
    assert free - torch.cuda.mem_get_info()[0] < 64e6  # the driver's own view, numba's memory included


def test_nothing_waits_for_the_device():
    code = gpu_code()
    both(code)
    torch.cuda.set_sync_debug_mode("error")
    try:
        both(code)
    finally:
        torch.cuda.set_sync_debug_mode("default")
    # torch's watch does not see numba: the host must be through long before a device that is kept busy.
    done = torch.cuda.Event()
    torch.cuda._sleep(2_000_000_000)
    both(code)
    done.record()
    assert not done.query()
    torch.cuda.synchronize()


def test_kernels_run_on_the_current_stream_in_their_turn():
    code, stream = gpu_code(), torch.cuda.Stream()
    expected = both(code)
    torch.cuda.synchronize()
    late = tuple(torch.zeros_like(t).requires_grad_() for t in code)
    with torch.cuda.stream(stream):
        torch.cuda._sleep(200_000_000)
        with torch.no_grad():
            for empty, full in zip(late, code, strict=True):
                empty.copy_(full)
        got = both(late)
    stream.synchronize()
    assert all(torch.equal(a, b) for a, b in zip(got, expected, strict=True))


def test_a_cuda_graph_replays_both_passes_with_any_seed():
    code, seed = gpu_code(), torch.zeros((), dtype=torch.int64, device="cuda")
    both(code)
    graph = torch.cuda.CUDAGraph()
    side = torch.cuda.Stream()
    with torch.cuda.stream(side):
        both(code, PAPER | {"seed": seed})
    torch.cuda.synchronize()
    with torch.cuda.graph(graph):
        recorded = both(code, PAPER | {"seed": seed})
    for value in (5, -7, 2**62 + 1):
        seed.fill_(value)
        graph.replay()
        expected = both(code, PAPER | {"seed": value})
        assert all(torch.equal(a, b) for a, b in zip(recorded, expected, strict=True))


@pytest.mark.parametrize("view", [View(), View((0.05, -0.1), 4)], ids=["whole", "a frond"])
def test_histogram_has_the_distribution_of_the_cpus(view, monkeypatch):
    from fractal_exp.ops.histogram import cuda as cuda_histogram

    monkeypatch.setattr(cuda_histogram, "FEWEST", 1)  # independent points, as the test wants them
    monkeypatch.setattr(cuda_histogram, "MOST_THREADS", 1 << 24)
    check_histogram(view, bins=16, thrown=1_000_000)
    monkeypatch.undo()
    check_histogram(view, bins=8, thrown=20_000)


def small_fit(optimizer, device, **options):
    model = ForwardModel(SVD(), resolution=64, maps=4, trajectories=200, length=60)
    objective = WeightedSum({"mse": 10, "ssim": 1, "regularizer": 0.01},
                            {"mse": MipMSE(), "ssim": DSSIM(), "regularizer": Regularizer()})
    return Chaotic(model, objective, optimizer, device=device, **options)


def small_target():
    raw = SVD().initial(4, torch.Generator().manual_seed(5))
    return ForwardModel(SVD(), resolution=64, maps=4, trajectories=400, length=60)(raw, 0).image.detach()


@pytest.mark.parametrize("build", [lambda **kw: GradientDescent(**kw),
                                   lambda **kw: Alternating(every=20, candidates=3, **kw)])
def test_a_recorded_fit_is_the_plain_one(build):
    told = []
    results = [small_fit(build(cuda_graph=graph), "cuda", iterations=60, starts=2, scouting=10).reconstruct(
        small_target(), on_step=told.append).code for graph in (True, False)]
    losses = torch.tensor([p.scalars["loss"] for p in told]).view(2, 80)
    torch.testing.assert_close(losses[0], losses[1], rtol=1e-3, atol=1e-4)
    assert losses[0, -10:].mean() < losses[0, 20:30].mean()
    assert_close(results[0].linear, results[1].linear, "linear", factor=1e4)


def test_a_recorded_iteration_waits_for_nothing():
    fit = small_fit(GradientDescent(), "cuda")
    problem = FitProblem(fit.model, fit.objective, small_target().cuda())
    fit.optimizer.start({k: v.cuda() for k, v in SVD().initial(4, torch.Generator().manual_seed(0)).items()}, 0)
    for i in range(WARM_UP + 1):
        fit.optimizer.step(problem, i, 1.0)
    assert fit.optimizer._recorded[1].graph is not None
    torch.cuda.set_sync_debug_mode("error")
    try:
        for i in range(50):
            fit.optimizer.step(problem, WARM_UP + 1 + i, 1.0)
    finally:
        torch.cuda.set_sync_debug_mode("default")
