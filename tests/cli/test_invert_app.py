"""fractal-invert from the command line to the files."""

import json
import re
import shlex

import numpy as np
import pytest
from commands import refusal
from drawings import leaf, write
from known import Known
from PIL import Image

from fractal_exp import IFS, Inversion, codes, render
from fractal_exp.cameras.camera import Camera
from fractal_exp.cli import invert as app
from fractal_exp.ifs import attractor
from fractal_exp.inversion.writing import SIDE
from fractal_exp.methods.base import CodeReconstruction, Progress
from fractal_exp.verdict import Verdict

TRIANGLE = attractor.normalize(codes.known("sierpinski_triangle"))
PEN = Camera("coverage", tile=0.0, pen=1 / 128, blur=1 / 256)


@pytest.fixture
def method(monkeypatch):
    """Let `invert` know the answer; the options that it was given."""
    given = {}

    def use(told=(TRIANGLE,), answer=TRIANGLE):
        def build(*, resolution: int, seed: int, seconds: float | None = None, maps: int | None = None,
                  search: dict | None = None, rounds: int | None = None):
            if not given:  # what may help is tried on the method too
                given.update(resolution=resolution, seed=seed, seconds=seconds, maps=maps, search=search, rounds=rounds)
            found = answer and CodeReconstruction(answer, "asked to", ("known beforehand",), PEN)
            return Known(found, [Progress(1, 0.5, {"error": 2.0}, stage="search", code=code, camera=PEN)
                                 for code in told])  # to estimate a camera takes longer than all else
        monkeypatch.setattr("fractal_exp.api.load", lambda name: build)
        return given
    return use


@pytest.fixture
def folder(tmp_path, monkeypatch, signals_are_heard):
    monkeypatch.chdir(tmp_path)
    shape = np.rint(255 * render(TRIANGLE, resolution=128, points_in_view=300_000).numpy()).astype(np.uint8)
    picture = write(Image.fromarray(255 - np.pad(shape, ((0, 30), (20, 20)))), "Sierpinski's gasket", 84, 140, 13)
    picture.save(tmp_path / "gasket.png")
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("rendering_side", [SIDE])
def test_colour_on_request(folder, method, capsys):
    method()
    red = np.asarray(Image.open("gasket.png").convert("L"))
    Image.fromarray(np.dstack([np.full_like(red, 255), red, red])).save("red.png")
    app.main(["red.png", "--colour"])
    assert "apart (CIEDE2000)" in capsys.readouterr().out
    code = IFS.load(folder / "red-fractal" / "code.json")
    assert code.colours is not None
    drawn = np.asarray(Image.open(folder / "red-fractal" / "rendering.png")).astype(int)
    assert drawn.shape == (1024, 1024, 3) and drawn[0, 0].tolist() == [255, 255, 255]
    assert (drawn[..., 0] - drawn[..., 1]).max() > 80 and np.abs(drawn[..., 1] - drawn[..., 2]).max() < 12


def test_an_interruption_while_colours_are_sought_keeps_the_code(folder, method, monkeypatch, capsys):
    def interrupted(*arguments):
        raise KeyboardInterrupt

    method()
    monkeypatch.setattr("fractal_exp.inversion.coloured", interrupted)
    with pytest.raises(SystemExit) as left:
        app.main(["gasket.png", "--colour"])
    assert left.value.code == 130 and "no colours: the work was interrupted" in capsys.readouterr().out
    assert len(IFS.load(folder / "gasket-fractal" / "code.json")) == 3


@pytest.mark.parametrize("rendering_side", [SIDE])
def test_a_picture_is_all_it_needs(folder, method, capsys):
    method()
    app.main(["gasket.png"])
    out = capsys.readouterr().out
    assert "text beside the shape was ignored" in out and "black shape on white: inverted" in out
    assert out.count("note       ") == 1 and "note       known beforehand" in out
    assert "  dimension  code 1.5850, exact (similarity); picture 1." in out
    assert "verdict    " in out and "50% search, error 2" in out and "F1 " in out and "asked to" in out
    written = {path.name for path in (folder / "gasket-fractal").iterdir()}
    assert written == {"code.json", "inversion.json", "target.png", "redrawn.png", "rendering.png", "overlay.png",
                       "code.html"}
    assert "searched for" not in out, "the method has no limit"
    assert len(IFS.load(folder / "gasket-fractal" / "code.json")) == 3
    assert Image.open(folder / "gasket-fractal" / "rendering.png").size == (1024, 1024)
    width, height = Image.open(folder / "gasket-fractal" / "overlay.png").size
    assert width == 168 and 158 < height < 200, "as wide as the picture, with a legend below"
    found = Inversion.load(folder / "gasket-fractal")
    assert found.verdict.words in out and found.stopped == "asked to"


def test_the_folder_is_not_overwritten_unless_forced(folder, method):
    method()
    (folder / "mine").mkdir()
    (folder / "mine" / "notes.txt").write_text("mine")
    told = refusal(app, "gasket.png", "--output", "mine")
    assert "mine holds something already; --force writes into it, --output names another folder" in told
    assert [path.name for path in (folder / "mine").iterdir()] == ["notes.txt"]
    app.main(["gasket.png", "--output", "mine", "--force"])
    assert (folder / "mine" / "code.json").exists() and (folder / "mine" / "notes.txt").exists()
    told = refusal(app, "gasket.png", "--output", "gasket.png")
    assert "gasket.png is a file; name a folder with --output" in told


def test_options_reach_the_method_and_the_reader(folder, method, capsys):
    given = method()
    app.main(["gasket.png", "--seconds", "9", "--maps", "3", "--seed", "7", "--resolution", "64", "--invert", "true",
              "--as-it-is", "--crop", "2", "0", "168", "150", "--set", "search.moves=10", "search.mixture=false",
              "rounds=2"])
    assert given == {"resolution": 64, "seed": 7, "seconds": 9.0, "maps": 3, "rounds": 2,
                     "search": {"moves": 10, "mixture": False}}
    out = capsys.readouterr().out
    assert "inverted, as asked" in out and "text beside" not in out
    assert "168×158 px" in out and "only the part of 166×150 px at (2, 0) is read, as asked" in out
    facts = json.loads((folder / "gasket-fractal" / "inversion.json").read_text())["meta"]["inversion"]
    assert facts["options"]["search"]["moves"] == 10
    reading = {"invert": True, "clean": False, "crop": [2, 0, 168, 150], "frame": "fit"}
    assert reading.items() <= facts["reading"].items()


@pytest.mark.parametrize("words, change, line", [
    (["gasket.png"], {"resolution": 387}, "gasket.png --resolution 387 --output gasket-fractal-2"),
    (["gasket.png", "--seconds=9", "--force"], {"seconds": 36.0}, "gasket.png --force --seconds 36"),
    (["--maps", "3", "gasket.png", "--output", "a b"], {"maps": 6}, "gasket.png --maps 6 --output 'a b-2'"),
    (["gasket.png"], {"invert": True}, "gasket.png --invert true --output gasket-fractal-2"),
    (["gasket.png"], {"rounds": 3}, "gasket.png --output gasket-fractal-2 --set rounds=3"),
    (["gasket.png"], {"at_most": 6}, None)])
def test_what_may_help_is_a_command_to_type(folder, method, capsys, monkeypatch, words, change, line):
    method()
    monkeypatch.setattr("fractal_exp.inversion.road.Verdict.of", lambda *given, **options: Verdict(
        "not recovered", "not recovered; F1 .20 within a pixel", "key=value: as one calls a function", change))
    app.main(words)
    out = capsys.readouterr().out
    assert "key=value" not in out and ("may help" in out) == (line is not None)
    if line is not None:
        assert f"  may help   fractal-invert {line}\n" in out
        app.main(shlex.split(line))


@pytest.mark.parametrize("words, message", [
    (["nowhere.png"], "cannot read the picture .*nowhere.png: No such file"),
    (["gasket.png", "--set", "moves"], "--set takes KEY=VALUE, such as search.moves=10, got 'moves'"),
    (["gasket.png", "--set", "rounds=2", "rounds.x=1"], "rounds has a value already, and is no component"),
    (["gasket.png", "--set", "moves.cont=3"], "there is no parameter moves.cont; did you mean 'count'"),
    (["gasket.png", "--set", "seed=3"], "--set seed=3: seed is no parameter of the method; use --seed"),
    (["gasket.png", "--set", "clean=false"], "clean is no parameter of the method; use --as-it-is"),
    (["gasket.png", "--set", "progress=true"], "progress is no parameter of the method$"),
    (["gasket.png", "--secnds", "9"], "unrecognized arguments: --secnds 9; did you mean '--seconds'?"),
    (["gasket.png", "moves.root=0"], "unrecognized arguments: moves.root=0; write --set moves.root=0"),
    (["gasket.png", "--crop", "0", "0", "169", "90"], r"crop must lie within \(0, 0, 168, 158\), the whole picture"),
    (["gasket.png", "--frame", "part"], "frame=\"part\" needs a shape that reaches a side"),
    (["gasket.png", "--seconds", "0"], "seconds must be above 0"),
    (["film.mp4"], "film.mp4 is a video; save one of its frames"),
])
def test_an_error_is_one_line_before_any_work(folder, words, message):
    (folder / "film.mp4").write_bytes(b"\0\0\0\x20ftypisom")
    error = refusal(app, *words)
    assert error.startswith("fractal-invert: error: ") and re.search(message, error)
    assert not (folder / "gasket-fractal").exists()


def test_an_interruption_writes_the_best_code_so_far_and_says_so(folder, method, capsys):
    method(answer=None)
    with pytest.raises(SystemExit) as left:
        app.main(["gasket.png"])
    printed = capsys.readouterr()
    assert left.value.code == 130 and "interrupted; the best code so far was written" in printed.err
    assert (folder / "gasket-fractal" / "code.json").exists() and "interrupted" in printed.out


def test_an_interruption_before_there_is_a_code_is_told_in_a_line(folder, method, capsys):
    method(told=(), answer=None)
    with pytest.raises(SystemExit) as left:
        app.main(["gasket.png"])
    error = capsys.readouterr().err
    assert left.value.code == 130
    assert error == "\nfractal-invert: interrupted before there was a code that could be written\n"
    assert not (folder / "gasket-fractal").exists()


def test_it_finds_a_code_itself(folder, capsys):
    leaf((0, 100, 0)).save("leaf.png")
    app.main(["leaf.png", "--resolution", "64", "--set", "rounds=1", "search.restarts=1", "search.moves=1",
              "search.detail_moves=1", "moves.count=1", "moves.drawn_count=1", "growth.enabled=false",
              "rounding.enabled=false", "camera.tiles=false", "camera.pen_px=1.0", "camera.blur_px=0.5",
              "moves.polish_starts=0", "moves.polish_ends=1",
              "refine.steps=30", "gauss_newton.rendered_steps=1", "gauss_newton.last_patience=1"])
    out = capsys.readouterr().out
    assert "verdict    " in out and "coloured: levels run" in out
    assert len(Inversion.load("leaf-fractal").code) >= 2
