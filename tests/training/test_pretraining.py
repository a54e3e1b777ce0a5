"""The training of the networks of compared methods: what they see, that it can be interrupted, and the command."""

import json
import math
import re
from pathlib import Path

import fractal_exp.conf
import numpy as np
import pytest
import torch
from configured import composed, options, plain
from fractal_exp.conf.generate import hydra_config
from networks_helpers import REGRESSION, TRAININGS, Stop, each_training, resumed, run, saved, stopped_after

from benchmarks import networks
from fractal_exp import InputError, tracking
from fractal_exp.cli import configuration, pretrain
from fractal_exp.cli.train import NOT_PART_OF_A_FIT
from fractal_exp.ifs import attractor
from fractal_exp.methods.base import FitDiverged
from fractal_exp.runtime import weights
from fractal_exp.suite import FIRST_TRAINING_SEED, draw_code, random_suite, target
from fractal_exp.training import codes
from fractal_exp.training.loop import train
from fractal_exp.training.neural_regression import RegressionTraining


def test_no_suite_has_the_seed_of_a_training_code():
    streams = (codes.TRAINING, codes.HELD_OUT)
    seeds = [codes.code_seed(seed, name, stream, number) for seed in (0, 1, 2025) for name in TRAININGS
             for stream in streams for number in range(300)]
    assert min(seeds) >= FIRST_TRAINING_SEED and max(seeds) < 2**63
    assert len(set(seeds)) == len(seeds), "training and held-out codes are others, too"
    for seed in (seeds[0], FIRST_TRAINING_SEED):
        with pytest.raises(InputError, match="a suite's seed must be below 2.62"):
            random_suite(1, seed)
    assert len(random_suite(1, FIRST_TRAINING_SEED - 1)) == 1


def test_training_codes_are_the_suites_distribution_in_the_frame_of_targets():
    seed = codes.code_seed(0, "x", codes.TRAINING, 3)
    code = codes.training_code(seed)
    drawn = draw_code(np.random.Generator(np.random.PCG64(seed)), {})
    assert torch.equal(code.linear, drawn.linear) and torch.equal(code.offset, attractor.normalize(drawn).offset)


def test_a_picture_is_a_target_drawn_with_other_points():
    code = codes.training_code(codes.code_seed(0, "x", codes.TRAINING, 1))
    picture, again, fewer = (codes.draw([codes.rows(code)], 64, *rest)[0] for rest in ((1,), (2,), (1, 2.0)))
    truth = target(code, 64)
    assert float((picture - truth).abs().mean()) < 1.5 * float((picture - again).abs().mean()) + 1e-3
    assert not torch.equal(picture, again) and not torch.equal(picture, fewer)


@each_training
def test_batches_depend_on_their_number_alone(name):
    first, again = TRAININGS[name](), TRAININGS[name]()
    first.batch(0)
    for one, other in zip(first.batch(5), again.batch(5), strict=True):
        assert torch.equal(one.nan_to_num(9), other.nan_to_num(9))
    assert not torch.equal(first.batch(5)[0], first.batch(4)[0])
    assert not torch.equal(first.batch(5)[0], TRAININGS[name](seed=1).batch(5)[0])


@each_training
def test_first_weights_come_from_the_seed_alone(name):
    before = torch.get_rng_state()
    one, other, third = (TRAININGS[name](seed=seed).network().state_dict() for seed in (3, 3, 4))
    assert torch.equal(torch.get_rng_state(), before)
    assert all(torch.equal(one[key], other[key]) for key in one)
    assert any(not torch.equal(one[key], third[key]) for key in one)


@each_training
def test_an_interrupted_training_gives_the_same_weights(name, tmp_path):
    whole = train(TRAININGS[name]())
    again, steps = resumed(TRAININGS[name], tmp_path / "checkpoint.safetensors", 5, 8)
    assert steps[0] == 7, "it goes on behind its last checkpoint"
    assert whole.scores == again.scores and whole.stopped == again.stopped
    assert set(whole.tensors) == set(again.tensors)
    assert all(torch.equal(whole.tensors[key], again.tensors[key]) for key in whole.tensors)


@each_training
def test_it_tells_the_held_out_loss_beside_the_trivial_one(name):
    seen = []
    trained = train(TRAININGS[name](), on_step=seen.append)
    trivial = {"neural_regression": "mean code", "super_resolution": "bicubic", "amortized": "other pictures"}[name]
    assert f"held out {trained.scores['held_out']:.3g}↓" in {part for p in seen for part in p.describe().split(", ")}
    assert re.search(rf"step 9 of 9, loss \S+↓, held out \S+↓, {trivial} \S+", seen[-1].describe())
    assert [progress.step for progress in seen] == list(range(1, 10)) and seen[-1].fraction == 1


def test_the_best_state_is_kept_and_the_training_ends_where_nothing_gets_better():
    losses = iter([3.0, 1.0, 2.0, 1.5, 0.5])
    states = []

    class Judged(RegressionTraining):
        def judge(self, network, device):
            states.append({key: value.clone() for key, value in network.state_dict().items()})
            return {"held_out": next(losses), "mean_code": 4.0}

    trained = train(Judged(**REGRESSION | {"epochs": 9, "patience": 2}))
    assert trained.stopped == "2 looks in a row found nothing better, after 12 steps" and len(states) == 4
    assert trained.scores["held_out"] == 1.0
    assert all(torch.equal(trained.tensors[key], states[1][key]) for key in trained.tensors)


def test_a_training_that_breaks_down_says_so():
    class Broken(RegressionTraining):
        def loss(self, network, batch):
            return super().loss(network, batch) * math.nan

    with pytest.raises(FitDiverged, match="step 1 of the training met a NaN"):
        train(Broken(**REGRESSION))


def test_a_limited_training_keeps_what_it_has():
    trained = train(TRAININGS["neural_regression"](epochs=10**6, patience=10**6), seconds=0.2)
    assert trained.stopped.startswith("the time limit of 0.2 s was reached after") and trained.scores


@pytest.mark.parametrize(("name", "change", "message"), [
    ("neural_regression", {"epochs": 0}, "epochs must be at least 1, got 0"),
    ("neural_regression", {"side": 20}, "side must be a multiple of 8, as 3 blocks halve it, got 20"),
    ("neural_regression", {"maps": 9}, "maps must be at least 10 and at most 64, got 9"),
    ("neural_regression", {"rate": 0.0}, "rate must be above 0"),
    ("neural_regression", {"seed": -1}, "seed must be at least 0, got -1"),
    ("neural_regression", {"channels": []}, "channels must be a list of at least 1 values"),
    ("neural_regression", {"points": 6.0}, "points must be at least 0 and at most 5, got 6"),
    ("neural_regression", {"epoch": 3}, "no parameter epoch; did you mean 'epochs'"),
    ("amortized", {"heads": 3}, "the last of channels must be a multiple of heads, got 8 and 3"),
    ("amortized", {"channels": [6]}, "channels.0 must be"),
    ("super_resolution", {"steps": 0}, "steps must be at least 1, got 0"),
    ("super_resolution", {"factor": 6}, "factor must be a power of 2, got 6"),
    ("super_resolution", {"heads": 3}, "width must be a multiple of the number of heads, got 32 and 3"),
    ("super_resolution", {"patch": 64}, "patch must be at most side"),
])
def test_trainings_that_cannot_be(name, change, message):
    with pytest.raises(InputError, match=message):
        TRAININGS[name](**change)


@pytest.mark.parametrize("name", TRAININGS)
def test_its_file_is_made_from_its_recipe_and_every_scale_composes(name):
    path = Path(next(iter(fractal_exp.conf.__path__))) / "pretraining" / f"{name}.yaml"
    file = f"pretraining/{name}"
    assert path.read_text() == hydra_config(file), f"python -m fractal_exp.conf.generate {file} > {path}"
    for scale in ("smoke", "laptop", "paper"):
        training = configuration.build(configuration.resolve(
            composed("task=pretrain", f"method={name}", f"scale={scale}")).pretraining)
        assert training.method.name == name
        if scale == "paper":
            assert training.params == type(training.params)(), "the recipe's own values are the paper's"
    assert f"{name}_laptop" in options("pretraining")
    with pytest.raises(InputError, match=f"did you mean '{file}'"):
        hydra_config(file[:-1])


def test_a_fit_is_the_same_with_and_without_the_recipe():
    """Names of folders and checkpoints of fits do not change with how a network is trained."""
    assert {"task", "pretraining", "weights", "network_side"} <= set(NOT_PART_OF_A_FIT)
    assert plain()["pretraining"] is None and plain("method=neural_regression")["pretraining"] is not None


SMOKE = ["task=pretrain", "scale=smoke", "threads=1"]


@pytest.mark.parametrize("name", ["neural_regression", "super_resolution",
                                  pytest.param("amortized", marks=pytest.mark.slow)])
def test_the_command_trains_a_network_that_a_fit_takes(name, tmp_path, capsys):
    scores = run(*SMOKE, f"method={name}", f"output={tmp_path}")
    printed = capsys.readouterr().out
    path = tmp_path / "pretraining" / f"{name}-smoke-seed0" / f"{name}.safetensors"
    assert f"weights    {path}" in printed and "held out" in printed
    found = weights.load(path, name)
    assert found.scores["held_out"] == scores["eval/held_out"] and found.recipe["stopped"] == "all 6 steps done"
    uri = tracking.prepare_store(tmp_path)
    logged = tracking.runs_frame(uri, "pretraining").iloc[0]
    assert logged["status"] == "FINISHED" and logged["metrics.eval/held_out"] == pytest.approx(scores["eval/held_out"])
    assert tracking.read_artifact(uri, logged["run_id"], path.name) == path.read_bytes()
    assert len(tracking.read_series(uri, logged["run_id"], "train/loss")) == 6
    assert run(*SMOKE, f"method={name}", f"output={tmp_path}", "resume=true") == scores
    assert "finished; resume=false trains again" in capsys.readouterr().out
    fitted = run(f"method={name}", f"weights.{name}={path}", "scale=smoke", f"output={tmp_path}", "tracking=none",
                 "target.name=sierpinski_triangle", "evaluation.resolution=32", "evaluation.points_in_view=20000",
                 "name=fit", "threads=1")
    assert 0 <= fitted["eval/f1"] <= 1
    folder = tmp_path / "fits" / "fit"
    assert (folder / "code.json").exists() == (name != "super_resolution") and (folder / "views/result.png").exists()
    assert (folder / "enlarged.png").exists() == (name == "super_resolution")
    assert json.loads((folder / "finished.json").read_text())["scores"] == fitted
    path.unlink()
    with pytest.raises(InputError, match="safetensors"):
        run(*SMOKE, f"method={name}", f"output={tmp_path}", "resume=true")


def test_an_interrupted_command_goes_on(tmp_path, monkeypatch):
    words = [*SMOKE, "method=neural_regression", f"output={tmp_path}", "tracking=none", "checkpoint_every=2"]
    whole = run(*words, "name=whole")

    def interrupted(training, on_step, **rest):
        return train(training, on_step=stopped_after(5), **rest)

    monkeypatch.setattr(pretrain, "train", interrupted)
    with pytest.raises(Stop):
        run(*words, "name=part")
    assert (tmp_path / "pretraining/part/checkpoint.safetensors").exists()
    monkeypatch.undo()
    with pytest.raises(InputError, match="pretraining.epochs: 3 there, 4 now"):
        run(*words, "name=part", "resume=true", "pretraining.epochs=4")
    resumed_scores = run(*words, "name=part", "resume=true")
    assert resumed_scores["eval/held_out"] == whole["eval/held_out"]
    one, other = (weights.load(tmp_path / "pretraining" / name / "neural_regression.safetensors", "neural_regression")
                  for name in ("whole", "part"))
    assert all(torch.equal(one.tensors[key], other.tensors[key]) for key in one.tensors)


@pytest.mark.parametrize(("words", "message"), [
    (["method=cuckoo"], "the method cuckoo has no network to train"),
    (["method=neural_regression", "seconds=0"], "seconds must be above 0 .* got 0"),
    (["method=neural_regression", "pretraining.epochs=0"], "pretraining.epochs must be at least 1, got 0"),
    (["method=neural_regression", "+pretraining.colour=1"], "pretraining.colour: Extra inputs are not permitted"),
    (["method=neural_regression", "device=gpu"], "there is no device 'gpu'"),
])
def test_a_training_that_cannot_begin_leaves_nothing(words, message, tmp_path):
    with pytest.raises(InputError, match=message):
        run(*SMOKE, *words, f"output={tmp_path}", "tracking=none")
    assert not list(tmp_path.iterdir())


@each_training
def test_a_network_is_judged_code_by_code_beside_a_trivial_answer(name, tmp_path):
    row = networks.judged(name, str(saved(tmp_path / "net", name)))
    training = TRAININGS[name]()
    with torch.no_grad():
        scores = training.judge(training.network().eval(), "cpu")
    assert row["codes"] == training.params.held_out
    assert row["held_out"] == pytest.approx(scores["held_out"], rel=1e-3), "weights are kept as float16"
    assert row["trivial_error"] == pytest.approx(scores[row["trivial"]], rel=1e-3)
    assert row["difference"] == pytest.approx(row["held_out"] - row["trivial_error"])
    assert row["low"] <= row["difference"] <= row["high"]
    assert name in networks.told(row)
