"""The sampler of a window against the chaos game with rejection, which specifies it."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy import stats

from fractal_exp import IFS, Colours, View, codes, ops, render
from fractal_exp.ifs import attractor
from fractal_exp.ops import histogram
from fractal_exp.ops.histogram import cpu as cpu_histogram
from fractal_exp.ops.histogram.boxes import lit_share
from fractal_exp.rendering.still import render_with_info
from fractal_exp.rendering.weighing import address_tree, window_of
from fractal_exp.suite import random_suite

BINS = 16
THROWN = 2_000_000
WINDOWS = [  # the fern's frond, a dragon's boundary, codes whose maps overlap, one with a map of singular value .99992
    ("fern", codes.known("fern"), View((0.05, -0.1), 4)),
    ("fern, deeper", codes.known("fern"), View((0.08, -0.13), 16)),
    ("dragon", codes.known("heighway_dragon"), View((0.2, 0.1), 8)),
    ("suite 1", random_suite(2)[1], View((0.1, 0.0), 8)),
    ("suite 9", random_suite(10)[9], View((-0.1, 0.1), 12)),
    ("suite 3", random_suite(4)[3], View((0.0, 0.0), 4)),
]
EACH_WINDOW = pytest.mark.parametrize(("code", "view"), [
    pytest.param(*case, id=name, marks=[] if name in ("fern", "suite 3") else pytest.mark.slow)
    for name, *case in WINDOWS])


def sampled(code: IFS, view: View, thrown: float, seeds: range = range(1), size: int | tuple[int, int] = BINS
            ) -> np.ndarray:
    """Counts (BINS²,), or of the pixels of a `size`, of points in the window, `thrown` at the attractor in all."""
    window, tree = window_of(view, size), address_tree(code)
    canvas = histogram.planes(window.height, window.width, cpu_histogram.COUNTED)
    for seed in seeds:
        tree.scatter(window, thrown / len(seeds), seed=(seed,), canvas=canvas, mode=cpu_histogram.COUNTED)
    return canvas.sum(0).ravel()


def rejected(code: IFS, view: View, batches: int = 8, batch: int = 250_000) -> np.ndarray:
    """The same by rejection: the last points of independent chaos games, those outside the window thrown away."""
    counts, (x0, y0, x1, y1) = np.zeros(BINS**2), view.box
    for seed in range(batches):
        points = ops.chaos_game(code.linear, code.offset, trajectories=batch, length=200, warmup=199,
                                probabilities=code.sampling_probabilities(), seed=seed).numpy()
        counts += np.histogram2d(y1 - points[:, 1], points[:, 0], BINS, [[0, y1 - y0], [x0, x1]])[0].ravel()
    return counts


def p_value(a: np.ndarray, b: np.ndarray) -> float:
    """Of the hypothesis that two histograms are of one distribution; bins of few counts are pooled."""
    few = a + b < 20
    table = np.array([[*a[~few], a[few].sum()], [*b[~few], b[few].sum()]])
    return stats.chi2_contingency(table[:, table.sum(0) > 0]).pvalue


@EACH_WINDOW
@pytest.mark.parametrize("tall", [False, True], ids=["wide", "tall"])
def test_a_window_that_is_not_square_holds_the_points_of_a_square_about_it(code, view, tall):
    code, thin = attractor.normalize(code), BINS // 4
    square = sampled(code, view, 2e6, range(0, 50)).reshape(BINS, BINS)
    part = slice((BINS - thin) // 2, (BINS + thin) // 2)
    square = square[:, part] if tall else square[part]
    alone = sampled(code, View(view.center, view.zoom * BINS / thin), 2e6, range(50, 100), square.shape)
    assert square.sum() > 1000 and p_value(square.ravel(), alone) > 1e-3


@EACH_WINDOW
def test_the_same_distribution_as_rejection(code, view):
    code = attractor.normalize(code)
    twin = rejected(code, view)
    # Points of one seed share a few orbits; many seeds with few points each are independent, as the test wants them.
    ours = sampled(code, view, THROWN, range(64))
    assert twin.sum() > 2000
    assert abs(ours.sum() - twin.sum()) < 4 * np.sqrt(ours.sum() + twin.sum())  # how many lie in the window,
    assert p_value(ours, twin) > 1e-3                                           # and where
    at_once = sampled(code, view, 10 * THROWN)
    assert abs(at_once.sum() - 10 * twin.sum()) < 40 * np.sqrt(1.1 * twin.sum())
    assert np.abs(at_once - 10 * twin).sum() < 0.1 * at_once.sum() + 10 * np.sqrt(twin).sum()


@pytest.mark.parametrize("name", ["fern", "sierpinski_triangle"])
def test_points_under_several_words_draw_as_well_as_independent_ones(name):
    """Where a word gets a point twice, less is lit."""
    code = attractor.normalize(codes.known(name))
    alone, reused = (torch.stack([render_with_info(code, resolution=64, supersample=16, points_in_view=200_000,
                                                   seed=seed, reuse=reuse)[0] for seed in range(24)])
                     for reuse in (1, 8))
    assert float(reused.mean()) == pytest.approx(float(alone.mean()), rel=0.005)
    lit = alone.mean(0) > 0.05
    assert float(((reused.mean(0) - alone.mean(0))[lit] ** 2).mean()) < 1.4 * 2 / 24 * float(alone.var(0)[lit].mean())
    assert float(reused.var(0)[lit].mean()) == pytest.approx(float(alone.var(0)[lit].mean()), rel=0.15)


@pytest.mark.parametrize("reuse", [1, 8])
@pytest.mark.parametrize("chances", [[1.0], [0.999, 0.001]])
def test_words_under_a_map_that_has_nearly_all_the_chance_are_not_split_for_ever(chances, reuse):
    linear = torch.eye(2) * torch.tensor([0.9, 0.5])[:, None, None]
    offset = torch.tensor([[0.0, 0.0], [0.4, 0.0]])
    code = IFS(linear[:len(chances)], offset[:len(chances)], torch.tensor(chances))
    tree = address_tree(code, reuse)
    tally = tree.scatter(window_of(View(), 64), 20_000, seed=(0,), canvas=histogram.planes(64, 64, cpu_histogram.LIT),
                         mode=cpu_histogram.LIT)
    assert tally.visited < 1_000_000
    assert tally.kept == tally.thrown == pytest.approx(20_000, rel=0.05)


def test_counts_are_poisson_from_seed_to_seed():
    code, view = attractor.normalize(codes.known("fern")), View((0.05, -0.1), 4)
    counts = np.array([sampled(code, view, 20_000, range(seed, seed + 1)) for seed in range(200)], float)
    busy = counts.mean(0) > 1
    dispersion = counts[:, busy].var(0, ddof=1) / counts[:, busy].mean(0)
    assert dispersion.mean() == pytest.approx(1, abs=0.05)
    total = counts.sum(1)
    assert 0.7 < total.var(ddof=1) / total.mean() < 1.4


@pytest.mark.parametrize("mean", [0.3, 5.0, 11.9, 12.1, 40.0, 3000.0, 1e9])
def test_poisson_variates(mean):
    state, draws = np.uint64(12345), []
    for _ in range(4000):
        state, count = cpu_histogram.poisson(mean, np.uint64(state))
        draws.append(count)
    draws = np.array(draws, float)
    assert draws.mean() == pytest.approx(mean, abs=4.5 * np.sqrt(mean / 4000))
    assert draws.var(ddof=1) == pytest.approx(mean, rel=0.13)
    if mean < 100:
        edges = np.unique(stats.poisson.ppf(np.linspace(0, 1, 12)[1:-1], mean))
        observed = np.histogram(draws, [-1, *edges, np.inf])[0]
        # A bin holds the counts from its left edge to just under its right one.
        below = stats.poisson.cdf(edges - 1, mean)
        expected = np.diff([0, *below, 1]) * len(draws)
        keep = expected > 5
        statistic = ((observed - expected)[keep] ** 2 / expected[keep]).sum()
        assert stats.chi2.sf(statistic, keep.sum()) > 1e-4


def chaos_game_with_colours(code: IFS, seed: int, games: int = 50_000, kept: int = 20) -> tuple[np.ndarray, np.ndarray]:
    """Points (P,2) of many chaos games and their colours (P,3), step by step as defined."""
    random = np.random.default_rng(seed)
    points, shades, found = np.zeros((games, 2)), np.full((games, 3), 0.5), []
    linear, offset = code.linear.double().numpy(), code.offset.double().numpy()
    rgb, blends = code.colours.rgb.double().numpy(), code.colours.blends.double().numpy()
    cumulative = np.cumsum(code.sampling_probabilities().double().numpy())
    for step in range(100 + kept):
        i = np.searchsorted(cumulative[:-1], random.random(games), side="right")
        points = (linear[i] @ points[..., None])[..., 0] + offset[i]
        shades = (1 - blends[i, None]) * shades + blends[i, None] * rgb[i]
        if step >= 100:
            found.append((points, shades))
    places, colours = zip(*found, strict=True)
    return np.concatenate(places), np.concatenate(colours)


@pytest.mark.parametrize("view", [View(), View((0.05, -0.1), 4), View((0.3, 0.35), 16)], ids=["whole", "4", "16"])
def test_colours_are_those_of_the_chaos_game(view):
    random = np.random.default_rng(2)
    fern = attractor.normalize(codes.known("fern"))
    code = replace(fern, colours=Colours(random.random((4, 3)), [0.9, 0.06, 0.4, 0.55]))
    image = render(code, view, resolution=BINS, points_in_view=400_000, supersample=1, mode="colour", seed=5)
    points, shades = chaos_game_with_colours(code, 0)
    x0, y0, x1, y1 = view.box
    column, row = (points[:, 0] - x0) / (x1 - x0) * BINS, (y1 - points[:, 1]) / (y1 - y0) * BINS
    inside = (column >= 0) & (column < BINS) & (row >= 0) & (row < BINS)
    pixel = row[inside].astype(int) * BINS + column[inside].astype(int)
    counts = np.bincount(pixel, minlength=BINS**2)
    enough = counts >= 200
    assert enough.sum() > 5
    for channel in range(3):
        mean = np.bincount(pixel, shades[inside, channel], BINS**2)[enough] / counts[enough]
        ours = image[..., channel].numpy().ravel()[enough]
        assert np.abs(ours - mean).max() < 0.02, channel


def test_colours_change_no_point():
    code = replace(attractor.normalize(codes.known("fern")), colours=Colours(np.eye(4, 3), [1, 0.2, 0.3, 0.4]))
    for view in (View(), View((0.05, -0.1), 16)):
        plain = render(code, view, resolution=96, points_in_view=50_000, supersample=4, seed=3)
        image = render(code, view, resolution=96, points_in_view=50_000, supersample=4, seed=3, mode="colour")
        assert torch.equal(image[..., 3], plain)
        assert bool((image[..., :3].sum(-1)[plain > 0] > 0).all()) and not bool(image[plain == 0].any())


@pytest.mark.parametrize("factor", [1, 3, 4, 8, 16, 24, 32, 64])
def test_the_lit_share_of_a_pixel_is_that_of_its_parts(factor):
    rows, columns = 5 * factor, 7 * factor
    parts = np.random.default_rng(factor).random((2, rows, columns)) < np.linspace(0, 1, columns)
    planes = np.zeros((2, rows, 64 * (columns // 64 + 2)), np.uint8)
    planes[..., :columns] = parts
    bits = np.packbits(planes, axis=-1, bitorder="little").view(np.uint64)
    share = np.empty((5, 7), np.float32)
    lit_share(bits, factor, share)
    expected = parts.any(0).reshape(5, factor, 7, factor).mean((1, 3))
    assert np.allclose(share, expected, atol=1e-6)
