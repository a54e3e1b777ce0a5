"""Fits of pictures from elsewhere: their lines, going on where a run ended, tables, sheets and the command line."""

import json
from concurrent.futures import Executor, Future

import numpy as np
import pytest
import torch

from benchmarks import archive
from benchmarks.pictures import __main__ as command
from benchmarks.pictures import fitting, judging, report
from benchmarks.pictures.sets import SETS
from fractal_exp import IFS, codes, render
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import read_target
from fractal_exp.rendering.tone import Tone, own_tone, with_tone

SETTING = fitting.Setting(0.2, "wall", {"rounds": 1, "resolution": 64})


def line(name: str, **changes) -> dict:
    code = IFS(torch.eye(2).expand(2, 2, 2) / 2, torch.tensor([[-0.25, 0.0], [0.25, 0]]))
    scores = SETS["textbook"].score(name, code, read_target(SETS["textbook"].picture(name), 64))
    return {"set": "textbook", "picture": name, "role": SETS["textbook"].roles()[name], "limit": 0.2, "clock": "wall",
            "options": {"resolution": 64}, "commit": "0123456789", "machine": "a machine", "maps": 2, **scores,
            "core_seconds": 1.0, "wall_seconds": 2.0, "code": archive.plain(code)} | changes


def test_a_fit_is_a_line_with_code_scores_and_circumstances():
    found = fitting.fit("textbook", "gasket-4-black", SETTING)
    assert found["picture"] == "gasket-4-black" and found["role"] == "tuning" and found["limit"] == 0.2
    assert {"iou", "f1_input", "recovered", "core_seconds", "wall_seconds", "commit", "machine"} <= set(found)
    assert found["maps"] == len(fitting.code_of(found))
    assert json.loads(json.dumps(found)) == found


def test_a_fit_from_the_truth_refines_the_true_code_and_searches_nothing(tmp_path):
    setting = fitting.Setting(None, "wall", {"resolution": 64, "moves": {"drawn_count": 0}}, from_truth=True)
    found = fitting.fit("textbook", "gasket-8-red", setting)
    assert found["recovered"] and found["maps"] == 3 and found["from_truth"]
    assert fitting.run("textbook", ["pythagoras-4-green"], setting, tmp_path, 1) == 0
    assert "no true code" in fitting.fit("textbook", "pythagoras-4-green", setting)["error"]


def test_what_is_there_is_not_fitted_again(tmp_path):
    for each in (line("gasket-4-black"), line("gasket-6-green", error="InputError: no")):
        fitting.archive.append_line(tmp_path / fitting.FILE, each)
    fitted = []

    class Here(Executor):
        """A pool that works in this process."""

        def __init__(self, *arguments):
            pass

        def submit(self, function, kind, name, setting):
            fitted.append(name)
            job = Future()
            job.set_result(line(name, limit=setting.limit, options=dict(setting.options)))
            return job

    def count(names, limit=0.2):
        return fitting.run("textbook", names, fitting.Setting(limit, "wall", {"resolution": 64}), tmp_path, 2, Here)

    names = ["gasket-4-black", "gasket-6-green"]
    assert count(names) == 1 and fitted == ["gasket-6-green"], "after an error"
    assert count(names) == 0
    assert count(names[:1], limit=5) == 1
    assert len(fitting.read(tmp_path)) == 3 and not any("error" in each for each in fitting.read(tmp_path))


def test_the_report_has_tables_and_sheets(tmp_path):
    for each in (line("gasket-4-black"), line("carpet-4-blue"), line("fern_dots-green"),
                 line("koch_curve-3-blue", limit=None, error="InputError: broken")):
        fitting.archive.append_line(tmp_path / fitting.FILE, each)
    text = report.write("textbook", tmp_path)
    assert text == (tmp_path / "report.md").read_text()
    assert "| gasket | 4 | 1 |" in text and "Pictures: reporting" in text and "0.2 s by the wall clock" in text
    assert "- koch_curve-3-blue: InputError: broken" in text and "no limit" in text
    assert [path.name for path in tmp_path.glob("*.png")] == ["sheet_00.png"]
    with pytest.raises(SystemExit, match="no fits"):
        report.write("textbook", tmp_path / "other")


def test_the_command_draws_what_it_names(tmp_path):
    command.main(["textbook", "--tuning", "--names", "gasket-[46]*", "carpet*", "--draw", str(tmp_path)])
    assert {path.stem for path in tmp_path.iterdir()} == {"gasket-4-black", "gasket-6-green"}
    assert np.array_equal(read_target(tmp_path / "gasket-4-black.png", 64).image,
                          read_target(SETS["textbook"].picture("gasket-4-black"), 64).image)
    with pytest.raises(SystemExit, match="no picture"):
        command.main(["textbook", "--names", "nothing", "--draw", str(tmp_path)])


def test_codes_that_are_there_are_judged_again(tmp_path):
    first = line("gasket-4-black")
    fitting.archive.append_line(tmp_path / fitting.FILE, first | {"iou": 0.0, "recovered": None, "maps": 3})
    fitting.archive.append_line(tmp_path / fitting.FILE, {"set": "textbook", "picture": "gasket-6-green", "limit": 0.2,
                                                  "clock": "wall", "options": {}, "error": "it was killed"})
    fitting.judge("textbook", tmp_path)
    again, failed = fitting.read(tmp_path)
    assert again["iou"] == pytest.approx(first["iou"]) and again["recovered"] == first["recovered"]
    assert again["verdict"]["kind"] != "recovered" and again["likeness"] < .9, "two maps on a line"
    assert failed["error"] == "it was killed"


def test_light_and_dark_are_those_of_a_still_with_the_codes_tone():
    """By area, a fern is as light where it is faint as elsewhere. With the tone of a grey picture, it is not."""
    fern = attractor.normalize(codes.known("fern"))
    picture = render(with_tone(fern, Tone(light=0.1)), resolution=96, mode="tone")
    with_its_tone, without = (judging.light_and_dark(code, picture.numpy())
                              for code in (with_tone(fern, Tone(light=0.1)), fern))
    assert with_its_tone["f1_light"] > 0.99 > without["f1_light"]


def test_a_line_keeps_the_tone_of_its_code():
    fern = attractor.normalize(codes.known("fern"))
    assert own_tone(fitting.code_of({"code": archive.plain(fern), "tone": {"light": 0.2}})) == Tone(0.2)
    assert own_tone(fitting.code_of({"code": archive.plain(fern)})) is None
