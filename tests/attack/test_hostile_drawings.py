"""Colours, films and folders that nobody should give: each ends in a drawing or in one printable line of error."""

import io
import json

import numpy as np
import pytest
from commands import refusal, run_here
from PIL import Image

from fractal_exp import IFS, InputError
from fractal_exp.cli import invert, render
from fractal_exp.colouring import fitted
from fractal_exp.images.painted import Painted
from fractal_exp.images.reading import read_target

CODE = {"format": "fractal-exp/ifs", "version": 1, "linear": [[[0.5, 0], [0, 0.5]]] * 2,
        "offset": [[0.1, 0], [-0.4, 0.2]], "colours": {"rgb": [[1, 0, 0], [0, 1, 0]], "blends": [0.5, 0.5]}}
NUMBERS = ["NaN", "1e400", "-1e400", "-1", "2", '"0.5"', "null", "[1]", "true", "9" * 400]


@pytest.fixture(autouse=True)
def here(folder):
    (folder / "code.json").write_text(json.dumps(CODE))


@pytest.mark.parametrize("place", ["[1, 0, 0]", "[0.5, 0.5]"])
@pytest.mark.parametrize("number", NUMBERS)
def test_colours_that_are_none_are_refused(place, number, tmp_path):
    text = json.dumps(CODE["colours"]).replace(place, place.replace(place[1:place.index(",")], number, 1))
    whole = json.dumps(CODE | {"colours": "?"}).replace('"?"', text)
    (tmp_path / "wrong.json").write_text(whole)
    with pytest.raises(InputError):
        IFS.load(tmp_path / "wrong.json")


def test_notes_about_colours_of_any_kind_do_not_hinder_a_drawing(tmp_path):
    for note in ("x", [], [1], [7, 0, 0], {"a": 1}, None, True, "\n", ["a", "b", "c"], [[1], 0, 0], float("nan")):
        (tmp_path / "noted.json").write_text(json.dumps(CODE | {"meta": {"ground": note, "background": note}}))
        errors = io.StringIO()
        status, _ = run_here(render, "noted.json", "a.png", "--size", "16", "--points", "100", errors=errors)
        assert status == 0 or status == 2 and errors.getvalue()[:-1].isprintable(), errors.getvalue()[:2000]
        assert (tmp_path / "a.png").exists() == (status == 0)
        (tmp_path / "a.png").unlink(missing_ok=True)


@pytest.mark.parametrize("alpha", ["none", "one pixel", "checks", "steps", "noise"])
def test_transparency_of_any_kind_is_read_or_refused(alpha, tmp_path):
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, 256, (32, 32, 4)).astype(np.uint8)
    pixels[..., 3] = {"none": 0, "one pixel": np.pad([[255]], (15, 16)), "steps": np.arange(32) * 8,
                      "noise": pixels[..., 3], "checks": 255 * (np.indices((32, 32)).sum(0) % 2)}[alpha]
    Image.fromarray(pixels).save(tmp_path / "picture.png")
    try:
        target = read_target(tmp_path / "picture.png", 32)
        painted = Painted.of(target)
        assert np.isfinite(painted.seen).all() and bool(target.image.isfinite().all())
        found = fitted(IFS.load(tmp_path / "code.json"), painted)
        assert found is None or 0 <= float(found.colours.rgb.min()) <= float(found.colours.rgb.max()) <= 1
    except InputError as error:
        assert str(error).isprintable()


FILM = ["code.json", "film.gif", "--size", 16, "--points", 100]


@pytest.mark.parametrize("words", [
    ["--seconds", "0"], ["--seconds", "nan"], ["--seconds", "inf"], ["--seconds", "-1"], ["--fps", "0"],
    ["--fps", "nan"], ["--fps", "1e9"], ["--zoom", "nan"], ["--zoom", "0"], ["--zoom", "inf"], ["--zoom", "1e400"],
    ["--start-zoom", "nan"], ["--start-zoom", "0"], ["--center", "nan", "0"], ["--center", "1e400", "0"],
    ["--size", "0"], ["--size", "99999999"], ["--points", "nan"], ["--points", "0"], ["--supersample", "100000"]])
def test_films_of_no_size_are_refused(words, tmp_path):
    length = [] if "--seconds" in words else ["--seconds", "0.1"]
    refusal(render, *FILM, *length, *words)
    assert [path.name for path in tmp_path.iterdir()] == ["code.json"]


@pytest.mark.parametrize("name", ["%04d%04d.png", "%99999999d.png", "code.json/%04d.png", "no/film.gif", "\0.gif"])
def test_films_of_no_file_are_refused(name, tmp_path):
    refusal(render, "code.json", name, *FILM[2:], "--seconds", "0.1")
    assert [path.name for path in tmp_path.iterdir()] == ["code.json"]


@pytest.mark.parametrize("name", ["code.json", "code.json/inner"])
def test_a_file_where_a_folder_should_be_is_told_before_the_picture_is_read(name):
    assert "code.json is a file; name a folder" in refusal(invert, "none.png", "--output", name)


def test_a_folder_that_may_not_be_written_to_is_told_before_the_picture_is_read(monkeypatch):
    monkeypatch.setattr("fractal_exp.cli.invert.os.access", lambda *_: False)  # as for root on a disk that is read-only
    assert "may not be written to" in refusal(invert, "none.png", "--output", "new/folder")
