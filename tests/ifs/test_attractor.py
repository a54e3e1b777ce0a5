import numpy as np
import pytest
import torch

from fractal_exp import IFS, codes
from fractal_exp.ifs.attractor import (
    normalize,
    random_letters,
    random_points,
    visible_box,
)


def rows(*maps) -> IFS:
    return IFS.from_json([list(m) for m in maps])


DRAGON = rows([0.5, -0.5, 0.5, 0.5, 0, 0], [-0.5, -0.5, 0.5, -0.5, 1, 0])


def random_code(seed: int, largest: float) -> IFS:
    random = np.random.default_rng(seed)
    count = random.integers(2, 8)
    u, _, v = np.linalg.svd(random.normal(size=(count, 2, 2)))
    singular = np.sort(random.uniform(0.05, largest, (count, 2)))[:, ::-1]
    return IFS((u * singular[:, None, :]) @ v, random.uniform(-1, 1, (count, 2)))


def sample(code: IFS, count: int = 50_000) -> np.ndarray:
    """Attractor points, from a fixed point on, in float64."""
    random = np.random.default_rng(0)
    linear, offset = code.linear.double().numpy(), code.offset.double().numpy()
    x = np.tile(np.linalg.solve(np.eye(2) - linear[0], offset[0]), (count, 1))
    for _ in range(30):
        i = random.integers(0, len(code), count)
        x = np.einsum("kij,kj->ki", linear[i], x) + offset[i]
    return x


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 5))])
def test_the_visible_box_is_that_of_a_million_points(seed):
    code = random_code(seed, 0.6)
    points, box = sample(code, 1_000_000), visible_box(code)
    np.testing.assert_allclose(np.r_[points.min(0), points.max(0)], box, atol=0.02 * (box[2:] - box[:2]).max())


def test_normalize_centres_and_scales_the_visible_box():
    code = normalize(DRAGON)
    x0, y0, x1, y1 = visible_box(code)
    assert x1 - x0 == pytest.approx(1.5, abs=2e-3) and (x0 + x1) / 2 == pytest.approx(0, abs=1e-3)
    assert y1 - y0 == pytest.approx(1.0, abs=2e-3) and (y0 + y1) / 2 == pytest.approx(0, abs=1e-3)


def box_of_all_words(code: IFS, least: float = 1e-6) -> np.ndarray:
    """`visible_box` by its definition, without a bound on anything."""
    linear, offset = code.linear.double().numpy(), code.offset.double().numpy()
    chance = code.sampling_probabilities().double().numpy()
    mean = np.linalg.solve(np.eye(2) - np.einsum("n,nij->ij", chance, linear), chance @ offset)
    points, chances, low, high = mean[None], np.ones(1), mean, mean
    while len(points):
        low, high = np.minimum(low, points.min(0)), np.maximum(high, points.max(0))
        points = (np.einsum("nij,kj->kni", linear, points) + offset).reshape(-1, 2)
        chances = (chances[:, None] * chance).reshape(-1)
        points, chances = points[chances >= least], chances[chances >= least]
    return np.r_[low, high]


@pytest.mark.parametrize("slack", [6e-8, 1e-6, 1e-5])
@pytest.mark.parametrize("seed", range(4))
def test_the_visible_box_is_right_for_maps_that_hardly_contract(slack, seed):
    """The fixed point of the first map lies up to a million times farther away than anything that is seen."""
    random = np.random.default_rng(seed)
    u, _, v = np.linalg.svd(random.normal(size=(4, 2, 2)))
    linear, offset = (u * random.uniform(0.2, 0.6, (4, 2, 1))) @ v, random.uniform(-1, 1, (4, 2))
    linear[0], offset[0] = np.diag([1 - slack, random.uniform(0.1, 0.9)]), 0.3 * offset[0]
    code = IFS(linear, offset, np.full(4, 0.25))
    expected = box_of_all_words(code)
    np.testing.assert_allclose(visible_box(code), expected, atol=1e-6 * (expected[2:] - expected[:2]).max())


def test_the_visible_box_ends_where_the_last_likely_word_sends_the_mean():
    """x/2 with probability 0.998 and x/2 + 1/2 with 0.002: two steps to the right have the chance 4e-6, three 8e-9."""
    p = 0.002
    code = IFS(torch.eye(2).expand(2, 2, 2) / 2, torch.tensor([[0.0, 0], [0.5, 0]]), torch.tensor([1 - p, p]))
    np.testing.assert_allclose(visible_box(code)[2], 0.75 + p / 4, atol=1e-6)  # p is the mean of the measure


def test_points_are_those_of_numpys_random_letters_step_by_step():
    code = codes.known("fern")
    chances, (linear, offset) = code.sampling_probabilities().double().numpy(), (
        value.double().numpy() for value in (code.linear, code.offset))
    letters = random_letters(code, 3000, seed=4)
    expected = np.random.Generator(np.random.PCG64(4)).choice(len(code), letters.shape, p=chances / chances.sum())
    assert np.array_equal(letters, expected)
    points, maps = random_points(code, 3000, seed=4)
    assert np.array_equal(maps, expected[-3:].ravel())
    chosen = maps[1000:2000]  # of the second step of a thousand games
    moved = np.einsum("kij,kj->ki", linear[chosen], points[:1000]) + offset[chosen]
    assert np.allclose(moved, points[1000:2000], atol=1e-12)
