"""What fractal-train says may help, and what it says of a code whose truth is known."""

import shutil

import pytest
from configured import composed
from omegaconf import OmegaConf
from train_helpers import own_method, train

from fractal_exp import IFS, codes
from fractal_exp.cli.train import may_help
from fractal_exp.ifs import attractor
from fractal_exp.inversion import Inversion
from fractal_exp.studies.judging import finds_truth
from fractal_exp.tracking.addresses import dashboard_line
from fractal_exp.verdict import Verdict

OPTIONS = {"resolution": 64, "points_in_view": 100_000, "supersample": 8, "views": "attractor", "align": "bbox",
           "device": "cpu"}
TRIANGLE = attractor.normalize(codes.known("sierpinski_triangle"))


@pytest.fixture
def helps(picture, tmp_path, monkeypatch, hydra_composed):
    """What may help after a command of these words, where a verdict names this change."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(picture, "leaf.png")

    def ask(words, change):
        config = composed(*words, hydra=True)
        hydra_composed(OmegaConf.masked_copy(config, "hydra"))
        config = OmegaConf.masked_copy(config, [key for key in config if key != "hydra"])
        return may_help(Verdict("approximation", "so so", "in words", change), config)
    return ask


PICTURE = ["picture=leaf.png", "target=image", "method=collage"]  # as picture=leaf.png is completed


@pytest.mark.parametrize("words, change, line", [
    (PICTURE, {"resolution": 387}, "picture=leaf.png resolution=387"),
    (PICTURE, {"maps": 8}, "picture=leaf.png method.maps=8"),
    ([*PICTURE, "seconds=9", "name=mine", "resume=true"], {"seconds": 36.0}, "picture=leaf.png seconds=36"),
    ([*PICTURE, "method.seconds=9"], {"seconds": 36.0}, "picture=leaf.png method.seconds=36"),
    (PICTURE, {"invert": True}, "picture=leaf.png target.invert=true"),
    (PICTURE, {"levels": "coverage"}, "picture=leaf.png target.levels=coverage"),
    (["target.name=tree", "model.maps=2"], {"maps": 4}, "target.name=tree model.maps=4"),
    (["method=cuckoo"], {"maps": 20}, "method=cuckoo method.maps=20"),
    (["init=collage"], {"maps": 6}, "init=collage init.maps=6"),
    (["target=known"], {"levels": "coverage"}, ""),               # a drawn target has no such setting
    (["method=neural_regression"], {"maps": 20}, ""),             # its weights know another number
    ([*PICTURE, "method.bytes=48"], {"maps": 8}, ""),             # refused beside a limit of bytes
    (["method=chaotic"], {}, None)])
def test_what_may_help_is_the_command_with_one_setting_changed(helps, words, change, line):
    assert helps(words, change) == ("in words" if line is None else line and f"fractal-train {line}")


def test_a_known_truth_decides_the_verdict(tmp_path, capsys):
    words = ["target=known", f"output={tmp_path}", "tracking=none", "evaluation.points_in_view=50000",
             *own_method(tmp_path, TRIANGLE)]
    train(*words, "target.name=sierpinski_triangle", "evaluation.resolution=64")
    assert "verdict    recovered: the true code\n" in capsys.readouterr().out
    assert Inversion.load(tmp_path / "fits" / "fit").verdict.kind == "recovered"
    train(*words, "target.name=koch_curve", "name=other", "evaluation.resolution=64")
    assert "verdict    not recovered; F1 " in capsys.readouterr().out


def test_another_code_of_the_true_attractor_is_told_from_the_true_one():
    assert finds_truth(TRIANGLE, TRIANGLE, OPTIONS) == (True, False)
    first = TRIANGLE.linear[:1] @ TRIANGLE.linear  # the first map, then each: they draw what the first one does
    offset = TRIANGLE.offset @ TRIANGLE.linear[0].T + TRIANGLE.offset[:1]
    split = IFS(first.new_tensor([*first.tolist(), *TRIANGLE.linear[1:].tolist()]),
                offset.new_tensor([*offset.tolist(), *TRIANGLE.offset[1:].tolist()]))
    assert finds_truth(split, TRIANGLE, OPTIONS) == (False, True)
    assert finds_truth(attractor.normalize(codes.known("fern")), TRIANGLE, OPTIONS) == (False, False)


def test_make_is_named_only_in_a_clone_of_the_project(folder):
    plain = f"python -m fractal_exp.tracking dashboard {folder}/outputs"
    assert dashboard_line("outputs") == plain
    (folder / "Makefile").write_text("dashboard:\n\techo another project\n")
    assert dashboard_line("outputs") == plain
    (folder / "Makefile").write_text("dashboard:\n\tpython -m fractal_exp.tracking dashboard outputs\n")
    assert dashboard_line("outputs") == "make dashboard" and dashboard_line("my runs").endswith("/my runs'")
