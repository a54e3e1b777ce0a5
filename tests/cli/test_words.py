"""What a wrong word on the command line is answered with, and what picture= and seconds= come to."""

import argparse
import contextlib
import errno
import json
import re
import signal

import configured
import numpy as np
import pytest
import torch
from commands import run_here, said
from omegaconf import OmegaConf
from places import ROOT
from sweeps_helpers import jobs_of
from train_helpers import own_task

from fractal_exp import InputError, codes, invert, render
from fractal_exp.cli import commands, composed, sweep, words
from fractal_exp.cli.train import NOT_PART_OF_A_FIT
from fractal_exp.ifs import attractor
from fractal_exp.tracking import runs_frame

SHOWN = ["--cfg", "job"]


@pytest.mark.parametrize(("arguments", "message"), [
    (["target=image", "target.pth=leaf.png"], "did you mean target.path"),
    (["sedd=3"], "did you mean seed"),
    (["maps=3"], "did you mean model.maps?"),
    (["method=collage", "detail_moves=3"], "did you mean method.search.detail_moves"),
    (["metod=collage"], "did you mean method"),
    (["~sedd"], "did you mean seed"),
    (["--sedd", "3"], "written without dashes: did you mean seed"),
    (["leaf.png"], "a picture: picture=leaf.png"),
    (["name=a(b"], """quoted twice: "name='a(b'\""""),
    (["seed=abc"], "'abc' of type 'str' could not be converted to Integer\n    full_key: seed"),
    (["seed=1,2"], "add --multirun to your command line"),
    (["--config-dir", "nowhere"], "nowhere' not found"),
    (["picture=a.png", "target=known"], "picture=a.png and target=known both name a target"),
    (["picture="], "picture= needs a file"),
    (["-m", "method=colage"], "did you mean 'collage'"),
])
def test_what_a_wrong_word_may_have_meant_is_said_after_what_hydra_says(arguments, message):
    assert message in said(composed, *arguments, *(SHOWN if "-m" not in arguments else []))


@pytest.mark.parametrize(("arguments", "message"), [
    (["ablation"], "there is no study 'ablation'; did you mean 'ablations'"),
    (["seeds", "sweep.cuont=3"], "did you mean sweep.count"),
    (["seeds", "seed=1,abc"], "'abc' of type 'str' could not be converted to Integer"),
    (["seeds", "picture=a.png", "target=known"], "both name a target"),
])
def test_a_sweep_is_refused_before_it_is_opened(arguments, message, tmp_path):
    assert message in said(sweep, *arguments, f"output={tmp_path / 'out'}")
    assert not (tmp_path / "out").exists()


def fails(config):
    """In place of a fit, by its seed."""
    if config.seed == 1:
        raise InputError("this seed is out")
    if config.seed == 3:
        raise ZeroDivisionError("of ours")
    if config.seed == 5:
        raise OSError(errno.ENOSPC, "No space left on device", "/x")
    print(f"seed {config.seed} is done")


def test_a_defect_of_ours_keeps_its_traceback(tmp_path):
    status, printed = run_here(composed, *own_task(tmp_path, fails), "seed=3")
    assert status == 1 and "ZeroDivisionError: of ours" in printed


def test_several_fits_go_on_without_those_that_fail_which_are_told_at_the_end(tmp_path):
    status, printed = run_here(composed, "-m", *own_task(tmp_path, fails), "seed=0,1,3,4", f"output={tmp_path}")
    assert status == 2 and re.findall(r"seed (\d) is done", printed) == ["0", "4"], printed
    told = ["seed=1: this seed is out", "seed=3: ZeroDivisionError: of ours"]
    assert [f"  {line}" for line in told] == printed.splitlines()[-2:] and "2 failed" in printed
    assert "Traceback" in printed, "of the defect"
    frame = runs_frame(f"sqlite:///{tmp_path / 'mlflow.db'}", "fits")
    assert list(frame["status"]) == ["FAILED"] and list(frame["tags.error"]) == ["2 fits failed"], "the parent's"


TINY = ["scale=smoke", "iterations=2", "resolution=32", "threads=1", "evaluation.resolution=32",
        "evaluation.points_in_view=20000"]


def scores(config):
    """In place of a fit."""
    return {"eval/f1": 0.5}


def test_jobs_of_m_stand_below_one_run_with_their_table_and_are_named_by_what_they_vary(tmp_path):
    words = "-m", "model=naive,svd", "model.maps=2,3", *TINY, f"output={tmp_path}"
    without_fits = *words, *own_task(tmp_path, scores)
    assert run_here(composed, *without_fits, "tracking=none")[0] == 0 and not (tmp_path / "mlflow.db").exists()
    assert run_here(composed, *without_fits)[0] == 0
    status, printed = run_here(composed, *words)
    assert status == 0 == run_here(composed, *words, "resume=true")[0], printed
    frame = runs_frame(f"sqlite:///{tmp_path / 'mlflow.db'}", "fits")
    parents, fits = (frame[(frame["tags.kind"] == "several") == several] for several in (True, False))
    assert list(parents["name"]) == ["model=naive,svd,model.maps=2,3"] * 2, "without resume=true, each begins its own"
    assert set(parents["status"]) == {"FINISHED"}
    assert list(fits["tags.mlflow.parentRunId"]) == [parents["run_id"].iloc[0]] * 4
    assert set(fits["tags.mlflow.runName"]) == {f"fern, chaotic{variant}, model.maps={maps}"
                                                for variant in ("", ", naive") for maps in (2, 3)}
    assert sorted(fits["tags.variant"]) == ["full", "full", "naive", "naive"]
    for maps in (2, 3):
        assert f"fern (model=naive model.maps={maps}): the paper's method, naive," in printed
        assert f"fern (model=svd model.maps={maps}): the paper's method, 32²" in printed
    rows = [f"model={model} model.maps={maps}" for model in ("naive", "svd") for maps in (2, 3)]
    table = printed.splitlines()[-5:]
    assert "f1" in table[0] and [" ".join(line.split()[:2]) for line in table[1:]] == rows, printed
    for parent in parents["run_id"]:
        [table] = tmp_path.glob(f"**/{parent}/artifacts/summary.json")
        columns, data = (json.loads(table.read_text())[key] for key in ("columns", "data"))
        assert columns[0] == "fit" and "eval/f1" in columns and [row[0] for row in data] == rows
    assert len({path.name for path in (tmp_path / "fits").iterdir() if "-naive-" in path.name}) == 2


def test_a_run_is_named_by_what_its_command_sets(tmp_path):
    status, printed = run_here(composed, "optimizer.lr=1e-3", "seed=1", *TINY, f"output={tmp_path}")
    assert status == 0, printed
    frame = runs_frame(f"sqlite:///{tmp_path / 'mlflow.db'}", "fits")
    assert list(frame["name"]) == ["fern, chaotic, seed 1, optimizer.lr=1e-3, scale=smoke, iterations=2, "
                                   "resolution=32, evaluation.resolution=32, evaluation.points_in_view=20000"]


def test_a_loss_of_ones_own_names_the_variant(tmp_path):
    (tmp_path / "loss").mkdir()
    (tmp_path / "loss" / "edges.yaml").write_text("defaults: [full, _self_]\nweights: {mse: 2.0}\n")
    status, printed = run_here(composed, "--config-dir", str(tmp_path), "loss=edges", *SHOWN, "--resolve")
    assert status == 0 and "\nvariant: edges\n" in printed, printed


def completed(*given: str) -> list[str]:
    return words.completed(given, ["method=collage"])


def settings(*given: str) -> dict:
    return {key: value for key, value in configured.plain(*completed(*given)).items() if key not in NOT_PART_OF_A_FIT}


def known_to(*choices: str) -> set[str]:
    """All settings and groups by their full names."""
    def paths(data):
        for key, value in data.items() if isinstance(data, dict) else ():
            yield from (key, *(f"{key}.{inner}" for inner in paths(value)))

    config = OmegaConf.to_container(configured.composed(*choices, hydra=True))
    return {*paths(config), *config["hydra"]["runtime"]["choices"]}


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


def test_a_picture_may_have_any_name(folder):
    for name in ("my leaf (1).png", "a,b.png", "it's [x]=y.png"):
        (folder / name).touch()
        assert settings(f"picture={name}")["target"]["path"] == str(folder / name)


def test_a_limit_of_time_is_that_of_the_method_however_it_is_written():
    assert settings("seconds=60") == settings("method.seconds=60") == settings("seconds=60.0") != settings("seconds=61")
    assert settings("seconds=60", "method=collage")["method"]["seconds"] == 60
    assert settings("seconds=60", "init=collage")["method"]["init"]["seconds"] == 60


def test_flags_may_stand_anywhere():
    assert completed("seed=1,2", "-m", "threads=1") == ["-m", "seed=1,2", "threads=1"]
    assert completed("~name", "--config-dir", "mine") == ["--config-dir", "mine", "~name"]


def test_the_help_lists_settings_that_exist():
    status, text = run_here(composed, "--help")
    assert status == 0
    block = text.split("Settings", 1)[1].split("\n\n", 1)[0].splitlines()[1:]
    listed = [word for line in block for word in line.split("  ")[1].split(", ")]
    assert {"picture", "seconds", "seed", "method", "target.name", "model.maps", "method.maps", "resolution", "output",
            "name", "resume", "threads", "device", "scale", "evaluation.views"} <= set(listed)
    known = {*known_to("method=collage"), *known_to("method=chaotic")}
    assert [key for key in listed if key not in known] == []
    assert len(text.splitlines()) < 70


SQUARE = np.pad(np.ones((32, 20), np.float32), ((16, 16), (22, 22)))


@pytest.mark.parametrize(("options", "message"), [
    ({"map": 3}, "the method 'collage' has no option 'map'; did you mean 'maps'"),
    ({"restarts": 3}, "the method 'collage' has no option 'restarts'; did you mean search.restarts?"),
    ({"image": {"last": 2}}, "there is no parameter image.last; choose one of finest, last_renderings"),
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


def test_what_the_system_refuses_of_a_file_is_one_line(tmp_path):
    told = said(composed, *own_task(tmp_path, fails), "seed=5")
    assert "error: /x: No space left on device; free some space" in told


@pytest.mark.parametrize("study", [["collage_ablation", "without=roots,nothing"], *(
    pytest.param([name], marks=pytest.mark.slow) for name in ("seeds", "function_count"))])
def test_in_every_study_a_picture_is_the_whole_target(study, tmp_path):
    """Each job has a target of nothing but the picture's own settings, and the table speaks of it."""
    jobs = jobs_of(*study, f"picture={tmp_path / 'leaf.png'}", "sweep.count=2")
    assert len(jobs) > 1
    for job in jobs:
        assert set(job["target"]) == set(OmegaConf.load(ROOT / "conf" / "target" / "image.yaml"))
        assert job["target"]["_target_"].endswith("Picture")
    assert len({(job["sweep"]["row"], job["sweep"]["sample"]) for job in jobs}) == len(jobs)


def loses_its_interruption(_):
    """In place of a fit, or of any command."""
    with contextlib.suppress(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    raise AttributeError


def test_an_error_after_a_signal_is_the_interruption_in_every_command(signals_are_heard, tmp_path):
    status, printed = run_here(composed, *own_task(tmp_path, loses_its_interruption))
    assert status == 130 and "interrupted" in printed and "Traceback" not in printed
    with pytest.raises(SystemExit, match="130"):
        commands.command("fractal-view", loses_its_interruption, argparse.ArgumentParser(), [])
