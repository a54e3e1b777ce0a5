"""The training of the network behind the distance `fractal`, and what it is judged by."""

import numpy as np
import pytest
import torch
from networks_helpers import resumed
from scipy.stats import spearmanr

from benchmarks.perceptual_training import __main__ as app
from benchmarks.perceptual_training import held_out, pictures
from benchmarks.perceptual_training.network import Learner, ranking_loss, unit
from benchmarks.perceptual_training.perturbations import displacement, orbits_of_one_address
from benchmarks.perceptual_training.scores import intervals, spearman
from benchmarks.perceptual_training.training import PerceptualTraining
from fractal_exp import InputError
from fractal_exp.perceptual import distances as perceptual
from fractal_exp.perceptual import fractal_features
from fractal_exp.training.codes import similar
from fractal_exp.training.loop import train

SMALLEST = fractal_features.SMALLEST_PX
TINY = {"steps": 3, "calibration": 2, "classes": 8, "batch": 3, "copies": 2, "resolutions": [64],
        "resolution_chances": [1.0], "fits": 1, "path_chance": 0.4, "contrastive": 0.1, "classification": 0.1,
        "held_out": 4}


def images(*shape, seed=0, dtype=torch.float32):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed), dtype=dtype)


def test_folding_leaves_the_features_as_they_were():
    learner = Learner(0, torch.Generator().manual_seed(0))
    learner.features(images(4, 64, 64))  # moves the statistics
    learner.eval()
    layers, weights = learner.export(2.0)
    found = perceptual.PerceptualDistance("x", layers, fractal_features.TAPS, weights, SMALLEST)
    a, b = images(2, 64, 64, seed=5)
    levels = unit(learner.features(torch.stack([a, b])))
    expected = learner.distances([x[:1, None] for x in levels], [x[1:] for x in levels])
    torch.testing.assert_close(found(a, b), 2 * expected[0, 0].detach(), rtol=1e-4, atol=1e-6)


def test_a_learner_draws_from_its_own_generator_alone():
    before = torch.get_rng_state()
    learners = [Learner(8, torch.Generator().manual_seed(3)) for _ in range(2)]
    learners[0].export(1.0)
    assert torch.equal(torch.get_rng_state(), before)
    states = [learner.state_dict() for learner in learners]
    assert all(map(torch.equal, states[0].values(), states[1].values()))
    drawn = torch.randn(8, 1, 5, 5, generator=torch.Generator().manual_seed(3)) * (2 / 25) ** 0.5
    assert torch.equal(states[0]["convolutions.0.weight"], drawn) and not states[0]["classifier.bias"].any()


def test_the_distances_of_a_learner_teach_its_channel_weights():
    learner = Learner(0, torch.Generator().manual_seed(0))
    levels = unit(learner.features(images(3, 64, 64)))
    away = learner.distances([x[None, :2] for x in levels], [x[2:] for x in levels])
    expected = sum(((x[:2] - x[2:]).square().mean((-2, -1)) * w).sum(1)
                   for x, w in zip(levels, learner.weights(), strict=True))
    torch.testing.assert_close(away[0], expected)
    raw = tuple(learner.raw_weights)
    for one, other in zip(torch.autograd.grad(away.sum(), raw, retain_graph=True),
                          torch.autograd.grad(expected.sum(), raw), strict=True):
        torch.testing.assert_close(one, other)
        assert one.any()


def test_the_displacement_of_a_shift_and_of_a_growth_is_known():
    code = pictures.random_code(5)
    shifted, grown = similar(code, 1.0, np.array([0.3, -0.4])), similar(code, 1.1, np.zeros(2))
    points = orbits_of_one_address(code, [shifted, grown], 7)
    assert displacement(points[0], points[1]) == pytest.approx(0.5, abs=1e-4)
    assert displacement(points[0], points[2]) == pytest.approx(0.1 * np.sqrt(np.square(points[0]).sum(-1).mean()),
                                                               rel=1e-3)
    assert np.abs(points[0]).max() == pytest.approx(0.75, abs=0.05)


def test_ranking_prefers_distances_in_the_order_of_the_displacements():
    sizes = torch.tensor([[0.5, 2.0, 8.0]])
    right, wrong = (ranking_loss(torch.tensor([d]), sizes, 0.1, 100) for d in ([.1, .2, .3], [.3, .2, .1]))
    assert float(right) < float(wrong)
    assert float(ranking_loss(torch.tensor([[.3, .2]]), torch.tensor([[0.5, 2.0]]), 5, 100)) == 0  # both unseen


def test_spearman_is_scipys():
    a, b = np.random.default_rng(0).random((2, 4, 9))
    a[0, 0] = a[0, 1]
    within, pooled = spearman(a, b)
    assert pooled == pytest.approx(spearmanr(a.ravel(), b.ravel())[0])
    assert within[0] == pytest.approx(spearmanr(a[0], b[0])[0])
    mean, low, high = intervals(a, b, draws=50)["within"]
    assert low <= mean <= high


def test_held_out_copies_have_the_stated_sizes():
    (truth,) = held_out.truths(1, 5)
    assert all(held_out.SMALLEST <= copy.size <= held_out.LARGEST for copy in truth.moved)
    assert [len(copy.code) for copy in truth.without] == [len(truth.code) - 1] * len(truth.code)


def test_only_channel_weights_learn_in_the_calibration():
    training = PerceptualTraining(**TINY)
    network = training.network()
    training.loss(network, training.batch(3)).backward()
    assert {name for name, value in network.named_parameters() if value.grad is not None and value.grad.any()} == {
        f"raw_weights.{level}" for level in range(len(fractal_features.CHANNELS))}


def test_an_interrupted_training_gives_the_same_network(tmp_path):
    whole = train(PerceptualTraining(**TINY))
    again, steps = resumed(lambda: PerceptualTraining(**TINY), tmp_path / "checkpoint", 3)
    assert steps[0] == 3 and whole.scores == again.scores
    assert all(torch.equal(whole.tensors[key], again.tensors[key]) for key in whole.tensors)


@pytest.mark.parametrize("change, message", [
    ({"steps": 0}, "steps must be at least 1"), ({"copies": 1}, "copies must be at least 2"),
    ({"resolutions": [16]}, "resolutions.0 must be at least 32"),
    ({"resolutions": [64, 128]}, "every resolution needs a chance"),
    ({"ranking": 0.0, "contrastive": 0.0, "classification": 0.0}, "nothing to learn"),
    ({"ranking": -1.0}, "ranking must be at least 0"), ({"classes": 0}, "classification needs classes"),
    ({"rate": 0.0}, "rate must be above 0"), ({"resolution_chances": [0.0]}, "must be above 0")])
def test_recipes_that_cannot_be_trained(change, message):
    with pytest.raises(InputError, match=message):
        PerceptualTraining(**(TINY | change))


def test_the_script_writes_a_file_that_loads_and_says_how_it_was_made(tmp_path):
    words = [f"{key}={str(value).lower()}" for key, value in TINY.items()]
    path = app.main([str(tmp_path / "mine.safetensors"), *words, "--threads", "1"])
    recipe = fractal_features.load(path).recipe
    assert recipe["steps"] == 3 and recipe["device"] == "cpu" and "spearman_within_64" in recipe["validation"]
    a, b = images(2, 64, 64)
    assert torch.isfinite(perceptual.load("fractal", path)(a, b))
    assert [each.name for each in tmp_path.iterdir()] == ["mine.safetensors"]
