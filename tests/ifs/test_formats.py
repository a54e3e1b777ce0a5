"""Formats of codes: chosen by suffix, several codes a file, round trips, conversion, drawings and points."""

import itertools
import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import torch
from commands import refusal
from format_files import BROKEN_FLAMES, BROKEN_FRACTINT
from PIL import Image

from fractal_exp import IFS, Colours, InputError, codes, render
from fractal_exp.cli import convert
from fractal_exp.cli import render as render_app
from fractal_exp.cli.code_names import read_code
from fractal_exp.ifs import attractor, formats
from fractal_exp.ifs.formats import ply
from fractal_exp.suite import random_suite

CHROMIUM = Path("/usr/bin/chromium")
NASTY = "</text><script>alert('&\"')</script>\n\x00]]> \u202e é"
READ = ["json", "lists", "rows", "table", "fractint", "flame"]
BROKEN = [*(("flame", *each) for each in BROKEN_FLAMES), *(("ifs", *each) for each in BROKEN_FRACTINT)]


def half(x=0.0, y=0.0):
    return [[[0.5, 0.0], [0.0, 0.5]]], [[x, y]]


def same(a, b):
    return torch.equal(a.linear, b.linear) and torch.equal(a.offset, b.offset)


@pytest.mark.parametrize("key", READ)
@pytest.mark.parametrize("code", [codes.known("fern"), *random_suite(3)], ids=["fern", "0", "1", "2"])
def test_every_bit_of_the_maps_comes_back(tmp_path, key, code):
    suffix = (formats.FORMATS[key].suffixes or (".json",))[0]
    back = IFS.load(code.save(tmp_path / f"code{suffix}", format=key))
    assert same(back, code)
    if code.probabilities is not None or key in ("table", "fractint", "flame"):
        assert torch.equal(back.sampling_probabilities(), code.sampling_probabilities())
    else:
        assert back.probabilities is None


@pytest.mark.parametrize(("name", "format", "message"), [
    ("a.flamy", None, r"no format of codes ends in '.flamy'; did you mean '.flame'.*there are .json, .csv, .*.ifs"),
    ("a.png", None, "ends in '.png'"), ("a.json", "rowz", "no format is called 'rowz'; did you mean 'rows'"),
])
def test_an_unknown_format_is_refused_before_anything_is_written(tmp_path, name, format, message):
    with pytest.raises(InputError, match=message):
        codes.known("tree").save(tmp_path / name, format=format)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("case", json.loads((Path(__file__).parents[1] / "code_cases.json").read_text()),
                         ids=lambda case: case["text"][-40:])
def test_a_code_is_taken_or_refused_as_the_page_does(tmp_path, case):
    path = tmp_path / "code.json"
    path.write_text(case["text"])
    if case["accepted"]:
        code = IFS.load(path)
        assert IFS.load(code.save(path)) == code
    else:
        with pytest.raises(InputError):
            IFS.load(path)


@pytest.mark.parametrize("suffix", [".ifs", ".flame"])
def test_one_of_several_codes_is_asked_for_by_name_or_number(tmp_path, suffix):
    names = ["fern", "tree", "fern", "spiral"]
    path = formats.save([codes.known(name) for name in names], tmp_path / f"all{suffix}")
    asked = {".ifs": {"fern": 0, "tree": 1, "fern_2": 2, "#4": 3}, ".flame": {"tree": 1, "#3": 2, "spiral": 3}}[suffix]
    for name, index in asked.items():
        assert same(IFS.load(path, name), codes.known(names[index]))
        assert same(read_code(f"{path}:{name}"), codes.known(names[index]))
    with pytest.raises(InputError, match=r"holds 4 codes; choose one, as in IFS.load\(path, name\) or FILE:NAME: "
                                         "'fern', 'tree'"):
        IFS.load(path)
    with pytest.raises(InputError, match="no code called 'spirale'; did you mean 'spiral'"):
        IFS.load(path, "spirale")
    with pytest.raises(InputError, match="no code called '#5'"):
        IFS.load(path, "#5")
    if suffix == ".flame":
        with pytest.raises(InputError, match="2 codes are called 'fern'; choose by number: #1, #3"):
            IFS.load(path, "fern")


@pytest.mark.parametrize("suffix", [".ifs", ".flame", ".svg", ".ply"])
def test_a_name_is_text_and_nothing_else(tmp_path, suffix):
    code = IFS(*half(), meta={"name": NASTY, "title": NASTY, "comment": f"}} {NASTY}\n}}", "source": 3})
    path = code.save(tmp_path / f"code{suffix}")
    if suffix == ".ply":
        header = path.read_bytes().partition(b"end_header\n")[0].decode("ascii").splitlines()
        assert [line for line in header if not line.startswith(("ply", "format", "element", "property"))] == header[2:3]
        return
    assert "<script" not in path.read_text() or suffix == ".ifs"
    if suffix == ".svg":
        assert not [e for e in ElementTree.fromstring(path.read_bytes()).iter() if e.tag.endswith("script")]
    else:
        back = IFS.load(path)
        assert same(back, code) and "\n" not in back.meta["name"] and "\x00" not in back.meta["name"]
    if suffix == ".flame":
        assert "<script>alert('&\"')</script>" in back.meta["name"]  # kept, as text


def test_a_format_of_somebody_else_is_known_everywhere(tmp_path, monkeypatch):
    class Six(formats.CodeFormat):
        """One map a file, six numbers."""

        key, suffixes = "six", (".six",)

        def entries(self, data):
            return [formats.Entry(None, lambda: formats.code_of([[float(word) for word in data.split()]], None, {}))]

    monkeypatch.setattr(formats, "FORMATS", dict(formats.FORMATS))
    formats.register(Six())
    (tmp_path / "a.six").write_text(".5 0 0 .5 1 2")
    assert same(IFS.load(tmp_path / "a.six"), IFS(*half(1, 2))) and same(read_code(f"{tmp_path}/a.six"),
                                                                        IFS(*half(1, 2)))
    with pytest.raises(InputError, match="six files are read, not written"):
        IFS(*half()).save(tmp_path / "b.six")
    with pytest.raises(InputError, match="suffix '.six' is registered already"):
        formats.register(Six())


@pytest.mark.parametrize(("suffix", "text", "message"), BROKEN, ids=itertools.count())
def test_a_hostile_or_broken_file_is_refused_with_the_remedy(tmp_path, suffix, text, message):
    path = tmp_path / f"broken.{suffix}"
    path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        IFS.load(path)
    assert str(error.value).startswith(str(path)) and str(error.value).isprintable() and len(str(error.value)) < 1000


def test_fractal_convert_takes_codes_from_format_to_format(tmp_path, capsys):
    convert.main(["fern", "tree", str(tmp_path / "all.ifs")])
    assert "all.ifs (fractint, 4 maps, 4 maps)" in capsys.readouterr().out
    convert.main([f"{tmp_path / 'all.ifs'}:fern", str(tmp_path / "fern.flame")])
    convert.main([str(tmp_path / "fern.flame"), str(tmp_path / "rows.json"), "--to", "rows"])
    assert same(IFS.load(tmp_path / "rows.json"), codes.known("fern"))
    assert len(json.loads((tmp_path / "rows.json").read_text())[0]) == 7
    convert.main(["fern", str(tmp_path / "framed.json"), "--frame", "canvas"])
    assert same(IFS.load(tmp_path / "framed.json"), attractor.normalize(codes.known("fern")))
    render_app.main([str(tmp_path / "fern.flame"), str(tmp_path / "a.png"), "--size", "48"])
    render_app.main(["fern", str(tmp_path / "b.png"), "--size", "48"])
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


@pytest.mark.parametrize(("arguments", "message"), [
    (["fern", "tree", "a.json"], "a json file holds one code, got 2; .* holds several: .ifs, .flame"),
    (["fern", "a.xyz"], "no format of codes ends in '.xyz'"), (["nothing", "a.ifs"], "'nothing' is no file"),
])
def test_what_cannot_be_converted_is_said_in_a_line(folder, arguments, message):
    assert re.search(message, refusal(convert, *arguments)) and not list(folder.iterdir())


@pytest.mark.skipif(not CHROMIUM.exists(), reason=f"needs {CHROMIUM}")
def test_a_browser_draws_the_svg(tmp_path):
    code = attractor.normalize(codes.known("fern"))
    path = code.save(tmp_path / "fern.svg")
    subprocess.run([CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
                    f"--screenshot={tmp_path / 'drawn.png'}", "--window-size=768,768", "--hide-scrollbars",
                    path.as_uri()], check=True, capture_output=True, timeout=120)
    drawn = np.asarray(Image.open(tmp_path / "drawn.png").convert("RGB")).astype(float)
    assert drawn.shape == (768, 768, 3)
    dark = torch.from_numpy(drawn.max(-1) < 100)[None].float()
    shape = (render(code, resolution=768) > 0.9).float()[None]
    assert float((dark * shape).sum() / shape.sum()) > 0.9  # the shape, the right way up
    assert np.ptp(drawn, axis=-1).max() > 100               # and colours


def test_a_ply_holds_points_of_the_attractor_coloured_by_map(tmp_path):
    code = codes.known("sierpinski_triangle")
    header, _, data = code.save(tmp_path / "points.ply").read_bytes().partition(b"end_header\n")
    assert b"element vertex 200000\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red" in header
    points = np.frombuffer(data, ply.VERTEX)
    assert len(points) == 200_000 and not points["z"].any()
    colours, members = np.unique(points[["red", "green", "blue"]], return_inverse=True)
    assert len(colours) == 3
    for k in range(3):  # of a colour are the points of one corner
        x, y = (points[axis][members.ravel() == k] for axis in "xy")
        assert np.ptp(x) <= 0.5 + 1e-5 and np.ptp(y) <= 3 ** 0.5 / 4 + 1e-5 and 0.3 < len(x) / 200_000 < 0.36


def test_a_ply_holds_points_in_the_codes_own_colours(tmp_path):
    code = replace(attractor.normalize(codes.known("fern")), colours=Colours(
        [[0.9, 0.2, 0.1], [0.1, 0.7, 0.2], [0.2, 0.3, 0.9], [0.8, 0.8, 0.1]], [0.9, 0.15, 0.5, 0.7]))
    _, _, data = code.save(tmp_path / "points.ply").read_bytes().partition(b"end_header\n")
    points = np.frombuffer(data, ply.VERTEX)
    image = render(code, resolution=32, mode="colour").numpy()
    row, column = ((np.stack([1 - points["y"], 1 + points["x"]]) * 16).astype(int))
    for channel, name in enumerate(("red", "green", "blue")):
        sums = np.zeros((32, 32))
        np.add.at(sums, (row, column), points[name] / 255)
        counts = np.zeros((32, 32))
        np.add.at(counts, (row, column), 1)
        many = counts > 500
        assert many.sum() > 50
        assert np.abs(sums[many] / counts[many] - image[many][:, channel]).mean() < 0.01
        assert np.ptp(image[many][:, channel]) > 0.3
