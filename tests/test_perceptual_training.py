"""The training of the network behind the distance `fractal`, and what it is judged by."""

import json
from copy import deepcopy
from dataclasses import replace

import numpy as np
import pytest
import torch
from hydra import compose, initialize_config_module
from scipy.stats import spearmanr

from fractal_exp import InputError, tracking
from fractal_exp.cli import configuration
from fractal_exp.cli import perceptual as app
from fractal_exp.perceptual import distances as perceptual
from fractal_exp.perceptual import fractal_features
from fractal_exp.perceptual_training import held_out, pictures
from fractal_exp.perceptual_training.network import Learner, ranking_loss, unit
from fractal_exp.perceptual_training.perturbations import displacement, orbits_of_one_address, similar
from fractal_exp.perceptual_training.scores import intervals, spearman
from fractal_exp.perceptual_training.training import Recipe, Source, train
from fractal_exp.runtime.checkpoint import Checkpoint

SMALLEST = fractal_features.SMALLEST_PX
TINY = Recipe(steps=3, calibration=2, classes=8, batch=3, copies=2, resolutions=(64,), resolution_chances=(1.0,),
              fits=1, path_chance=0.4, contrastive=0.1, classification=0.1, validate_every=10)


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


def test_batches_depend_on_their_number_alone():
    first, again = Source(TINY), Source(TINY)
    first.batch(0)
    for name in ("truth", "copies", "sizes", "classes"):
        assert torch.equal(getattr(first.batch(3), name), getattr(again.batch(3), name))
    drawn = first.batch(3)
    assert drawn.copies.shape[1:] == (2, 64, 64) and 0 <= float(drawn.copies.min()) <= float(drawn.copies.max()) <= 1


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


class Stop(Exception):
    pass


@pytest.mark.slow
def test_an_interrupted_training_gives_the_same_network(tmp_path):
    whole = train(TINY)
    checkpoint = Checkpoint(tmp_path / "checkpoint.safetensors", 2, {})

    def stop(progress):
        if progress.step == 3:
            raise Stop

    with pytest.raises(Stop):
        train(TINY, on_step=stop, checkpoint=checkpoint)
    resumed = train(TINY, checkpoint=replace(checkpoint, resume=True))
    for one, other in zip(whole.layers.parameters(), resumed.layers.parameters(), strict=True):
        assert torch.equal(one, other)
    assert all(map(torch.equal, whole.channel_weights, resumed.channel_weights))


@pytest.mark.parametrize("change, message", [
    ({"steps": 0}, "steps must be at least 1"), ({"copies": 1}, "copies must be at least 2"),
    ({"resolutions": (16,), "resolution_chances": (1.0,)}, "resolutions must be at least 32"),
    ({"resolutions": (64, 128)}, "every resolution needs a chance"),
    ({"ranking": 0, "contrastive": 0, "classification": 0}, "nothing to learn"),
    ({"ranking": -1}, "ranking must be a finite number"), ({"classes": 0}, "classification needs classes"),
    ({"learning_rate": 0}, "learning_rate must be above 0"), ({"resolution_chances": (0.0,)}, "nor all 0")])
def test_recipes_that_cannot_be_trained(change, message):
    with pytest.raises(InputError, match=message):
        replace(TINY, **change)


def composed(*overrides):
    configuration.register()
    with initialize_config_module("fractal_exp.conf", version_base="1.3"):
        return compose("perceptual", list(overrides))


@pytest.fixture(scope="module")
def trained():
    """What a small training gives, for tests of what is done with it."""
    return train(TINY)


def test_every_size_of_training_composes():
    for choice in ("smoke", "small", "full"):
        assert composed(f"training={choice}").scale == choice


def test_the_command_writes_a_file_that_loads_and_says_how_it_was_made(tmp_path, capsys):
    words = ["training=smoke", f"output={tmp_path}", "tracking=none"]
    path = app.train_distance(composed(*words))
    recipe = fractal_features.load(path).recipe
    assert recipe["steps"] == 6 and "spearman_within_64" in recipe["validation"] and recipe["device"] == "cpu"
    assert json.dumps(recipe)
    assert torch.isfinite(perceptual.load("fractal", path)(*images(2, 64, 64)))
    assert app.train_distance(composed(*words, "resume=true")) == path
    assert "finished" in capsys.readouterr().out
    with pytest.raises(InputError, match="unknown key recipe.colour"):
        app.train_distance(composed(*words, "+recipe.colour=1"))


def test_a_training_is_a_run_with_its_weights_and_scores(tmp_path, monkeypatch):
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    path = app.train_distance(composed("training=smoke", f"output={tmp_path}", "tracking=mlflow"))
    uri = tracking.prepare_store(tmp_path)
    run = tracking.runs_frame(uri, "perceptual").iloc[0]
    assert run["status"] == "FINISHED" and (run["tags.backend"], run["tags.device"]) == ("cpu", "cpu")
    assert run["tags.perceptual"] == "none" and run["metrics.eval/spearman_within_64"] > 0
    assert tracking.read_artifact(uri, run["run_id"], path.name) == path.read_bytes()
    assert len(tracking.read_series(uri, run["run_id"], "train/loss")) == 9


def test_a_training_on_a_gpu_is_a_run_too(trained, tmp_path, monkeypatch):
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.setattr(app, "check_device", lambda device: device)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda _: "a GPU")
    monkeypatch.setattr(app, "train", lambda recipe, device, **_: trained)
    path = app.train_distance(composed("training=smoke", f"output={tmp_path}", "tracking=mlflow", "device=cuda"))
    run = tracking.runs_frame(tracking.prepare_store(tmp_path), "perceptual").iloc[0]
    assert run["status"] == "FINISHED" and run["tags.device_name"] == "a GPU"
    assert (run["tags.backend"], run["tags.device"]) == ("cpu", "cuda"), "the CPU draws the pictures"
    assert fractal_features.load(path).recipe["device"] == "cuda"


def test_a_training_that_is_not_finite_does_not_count_as_finished(trained, tmp_path, monkeypatch):
    def diverge(recipe, **_):
        diverged = deepcopy(trained)
        diverged.channel_weights[2][0] = float("nan")
        return diverged

    words = ["training=smoke", f"output={tmp_path}", "tracking=mlflow"]
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.setattr(app, "train", diverge)
    with pytest.raises(InputError, match="channel_weights.2 has NaN"):
        app.train_distance(composed(*words))
    assert not list(tmp_path.rglob("finished.json"))
    assert tracking.runs_frame(tracking.prepare_store(tmp_path), "perceptual")["status"].tolist() == ["FAILED"]
    monkeypatch.setattr(app, "train", lambda recipe, **_: trained)
    fractal_features.load(app.train_distance(composed(*words, "resume=true")))


def test_training_anew_takes_the_old_weights_away_first(trained, tmp_path, monkeypatch):
    words = ["training=smoke", f"output={tmp_path}", "tracking=none"]
    monkeypatch.setattr(app, "train", lambda recipe, **_: trained)
    path = app.train_distance(composed(*words))
    seen = []

    def stop(*_, **__):
        seen.append(path.exists())
        raise KeyboardInterrupt

    monkeypatch.setattr(app, "train", stop)
    with pytest.raises(KeyboardInterrupt):
        app.train_distance(composed(*words))
    assert seen == [False] and not (path.parent / "finished.json").exists()
    path.touch()  # as after a training that was killed at its very end, which resume=true goes on with
    with pytest.raises(KeyboardInterrupt):
        app.train_distance(composed(*words, "resume=true"))
    assert seen == [False, True]


def test_a_device_that_is_not_there_is_refused_before_any_work(tmp_path):
    with pytest.raises(InputError, match="there is no device 'gpu'"):
        app.train_distance(composed("training=smoke", f"output={tmp_path}", "device=gpu"))
    assert not list(tmp_path.iterdir())
