"""fractal-measure from codes and pictures to a table and to JSON."""

import json

import pytest
from commands import refusal

from fractal_exp import IFS, codes, suite
from fractal_exp.cli import measure
from fractal_exp.ifs import formats
from fractal_exp.images.pixels import write_image


def test_a_code_of_several_and_a_picture_are_measured_beside_each_other(folder, capsys):
    formats.save([codes.known("cantor_dust"), codes.known("koch_curve")], folder / "two.ifs")
    write_image("koch.png", suite.target(codes.known("koch_curve"), 256))
    measure.main(["two.ifs:koch_curve", "koch.png"])
    code, picture = capsys.readouterr().out.split("koch.png: 256×256 px\n")
    lines = dict(line.strip().split(maxsplit=1) for line in code.splitlines())
    assert lines["two.ifs:koch_curve:"] == "4 maps"
    assert all(lines[kind].startswith("1.2619, exact") for kind in ("similarity", "information", "correlation"))
    assert "do not overlap" in lines["similarity"] and lines["boxes"].startswith("1.2") and "px" in lines["lacunarity"]
    assert [line.split()[0] for line in picture.splitlines()] == ["boxes", "lacunarity"]


def test_json_has_a_line_for_each_with_all_digits(tmp_path, capsys):
    write_image(tmp_path / "gasket.png", suite.target(codes.known("sierpinski_triangle"), 128))
    measure.main([str(tmp_path / "gasket.png"), str(tmp_path / "gasket.png"), "--json", "--threshold", "0.1"])
    first, second = (json.loads(line) for line in capsys.readouterr().out.splitlines())
    assert first == second and first["of"] == "128×128 px"
    [boxes] = first["dimensions"]
    assert boxes["kind"] == "boxes" and boxes["low"] < 1.585 < boxes["high"] and "standard error" in boxes["condition"]
    assert [int(size) for size in first["lacunarity"]][0] == 2 and min(first["lacunarity"].values()) > 1


@pytest.mark.parametrize(("words", "message"), [
    (["nothing.png"], "'nothing.png' is no file"), (["koch_curv"], "did you mean 'koch_curve'?"),
    (["dark.png"], "dark.png"),
    (["code.json", "--invert", "true"], "--invert is for pictures, and none is given; leave it out"),
    (["dark.png", "--order", "abecdf"], "--order is for files of codes"),
    (["code.json", "--theshold", "1"], "did you mean '--threshold' or"),
])
def test_what_cannot_be_measured_ends_in_one_line(words, message, folder):
    write_image("dark.png", suite.target(codes.known("fern"), 64) * 0)
    IFS.save(codes.known("koch_curve"), "code.json")
    told = refusal(measure, *words)
    assert told.startswith("fractal-measure: error: ") and message in told
