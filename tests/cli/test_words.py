"""What a wrong word on the command line is answered with, and what picture= and seconds= come to."""

import argparse
import sys

import numpy as np
import pytest
import torch
from commands import run_here, said
from hydra import compose, initialize_config_module
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf
from PIL import Image

from fractal_exp import InputError, codes, invert, render
from fractal_exp.cli import commands, configuration, sweep, sweep_check, train, words
from fractal_exp.cli.vocabulary import Vocabulary
from fractal_exp.ifs import attractor

SHOWN = ["--cfg", "job"]


@pytest.mark.parametrize(("arguments", "message"), [
    (["method=colage"], "there is no method=colage; did you mean 'collage'? the choices are collage, cuckoo"),
    (["target.pth=leaf.png"], "there is no setting target.pth; did you mean target.path (with target=image)?"),
    (["target=image", "target.pth=leaf.png"], "did you mean target.path"),
    (["sedd=3"], "there is no setting sedd; did you mean seed?"),
    (["optimizer.annealing.spred=3"], "did you mean optimizer.annealing.spread"),
    (["maps=3"], "there is no setting maps; did you mean"),
    (["method.maps=3"], "method.maps is a setting of method=amortized or method=collage or"),
    (["restarts=3"], "there is no setting restarts; did you mean method.search.restarts (with method=collage)?"),
    (["method=collage", "detail_moves=3"], "did you mean method.search.detail_moves"),
    (["metod=collage"], "there is no setting metod; did you mean method?"),
    (["foo/bar=3"], "there is no setting foo/bar"),
    (["target@foo=known"], "target"),
    (["leaf.png"], "a picture is given as picture=leaf.png"),
    (["resume"], "resume needs a value: resume=VALUE"),
    (["a=["], "the value of 'a=[' cannot be read"),
    (["seed==3"], "the value of 'seed==3' cannot be read"),
    (["seed=abc"], "seed must be a whole number, got 'abc'"),
    (["seconds=abc"], "seconds must be a number, got 'abc'"),
    (["seed="], "seed must be a whole number, got nothing"),
    (["resume=perhaps"], "resume must be true or false, got 'perhaps'"),
    (["seed=1,2"], "-m runs one fit for each of them"),
    (["+seed=3"], "the setting seed exists already"),
    (["~sedd"], "there is no setting sedd"),
    (["--config-dir", "nowhere"], "there is no folder"),
    (["--config-name", "nothing"], "there is no configuration 'nothing'"),
    (["--multirn"], "there is no option --multirn; did you mean '--multirun'"),
    (["--mthod=collage"], "there is no option --mthod; did you mean 'method'?"),
    (["--seed", "3"], "settings are written without dashes: seed=VALUE"),
    (["model=null"], "the command cannot be carried out"),
    (["picture=a.png", "target=known"], "picture=a.png and target=known both name a target"),
    (["picture=a.png", "target.path=b.png"], "both name a target"),
    (["picture="], "picture= needs a file"),
])
def test_a_wrong_word_is_answered_in_one_line(arguments, message):
    assert message in said(train, *arguments, *SHOWN)


@pytest.mark.parametrize(("arguments", "message"), [
    (["-m", "method=colage"], "did you mean 'collage'"),
    (["-m", "sedd=1,2"], "did you mean seed"),
    (["-m", "seed=1,abc"], "seed must be a whole number, got 'abc'"),
    (["-m", "seed=range("], "cannot be read"),
    (["-m", "hydra.sweep.dir=${nowhere}"], "refers to what does not exist"),
    (["-m", *SHOWN], "Only one of"),
    (["target=image"], "no value was given for target.path; add picture=FILE"),
])
def test_so_it_is_where_several_fits_are_asked_for(arguments, message, tmp_path):
    where = [f"output={tmp_path}"] if SHOWN[0] not in arguments else []
    assert message in said(train, *arguments, *where)


@pytest.mark.parametrize(("arguments", "message"), [
    (["ablation"], "there is no study 'ablation'; did you mean 'ablations'"),
    (["seeds", "sedd=3"], "there is no setting sedd; did you mean seed?"),
    (["seeds", "sweep.cuont=3"], "did you mean sweep.count"),
    (["seeds", "method=chaotic,colage"], "there is no method=colage; did you mean 'collage'"),
    (["seeds", "seed=1,abc"], "seed must be a whole number, got 'abc'"),
    (["seeds", "picture=a.png", "target=known"], "both name a target"),
])
def test_a_sweep_is_refused_before_it_is_opened(arguments, message, tmp_path):
    assert message in said(sweep, *arguments, f"output={tmp_path / 'out'}")
    assert not (tmp_path / "out" / "mlflow.db").exists()


def test_a_defect_of_ours_keeps_its_traceback(capsys):
    def broken():
        raise ZeroDivisionError("of ours")
    with pytest.raises(SystemExit) as stop:
        words.run("fractal-train", broken, [], "train")
    assert stop.value.code == 1 and "ZeroDivisionError: of ours" in capsys.readouterr().err


def completed(*given: str) -> list[str]:
    return words.completed(given, Vocabulary("train"), ["method=collage"])


def settings(*given: str) -> dict:
    configuration.register()
    with initialize_config_module("fractal_exp.conf", version_base="1.3"):
        config = configuration.resolve(compose("train", completed(*given)))
    plain = OmegaConf.to_container(config)
    return {key: value for key, value in plain.items() if key not in train.NOT_PART_OF_A_FIT}


def test_a_picture_takes_its_target_and_collage_search(tmp_path):
    path = tmp_path / "leaf.png"
    whole = settings(f"picture={path}")
    assert whole["target"]["path"] == str(path) and whole["method"]["_target_"].endswith("Collage")
    assert whole == settings("target=image", f"target.path={path}", "method=collage"), "one fit, written in two ways"
    assert whole == settings("target=image", f"picture={path}")
    assert settings("picture=a.png", "method=chaotic")["method"]["_target_"].endswith("Chaotic")
    assert settings("picture=a.png", "model.maps=5")["method"]["model"]["maps"] == 5
    assert settings("picture=a.png", "target.threshold=0.5")["target"]["threshold"] == 0.5
    assert settings("picture=a.png", "method.maps=4")["method"]["maps"] == 4


def test_a_picture_may_have_any_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("my leaf (1).png", "a,b.png", "it's [x]=y.png"):
        (tmp_path / name).touch()
        assert settings(f"picture={name}")["target"]["path"] == str(tmp_path / name)


def test_a_limit_of_time_is_that_of_the_method_however_it_is_written():
    assert settings("seconds=60") == settings("method.seconds=60") == settings("seconds=60.0") != settings("seconds=61")
    assert settings("seconds=60", "method=collage")["method"]["seconds"] == 60
    assert settings("seconds=60", "init=collage")["method"]["init"]["seconds"] == 60


def test_flags_may_stand_anywhere():
    assert completed("seed=1,2", "-m", "threads=1") == ["-m", "seed=1,2", "threads=1"]


def test_a_study_of_the_suite_takes_a_picture_instead(tmp_path):
    path = tmp_path / "cross.png"
    image = np.full((64, 64), 255, np.uint8)
    image[10:54, 28:36] = image[28:36, 10:54] = 0
    Image.fromarray(image).save(path)
    status, printed = run_here(sweep, "seeds", f"picture={path}", "scale=smoke", "seed=0,1", "iterations=2",
                               "resolution=32", "tracking=none", f"output={tmp_path / 'out'}", "threads=1")
    assert status == 0 and "2 of 2 jobs finished" in printed, printed
    assert {each.parent.name for each in (tmp_path / "out").rglob("code.json")} == {"seed=0", "seed=1"}


def test_the_help_lists_settings_that_exist():
    status, text = run_here(train, "--help")
    assert status == 0
    block = text.split("Settings", 1)[1].split("\n\n", 1)[0].splitlines()[1:]
    listed = [word for line in block for word in line.split("  ")[1].split(", ")]
    assert {"picture", "seconds", "seed", "method", "target.name", "model.maps", "method.maps", "resolution", "output",
            "name", "resume", "threads", "device", "scale", "evaluation.views"} <= set(listed)
    known = Vocabulary("train")
    assert [key for key in listed if key not in known] == []
    assert len(text.splitlines()) < 70


SQUARE = np.pad(np.ones((32, 20), np.float32), ((16, 16), (22, 22)))


@pytest.mark.parametrize(("options", "message"), [
    ({"map": 3}, "the method 'collage' has no option 'map'; did you mean 'maps'"),
    ({"restarts": 3}, "the method 'collage' has no option 'restarts'; did you mean search.restarts?"),
    ({"levels": "densty"}, "got 'densty'; did you mean 'density'?"),
    ({"seconds": "a"}, "seconds must be a number or None, got 'a'"),
    ({"seed": 1.5}, "seed must be a whole number, got 1.5"),
    ({"maps": True}, "maps must be a whole number, got True"),
    ({"method": "colage"}, "there is no method 'colage'; did you mean 'collage'"),
    ({"on_step": 3}, "on_step must be a function"),
    ({"seed": np.int64(3), "maps": 1}, "maps must be at least 2, got 1"),
])
def test_a_wrong_option_of_invert_is_named(options, message):
    with pytest.raises(InputError, match=message):
        invert(SQUARE, **options)


def test_a_defect_inside_a_method_is_not_blamed_on_the_options(monkeypatch):
    from fractal_exp.methods.collage import method as collage

    def broken(*, resolution: int, seed: int, seconds: float | None = None) -> collage.Collage:
        raise TypeError("of ours")
    monkeypatch.setattr(collage, "laptop", broken)
    with pytest.raises(TypeError, match="of ours"):
        invert(SQUARE)


@pytest.mark.parametrize(("code", "message"), [
    ("fern", r"must be an IFS, got 'fern'; fractal_exp.codes.known\('fern'\)"),
    ("leaf.json", r"IFS.load\('leaf.json'\)"), (3, "must be an IFS, got int"),
])
def test_what_is_no_code_is_not_drawn(code, message):
    with pytest.raises(InputError, match=message):
        render(code, resolution=32)


def test_a_code_with_gradients_is_drawn_by_its_values():
    code = attractor.normalize(codes.known("fern"))
    image = render(code, resolution=32)
    for tensor in (code.linear, code.offset):
        tensor.requires_grad_()
    again = render(code, resolution=32)
    assert torch.equal(image, again) and not again.requires_grad


def test_a_mistake_in_the_yaml_of_a_user_is_located(tmp_path):
    (tmp_path / "target").mkdir()
    (tmp_path / "target" / "mine.yaml").write_text("name: fern\nkind: [grey\n")
    error = said(train, "--config-dir", str(tmp_path), "target=mine", *SHOWN)
    assert "mine.yaml" in error and "line 2" in error and "expected ',' or ']'" in error


@pytest.mark.parametrize("study", sweep.study_names())
def test_in_every_study_a_picture_is_the_whole_target(study, tmp_path, monkeypatch):
    """The words that the check adds leave a target of nothing but the picture's own settings, in every job."""
    monkeypatch.setattr(sweep_check, "_compose_some", lambda config: None)
    configuration.register()
    given = words.completed([f"picture={tmp_path / 'leaf.png'}"], Vocabulary("sweep"))
    search = ["hydra.searchpath=[pkg://fractal_exp.conf]"]
    with initialize_config_module("fractal_exp.sweeps", version_base="1.3"):
        config = compose(study, [*given, *search], return_hydra_config=True)
        sweep_check.CheckSweep().on_multirun_start(config)
        assert not [key for key in config.hydra.sweeper.params if key.startswith("target")]
        jobs = OverridesParser.create().parse_overrides(list(config.hydra.overrides.task))
        [[job]] = BasicSweeper.split_arguments(jobs, None)
        target = compose(study, [*job, *search]).target
    assert set(target) == {"_target_", "path", "invert", "threshold", "clean", "crop", "levels"}
    assert target._target_.endswith("Picture")


def test_an_error_after_a_signal_is_the_interruption_in_every_command(monkeypatch, capsys):
    monkeypatch.setattr("fractal_exp.cli.interruption._asked", True)
    monkeypatch.setattr(sys, "argv", ["fractal-train"])

    def fail(*_):
        raise AttributeError

    with pytest.raises(KeyboardInterrupt), words.one_line("fractal-train"):
        fail()
    with pytest.raises(KeyboardInterrupt):
        words.run("fractal-train", fail, [], "train")
    with pytest.raises(SystemExit, match="130"):
        commands.command("fractal-view", fail, argparse.ArgumentParser(), [])
    assert capsys.readouterr().err == "\nfractal-view: interrupted\n"
