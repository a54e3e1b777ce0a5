"""The CUDA kernels in numba's simulator, whose threads take turns here. `test_cuda` starts these in a process of their
own, since the simulator takes CUDA's place for good."""

import math

import pytest
import torch
from cuda_helpers import check_chaos_game, check_histogram, check_numbers, check_splat, draw, play, scatter
from ops_helpers import check_descent, check_pushforward, random_code, tiling_problem
from turns_simulator import take_turns

from fractal_exp import IFS, View, codes
from fractal_exp.ifs import attractor
from fractal_exp.ops import cuda_launch
from fractal_exp.ops.collage import Descent, pushforward
from fractal_exp.ops.histogram import cuda as cuda_histogram
from fractal_exp.ops.histogram.cpu import COUNTED, CUT, LIT
from fractal_exp.ops.splatting import cuda_kernels as cuda_splat
from fractal_exp.rendering.weighing import address_tree, window_of

pytestmark = pytest.mark.skipif(not cuda_launch.SIMULATED, reason="run by test_cuda, with NUMBA_ENABLE_CUDASIM=1")
if cuda_launch.SIMULATED:
    take_turns()


@pytest.mark.parametrize("batch, maps, game", [
    ((), 1, dict(trajectories=1, length=1, warmup=0, seed=0)),
    ((), 3, dict(trajectories=33, length=9, warmup=8, seed=-5)),
    ((), 10, dict(trajectories=3, length=60, warmup=0, seed=2**63 - 1)),
    ((2, 1), 70, dict(trajectories=40, length=12, warmup=3, seed=1)),  # more maps than a block sums
])
def test_chaos_game_agrees_with_the_twin(batch, maps, game):
    check_chaos_game(batch, maps, game)


@pytest.mark.parametrize("maps, given", [(1, False), (7, True), (300, True)])
def test_chaos_game_draws_exactly_the_twins_numbers(maps, given):
    check_numbers(maps, given, trajectories=34, length=6)


def test_held_points_have_the_twins_gradient():
    code = [9 * random_code(maps=3)[0].detach(), random_code(maps=3)[1].detach()]
    game = dict(trajectories=20, length=14, warmup=4, seed=1)
    ours, twin = (play(*kind, code, game) for kind in (("cuda", torch.float32), ("torch", torch.float32)))
    assert 0.02 < float((twin[0].abs() == 1e6).float().mean()) < 0.9
    for a, b in zip(ours, twin, strict=True):
        assert float((a - b).norm() / b.norm()) < 1e-4


LOST = torch.tensor([[math.inf, 0], [0, -math.inf], [math.nan, 0.1], [-3e38, 3e38], [1e20, 0.0]])


@pytest.mark.parametrize("points, resolution, supersample, sigma_px", [
    pytest.param(scatter(16, spread=1.5), 7, 3, 2.5, id="odd, some beyond the frame"),
    pytest.param(scatter(2, 20), 5, 2, 0.9, id="a batch"),
    pytest.param(scatter(140, spread=0.3), 16, 1, 1.0, id="more points than fit a batch of the kernel's"),
    pytest.param(scatter(9, spread=1.6), 10, 2, 6.0, id="splats wider than a tile", marks=pytest.mark.slow),
    pytest.param(torch.tensor([[0.31, -0.17]]).repeat(20, 1), 3, 5, 2.5, id="all on one spot"),
    pytest.param(scatter(12), 1, 20, 1.5, id="a cell larger than a tile", marks=pytest.mark.slow),
    pytest.param(scatter(30), 12, 1, 0.05, id="splats smaller than a pixel"),
    pytest.param(torch.cat([scatter(6), LOST]), 8, 2, 1.5, id="some infinite or not a number"),
])
def test_splat_agrees_with_the_twin(points, resolution, supersample, sigma_px):
    check_splat(points, resolution, supersample, sigma_px)


@pytest.mark.parametrize(("chunk", "batch"), [pytest.param(3, 2, marks=pytest.mark.slow), (5, 1)])
def test_a_crowd_shared_out_to_many_blocks_gives_the_same_image(chunk, batch, monkeypatch):
    monkeypatch.setattr(cuda_splat, "CHUNK", chunk)
    check_splat(torch.cat([scatter(batch, 2, spread=0.4), scatter(batch, 5)], 1), 11, 2, 1.2)


def test_points_that_are_not_seen_have_no_gradient_and_leave_black():
    image, gradient = draw("cuda", torch.float32, LOST, 4, {"sigma_px": 2.5, "supersample": 2})
    assert (image == 0).all() and (gradient == 0).all()


def test_images_without_gradient_are_drawn_in_shares(monkeypatch):
    grid, points = cuda_splat.grid_of(5, 2, 1.5), scatter(3, 6)
    at_once = cuda_splat.image_of(points, grid)
    monkeypatch.setattr(cuda_splat, "WORKSPACE", 2 * 4 * grid.side**2)
    assert torch.equal(cuda_splat.image_of(points, grid), at_once)


@pytest.mark.parametrize("view", [View(), View((0.05, -0.1), 4)], ids=["whole", "a frond"])
def test_histogram_has_the_distribution_of_the_cpus(view):
    check_histogram(view, bins=8, thrown=4000)


def test_points_under_a_word_do_not_follow_each_other():
    spiral = 0.98 * torch.tensor([[math.cos(0.1), -math.sin(0.1)], [math.sin(0.1), math.cos(0.1)]])
    code = attractor.normalize(IFS(torch.stack([spiral, 0.2 * torch.eye(2)]), torch.tensor([[0.0, 0], [1, 0]])))
    tree, (side, tiles, points) = address_tree(code), (16, 8, 64)
    most = tree.cut(window_of(View(), 8192), 5e7, CUT, whole=True)[:, 7].max()
    assert most < 5e7 / 8, "an orbit's next point comes under another word"
    words = torch.tensor([[side / 2, 0, 0, side / 2, side * (column + 0.5), side * (row + 0.5)]  # each on its own tile
                          for row in range(tiles) for column in range(tiles)], dtype=torch.float64)
    canvas, kept = torch.zeros(side * tiles, side * tiles, dtype=torch.int32), torch.zeros(1, dtype=torch.int64)
    tables = (torch.from_numpy(table) for table in (tree.maps, tree.thresholds.astype("i8"), tree.guide.astype("i4")))
    cuda_launch.launch(cuda_histogram.KERNELS[COUNTED], 1, 64, words, points * torch.arange(1, len(words) + 1), *tables,
                       1, 64, 256, canvas, kept)
    assert int(kept) == int(canvas.sum()) == points * len(words)
    shares = canvas.view(tiles, side, tiles, side).sum((0, 2)) / kept
    independent = float(shares.square().sum()) * points * (points - 1) * len(words)
    assert float((canvas * (canvas - 1)).sum()) < 1.1 * independent  # points that share their pixel


@pytest.mark.parametrize(("singular", "steps"), [(0.5, 256), (0.98, 792), (0.9999, 4096)])
def test_slow_maps_take_longer_to_reach_the_attractor(singular, steps):
    code = IFS(singular * torch.eye(2).expand(2, 2, 2), torch.tensor([[0.0, 0], [1e-4, 0]]))
    assert cuda_histogram.burn_in(address_tree(code)) == steps  # .98 ** 792 = e^-16


@pytest.mark.parametrize(("steps", "most"), [(0, 64), (12, 1)])
def test_threads_take_that_many_steps_before_their_first_point(steps, most):
    tree = address_tree(IFS(torch.eye(2).expand(2, 2, 2) / 2, torch.tensor([[0.0, 0], [1e-4, 0]])))
    canvas, kept = torch.zeros(17, 17, dtype=torch.int32), torch.zeros(1, dtype=torch.int64)
    tables = (torch.from_numpy(table) for table in (tree.maps, tree.thresholds.astype("i8"), tree.guide.astype("i4")))
    words = torch.tensor([[8.0, 0, 0, 8, 8.5, 8.5]], dtype=torch.float64)
    cuda_launch.launch(cuda_histogram.KERNELS[COUNTED], 1, 64, words, torch.tensor([64]), *tables, 1, 1, steps, canvas,
                       kept)
    assert int(kept) == 64 and most // 2 < int((canvas > 0).sum()) <= most


def test_histogram_lights_the_pixels_that_it_counts():
    code = attractor.normalize(codes.known("fern"))
    tree, window = address_tree(code), window_of(View(), (9, 12))
    lit, counted = (cuda_histogram.scatter(tree, window, 2000, seed=(3,), mode=mode, device="cpu")
                    for mode in (LIT, COUNTED))
    assert lit[1] == counted[1] and torch.equal(lit[0] > 0, counted[0] > 0)
    expected = (counted[0] > 0).float().view(3, 3, 4, 3).mean((1, 3))
    torch.testing.assert_close(cuda_histogram.box_mean(lit[0], 3), expected)


def test_histogram_leaves_to_the_cpu_what_has_to_be_searched():
    tree = address_tree(attractor.normalize(codes.known("fern")))
    assert cuda_histogram.scatter(tree, window_of(View((0.05, -0.1), 4), 16), 1e9, seed=(0,), mode=LIT, device="cpu",
                                  wanted=10) is None


@pytest.mark.parametrize("maps", [1, 20])
def test_measures_are_pushed_forward_as_the_twin_does(maps):
    check_pushforward("cuda", maps=maps)


@pytest.mark.parametrize(("maps", "grids", "options"), [
    (3, 3, {"tied": True}), (1, 1, {"smaller": 0.1}), pytest.param(3, 3, {}, marks=pytest.mark.slow),
    pytest.param(9, 2, {"tied": True, "largest": 0.4}, marks=pytest.mark.slow)])
def test_descents_go_as_the_twins_do(maps, grids, options):
    check_descent("cuda", Descent(2, rate=0.02, **options), size=16, maps=maps, grids=grids, samples=130)


def test_a_map_of_nan_leaves_the_canvas_nowhere():
    measure, maps, weights = tiling_problem()
    pushed = pushforward(torch.full_like(maps, torch.nan), weights, measure.samples, 32, backend="cuda")
    torch.testing.assert_close(pushed.sum((1, 2)), torch.ones(4))
