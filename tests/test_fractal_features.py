"""The distance `fractal`: the file in the package, its bad twins, and the training that writes such files."""

import hashlib
import json
import shutil
import subprocess
import sys
from dataclasses import replace
from importlib import resources

import numpy as np
import pytest
import torch
from hydra import compose, initialize_config_module
from safetensors.torch import load_file, save_file
from scipy.stats import spearmanr

from fractal_exp import InputError, fractal_features, perceptual, perceptual_distance, tracking
from fractal_exp.apps import perceptual as app
from fractal_exp.checkpoint import Checkpoint
from fractal_exp.codes import known
from fractal_exp.evaluation import evaluate, summarize
from fractal_exp.evaluation.scoring import Perceptual as Measured
from fractal_exp.losses import Perceptual
from fractal_exp.perceptual_training import held_out, pictures
from fractal_exp.perceptual_training.network import Learner, ranking_loss, unit
from fractal_exp.perceptual_training.perturbations import displacement, orbits_of_one_address, similar
from fractal_exp.perceptual_training.scores import intervals, spearman
from fractal_exp.perceptual_training.training import Recipe, Source, train
from fractal_exp.rendering import Rendering

SMALLEST = fractal_features.SMALLEST_PX
TINY = Recipe(steps=3, calibration=2, classes=8, batch=3, copies=2, resolutions=(64,), resolution_chances=(1.0,),
              fits=1, path_chance=0.4, contrastive=0.1, classification=0.1, validate_every=10)


def images(*shape, seed=0, dtype=torch.float32):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed), dtype=dtype)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    """A whole weight file of another network than the shipped one."""
    learner = Learner(0, torch.Generator().manual_seed(1))
    return fractal_features.save(tmp_path_factory.mktemp("weights") / "mine.safetensors", *learner.export(1.0),
                                 {"steps": 0})


def altered(file, path, notes=None, **changes):
    """A copy of a weight file with some tensors or its notes changed."""
    tensors = load_file(file)
    for name, change in changes.items():
        name = name.replace("__", ".")
        tensors[name] = change(tensors[name])
    kept = {"format": fractal_features.FORMAT, "version": str(fractal_features.VERSION), "recipe": "{}"}
    save_file(tensors, path, metadata=kept | (notes or {}))
    return path


# --- values ---------------------------------------------------------------------------------------------------------

def test_equal_images_are_at_distance_zero_and_others_are_not():
    a, b = images(2, 64, 64)
    assert float(perceptual_distance(a, a)) == 0
    assert float(perceptual_distance(a, b)) > 1e-3


def test_it_is_lpips_construction_on_the_levels_of_the_network(file):
    found, (a, b) = fractal_features.load(file), images(2, 70, 70)
    expected, x, y = 0.0, a[None, None], b[None, None]
    for count, layer in enumerate(found.layers, 1):
        x, y = layer(x), layer(y)
        if count in fractal_features.TAPS:
            level = found.channel_weights[fractal_features.TAPS.index(count)]
            apart = (torch.nn.functional.normalize(x) - torch.nn.functional.normalize(y)).square()
            expected += float((apart * level[None, :, None, None]).sum(1).mean().detach())
    assert float(perceptual.load("fractal", file)(a, b)) == pytest.approx(expected, rel=1e-4)
    assert len(fractal_features.TAPS) >= 4


def test_batches_of_any_shape_are_their_single_pairs():
    a, b = images(2, 3, 48, 48), images(3, 48, 48, seed=1)
    together = perceptual_distance(a, b)
    assert together.shape == (2, 3)
    each = torch.stack([torch.stack([perceptual_distance(x, y) for x, y in zip(row, b, strict=True)]) for row in a])
    torch.testing.assert_close(together, each)


@pytest.mark.parametrize("which", [0, 1])
def test_gradients_agree_with_finite_differences(file, which):
    pair, direction = list(images(2, SMALLEST, SMALLEST, dtype=torch.float64)), images(SMALLEST, SMALLEST, seed=3)
    distance, step = perceptual.load("fractal", file).double(), 1e-6
    pair[which].requires_grad_()
    (gradient,) = torch.autograd.grad(distance(*pair), pair[which])
    with torch.no_grad():
        ends = [distance(*(x + sign * step * direction * (k == which) for k, x in enumerate(pair))) for sign in (1, -1)]
    assert float((gradient * direction).sum()) == pytest.approx(float(ends[0] - ends[1]) / (2 * step), rel=1e-5)


def test_a_batch_against_one_image_sums_its_gradient(file):
    distance = perceptual.load("fractal", file).double()
    a, b = images(3, 40, 40, dtype=torch.float64), images(40, 40, seed=1, dtype=torch.float64).requires_grad_()
    (together,) = torch.autograd.grad(distance(a, b).sum(), b)
    each = sum(torch.autograd.grad(distance(one, b), b)[0] for one in a)
    torch.testing.assert_close(together, each)


def test_the_term_keeps_the_features_of_its_target(monkeypatch):
    a, b = images(2, 64, 64)
    term = Perceptual("fractal").prepare(b)
    calls, features = [], term.distance.features
    monkeypatch.setattr(term.distance, "features", lambda image: calls.append(1) or features(image))
    rendering = Rendering(a, torch.zeros(1, 2), torch.zeros(1, 2), torch.zeros(1, 2))
    torch.testing.assert_close(term(rendering), perceptual_distance(a, b))
    assert len(calls) == 1 and term.name == "fractal"


def test_it_has_a_column_of_its_own():
    assert Measured.load("fractal").column == "fractal_distance"
    code = known("fern")
    summary = summarize(evaluate(code, code, resolution=64, points_in_view=50_000, perceptual="fractal"))
    lines = summary[summary.zoom_class == "all"].set_index("metric")
    assert lines.loc["fractal_distance", "mean"] < 0.1 and set(lines.fractals) == {1} and set(lines["views"]) == {7}
    assert np.isnan(lines.loc["lpips", "mean"])


def test_importing_the_package_does_not_import_the_network():
    code = "import sys, fractal_exp; print('fractal_exp.perceptual' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "False"


# --- bad input ------------------------------------------------------------------------------------------------------

def test_the_smallest_image_is_one_pixel_of_the_fifth_level():
    perceptual_distance(*images(2, SMALLEST, SMALLEST))
    with pytest.raises(InputError, match=f"fractal needs images of at least {SMALLEST} px.*perceptual=none"):
        perceptual_distance(*images(2, SMALLEST, SMALLEST - 1))


def test_pictures_whose_inner_part_is_too_small_are_not_drawn(monkeypatch):
    monkeypatch.setattr("fractal_exp.evaluation.scoring._draw", lambda *_: pytest.fail("drew"))
    with pytest.raises(InputError, match="inner 31 px of 41; raise resolution to 42.*perceptual=none"):
        evaluate(known("fern"), known("fern"), resolution=41, perceptual="fractal")
    Measured.load("fractal").check(42)
    Measured.load("none").check(1)


@pytest.mark.parametrize("value, message", [(float("nan"), "a holds NaN"), (2.0, r"a must lie in \[0,1\]")])
def test_images_that_are_none(value, message):
    a, b = images(2, 40, 40)
    a[3, 3] = value
    with pytest.raises(InputError, match=message):
        perceptual_distance(a, b)


def test_images_that_do_not_go_together():
    a = images(40, 40)
    with pytest.raises(InputError, match="agree in size, device and dtype"):
        perceptual_distance(a, images(41, 41))
    with pytest.raises(InputError, match="agree in size, device and dtype"):
        perceptual_distance(a, a.double())
    with pytest.raises(InputError, match="tensor of floats"):
        perceptual_distance(a.numpy(), a)
    with pytest.raises(InputError, match=r"batches of a and b must broadcast, got \(2, 40, 40\) and \(3, 40, 40\)"):
        perceptual_distance(images(2, 40, 40), images(3, 40, 40))


@pytest.mark.parametrize("shape", [(0, 40, 40), (2, 0, 3, 40, 40), (40, 0)])
def test_no_images(shape):
    full = images(40, 40)
    for pair, name in (((torch.zeros(shape), full), "a"), ((full, torch.zeros(shape)), "b")):
        with pytest.raises(InputError, match=f"{name} must hold at least one image"):
            perceptual_distance(*pair)


def test_the_range_of_the_paper_is_a_choice_of_lpips():
    with pytest.raises(InputError, match="a choice of LPIPS alone"):
        perceptual.load("fractal", input_range="released")


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(InputError, match="cannot read the weight file .*no.safetensors"):
        perceptual.load("fractal", tmp_path / "no.safetensors")


def test_a_damaged_file(file, tmp_path):
    broken = tmp_path / "broken.safetensors"
    for data in (file.read_bytes()[:-100], b"", b"not a weight file"):
        broken.write_bytes(data)
        with pytest.raises(InputError, match="cannot be read as safetensors"):
            perceptual.load("fractal", broken)
    for recipe, message in (('{"steps": 9', "its recipe is no JSON"), ("[9]", "must be a JSON object, got list")):
        with pytest.raises(InputError, match=f"broken.safetensors is damaged: .*{message}.*fractal-perceptual"):
            perceptual.load("fractal", altered(file, broken, {"recipe": recipe}))


@pytest.mark.parametrize("notes, got", [({"version": "2"}, "version '2'"), ({"format": "other"}, "got 'other'")])
def test_a_file_of_another_format_or_version(file, tmp_path, notes, got):
    with pytest.raises(InputError, match=got):
        perceptual.load("fractal", altered(file, tmp_path / "x.safetensors", notes))


@pytest.mark.parametrize("name, change, message", [
    ("layers__2__weight", lambda x: x[:, :4].contiguous(), "layers.2.weight has shape"),
    ("layers__0__bias", lambda x: x * float("nan"), "layers.0.bias has NaN"),
    ("channel_weights__1", lambda x: -x, "channel_weights.1 must not be negative")])
def test_a_file_of_another_network(file, tmp_path, name, change, message):
    with pytest.raises(InputError, match=message):
        perceptual.load("fractal", altered(file, tmp_path / "x.safetensors", **{name: change}))


def test_a_file_that_lacks_a_tensor(file, tmp_path):
    tensors = load_file(file)
    del tensors["layers.4.bias"]
    save_file(tensors, tmp_path / "x.safetensors",
              metadata={"format": fractal_features.FORMAT, "version": str(fractal_features.VERSION)})
    with pytest.raises(InputError, match="layers.4.bias is missing"):
        perceptual.load("fractal", tmp_path / "x.safetensors")


def test_the_file_in_the_package_is_small_and_whole():
    data = (resources.files("fractal_exp") / "data" / fractal_features.SHIPPED).read_bytes()
    assert len(data) <= 4e6 and hashlib.sha256(data).hexdigest() == fractal_features.SHIPPED_SHA256
    assert fractal_features.load().recipe["steps"] > 0


def test_a_damaged_or_missing_file_in_the_package(monkeypatch, tmp_path):
    (tmp_path / "data").mkdir()
    shipped = resources.files("fractal_exp") / "data" / fractal_features.SHIPPED
    monkeypatch.setattr(fractal_features.resources, "files", lambda _: tmp_path)
    with pytest.raises(InputError, match="lacks its weight file.*perceptual_weights=PATH"):
        perceptual.load("fractal")
    copy = tmp_path / "data" / fractal_features.SHIPPED
    shutil.copy(shipped, copy)
    perceptual.load("fractal")
    copy.write_bytes(copy.read_bytes()[:-1] + b"x")
    with pytest.raises(InputError, match="is damaged: its SHA-256"):
        perceptual.load("fractal")


# --- training -------------------------------------------------------------------------------------------------------

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
    app.register()
    with initialize_config_module("fractal_exp.conf", version_base="1.3"):
        return compose("perceptual", list(overrides))


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


def test_a_training_on_a_gpu_is_a_run_too(tmp_path, monkeypatch):
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.setattr(app, "check_device", lambda device: device)
    monkeypatch.setattr(torch.cuda, "get_device_name", lambda _: "a GPU")
    monkeypatch.setattr(app, "train", lambda recipe, device, **_: train(recipe))
    path = app.train_distance(composed("training=smoke", f"output={tmp_path}", "tracking=mlflow", "device=cuda"))
    run = tracking.runs_frame(tracking.prepare_store(tmp_path), "perceptual").iloc[0]
    assert run["status"] == "FINISHED" and run["tags.device_name"] == "a GPU"
    assert (run["tags.backend"], run["tags.device"]) == ("cpu", "cuda"), "the CPU draws the pictures"
    assert fractal_features.load(path).recipe["device"] == "cuda"


def test_a_training_that_is_not_finite_does_not_count_as_finished(tmp_path, monkeypatch):
    def diverge(recipe, **_):
        trained = train(recipe)
        trained.channel_weights[2][0] = float("nan")
        return trained

    words = ["training=smoke", f"output={tmp_path}", "tracking=mlflow"]
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)
    monkeypatch.setattr(app, "train", diverge)
    with pytest.raises(InputError, match="channel_weights.2 has NaN"):
        app.train_distance(composed(*words))
    assert not list(tmp_path.rglob("finished.json"))
    assert tracking.runs_frame(tracking.prepare_store(tmp_path), "perceptual")["status"].tolist() == ["FAILED"]
    monkeypatch.setattr(app, "train", train)
    fractal_features.load(app.train_distance(composed(*words, "resume=true")))


def test_training_anew_takes_the_old_weights_away_first(tmp_path, monkeypatch):
    words = ["training=smoke", f"output={tmp_path}", "tracking=none"]
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
