"""Names with line breaks and control characters: of files, of codes in them, and of what they say of themselves."""

import json

import pytest
from commands import refusal

from fractal_exp import IFS
from fractal_exp.cli import convert
from fractal_exp.ifs import formats

NAMES = ["a\nb", "\ud800x", "\0", "<&'\"> --><b>", "x" * 5000, "{;}", "(3D)", "../../etc/passwd", "\x1b[31m", "", 3,
         None, ["a"], {"a": 1}]


@pytest.mark.parametrize("arguments", [
    ["no\nfile.json", "x.ifs"], ["no.json:a\nb", "x.ifs"], ["fern", "no\nfolder/x.ifs"], ["fern", "x.n\no"],
    ["fe\nrn", "x.ifs"], ["suite:\n1", "x.ifs"], ["fern", "x.ifs", "--to", "a\x1b[31mb"], ["\ud800.json", "x.ifs"],
])
def test_an_error_is_one_printable_line(arguments, folder):
    assert refusal(convert, *arguments).startswith("fractal-convert: error: ")


def test_a_written_file_is_named_in_one_printable_line(folder, capsys):
    convert.main(["fern", "a\n\x1b[31m.ifs"])
    told = capsys.readouterr().out
    assert told[:-1].isprintable() and told.endswith("a\\n\\x1b[31m.ifs (fractint, 4 maps)\n")
    assert (folder / "a\n\x1b[31m.ifs").exists()


@pytest.mark.parametrize("key", ["name", *(
    pytest.param(key, marks=pytest.mark.slow) for key in ("title", "comment", "source", "camera", "inversion"))])
def test_notes_of_any_kind_are_written_in_every_format(key, tmp_path):
    for name in NAMES:
        (tmp_path / "code.json").write_text(json.dumps({
            "format": "fractal-exp/ifs", "version": 1, "linear": [[[0.5, 0], [0, 0.5]]], "offset": [[0.1, 0]],
            "meta": {key: name}}))
        code = IFS.load(tmp_path / "code.json")
        for suffix in (".json", ".ifs", ".flame", ".svg"):
            path = formats.save([code], tmp_path / f"out{suffix}")
            if suffix != ".svg":
                assert IFS.load(path).linear.equal(code.linear)
