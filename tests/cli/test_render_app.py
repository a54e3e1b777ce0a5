"""fractal-render and fractal-suite from the command line to the files."""

import contextlib
import fcntl
import json
import os
import pty
import re
import struct
import sys
import termios
from dataclasses import replace

import imageio.v3 as iio
import numpy as np
import pytest
import torch
from commands import refusal
from PIL import Image

from fractal_exp import IFS, Colours, View, codes, render
from fractal_exp.cli import render as render_app
from fractal_exp.cli import suite as suite_app
from fractal_exp.ifs import attractor
from fractal_exp.rendering import still as rendering
from fractal_exp.suite import random_suite, target


def pixels(path) -> np.ndarray:
    return np.asarray(Image.open(path))


def test_a_still_is_what_render_draws(tmp_path, capsys):
    fern = attractor.normalize(codes.known("fern"))
    fern.save(tmp_path / "leaf.json")
    out = tmp_path / "leaf.png"
    render_app.main([str(tmp_path / "leaf.json"), str(out), "--size", "96", "--points", "1e5", "--frame", "own",
                     "--center", "0.1", "-0.2", "--zoom", "4", "--bits", "16", "--supersample", "4", "--seed", "3"])
    expected = render(fern, View((0.1, -0.2), 4), resolution=96, points_in_view=100_000, supersample=4, seed=3)
    np.testing.assert_allclose(pixels(out) / 65535, expected.numpy(), atol=1e-5)
    assert str(out) in capsys.readouterr().out


@pytest.mark.parametrize(("size", "shape"), [("96x64", (64, 96)), ("40X120", (120, 40))])
def test_a_still_that_is_not_square(tmp_path, size, shape):
    fern = attractor.normalize(codes.known("fern"))
    render_app.main(["fern", str(tmp_path / "a.png"), "--size", size, "--points", "1e5", "--zoom", "1.5"])
    expected = render(fern, View(zoom=1.5), resolution=shape, points_in_view=100_000)
    np.testing.assert_allclose(pixels(tmp_path / "a.png") / 255, expected.numpy(), atol=1 / 255)


def test_transparent_and_density_stills(tmp_path):
    render_app.main(["fern", str(tmp_path / "a.png"), "--size", "64", "--transparent"])
    image = pixels(tmp_path / "a.png")
    assert image.shape == (64, 64, 2) and (image[..., 0] == 255).all() and image[..., 1].max() > 100
    render_app.main(["suite:3", str(tmp_path / "b.png"), "--size", "64", "--mode", "density"])
    assert 0 < (pixels(tmp_path / "b.png") > 0).mean() < 0.9


def test_a_film_that_is_not_square(tmp_path):
    out = tmp_path / "zoom.mp4"
    render_app.main(["sierpinski_triangle", str(out), "--size", "96x64", "--points", "2e4", "--seconds", "0.5", "--fps",
                     "10", "--zoom", "1e4", "--center", "0.2", "0.1"])
    film = iio.imread(out)
    assert film.shape == (5, 64, 96, 3) and (film.reshape(5, -1).mean(1) > 3).all()


def test_a_morph_through_three_codes_and_back(tmp_path, capsys):
    pattern = tmp_path / "m-%03d.png"
    render_app.main(["sierpinski_triangle", "koch_curve", "--loop", "fern", str(pattern), "--size", "63", "--points",
                     "1e5", "--seconds", "1.2", "--fps", "20"])
    told = capsys.readouterr().out
    assert "24 frames, 1.2 s of film, about" in told and "to draw" in told and str(pattern) in told
    files = sorted(tmp_path.iterdir())
    assert [file.name for file in files] == [f"m-{number:03d}.png" for number in range(1, 25)]
    drawn = [pixels(file) / 255 for file in files]
    assert all(picture.shape == (63, 63) for picture in drawn)
    for place, name in ((0, "sierpinski_triangle"), (8, "koch_curve"), (16, "fern")):
        known = render(attractor.normalize(codes.known(name)), resolution=63, points_in_view=100_000).numpy()
        assert 2 * (drawn[place] * known).sum() / (drawn[place]**2 + known**2).sum() > 0.8, name


@pytest.mark.parametrize(("arguments", "message"), [
    (["ferm", "a.png"], "did you mean 'fern'? give"),
    (["no.json", "a.png"], "cannot read the code"),
    (["suite:x", "a.png"], "suite:INDEX"),
    (["fern", "a.jpg"], "end the name in .png"),
    (["fern", "no/such/a.png"], "cannot write"),
    (["fern", "a.png", "--zoom", "0"], "zoom must be a finite number above 0"),
    (["fern", "a.png", "--size", "64x20000"], "from 1 to 16384"),
    (["fern", "a.png", "--size", "64x"], "such as 1024, or 1920x1080 (width x height), got '64x'"),
    (["fern", "a.mp4", "--size", "64x63"], "even number of pixels a side as .mp4, got 64×63"),
    (["fern", "a.png", "--points", "nan"], "--points"),
    (["fern", "a.mp4", "--transparent"], "stills"),
    (["fern", "a.mp4", "--seconds", "0"], "at least 2 frames"),
    (["fern", "a.mp4", "--zoom", "0.5"], "must end above"),
    (["fern", "tree", "a.mp4", "--seconds", "0.1", "--loop", "--fps", "20"], "has at least 4 frames, got 2"),
    (["fern", "%d.png", "--seconds", "1"], "%d has too few digits for 30 frames; write %02d"),
    (["fern", "%d-%d.png"], "stands once in a name"),
    (["fern", "a.webm", "--size", "63"], "even"),
    (["fern", "tree", "a.gif", "--fps", "60"], "a GIF at most 50"),
    (["fern", "a.png", "--mode", "colour"], "the code has no colours to draw"),
    (["fern", "a.png", "--background", "white"], "--background changes nothing with --mode occupancy"),
    (["fern", "a.png", "--fps", "30"], "--fps is for films; a.png is a still"),
    (["fern", "a.png", "--seconds", "12"], "--seconds is for films"),
    (["fern", "a.png", "--loop"], "--loop is for films; a.png is a still"),
    (["fern", "a.mp4", "--loop"], "--loop returns to the first of several codes"),
    (["fern", "tree", "a.mp4", "--zoom", "9"], "--zoom is for a zoom into one code, not for a morph"),
    (["fern", "tree", "a.mp4", "--center", "0", "0"], "--center is for a zoom into one code"),
    (["fern", "tree", "a.mp4", "--seed", "2"], "--seed is for a zoom into one code"),
    (["fern", "tree", "a.mp4", "--frame", "own"], "--frame own would leave the codes where they are"),
    (["fern", "tree", "a.png"], "2 codes make a film, which is .mp4, .webm, .gif, or .png with %04d"),
    (["fern", "a.mp4", "--bits", "8"], "--bits is for stills; a.mp4 is a film"),
    (["fern", "a.png", "--mode", "density", "--supersample", "8"], "--supersample changes nothing with --mode density"),
    (["fern", "a.mp4", "--center", "0", "0", "--seed", "3"], "--seed chooses a film's target, which --center names"),
])
def test_what_a_user_can_mend_is_one_line(folder, arguments, message):
    assert message in refusal(render_app, *arguments) and not list(folder.iterdir())


def test_a_picture_in_place_of_a_code_points_to_the_command_that_finds_its_code(folder):
    Image.new("L", (40, 40)).save("my birch.png")
    told = refusal(render_app, "my birch.png", "x.png")
    assert "is a picture, and a code is asked for; fractal-invert 'my birch.png' finds one" in told


def test_a_suite_in_files(tmp_path):
    suite_app.main([str(tmp_path / "suite"), "--count", "3", "--resolution", "32", "--seed", "5"])
    folder = tmp_path / "suite"
    code = random_suite(3, 5)[2]
    saved = IFS.load(folder / "codes" / "002.json")
    assert torch.equal(saved.linear, code.linear) and torch.equal(saved.offset, attractor.normalize(code).offset)
    assert saved.meta["suite_index"] == 2
    np.testing.assert_allclose(pixels(folder / "targets" / "002.png") / 65535, target(code, 32).numpy(), atol=1e-5)
    assert json.loads((folder / "suite.json").read_text()) == {"count": 3, "seed": 5, "resolution": 32, "kind": "grey"}
    assert pixels(folder / "sheet.png").max() > 100
    suite_app.main([str(tmp_path / "binary"), "--count", "1", "--resolution", "32", "--binary"])
    assert set(np.unique(pixels(tmp_path / "binary" / "targets" / "000.png"))) == {0, 255}


def test_an_empty_view_names_the_nearest_point(tmp_path, capsys):
    for center, empty in ((("0.9", "0.9"), True), (("0", "0"), False)):
        render_app.main(["sierpinski_triangle", str(tmp_path / "a.png"), "--size", "32", "--points", "1e4",
                         "--center", *center, "--zoom", "8" if empty else "1"])
        told = capsys.readouterr().err
        assert ("nearest to its centre is at --center" in told) == empty
        if empty:
            point = tuple(float(word) for word in told.split("--center ")[1].split())
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    assert render(code, View(point, 50), resolution=32, points_in_view=1000).max() > 0


def coloured_triangle(path) -> IFS:
    triangle = codes.known("sierpinski_triangle")
    code = IFS(triangle.linear, triangle.offset, colours=Colours([[1, 0, 0], [0, 1, 0], [0, 0, 1]], [1.0, 1.0, 1.0]))
    code.save(path)
    return code


@pytest.mark.parametrize("name", ["code.png", "code-%d.png"])
def test_colours_stand_on_the_ground_that_the_code_names(tmp_path, name):
    code = coloured_triangle(tmp_path / "code.json")
    replace(code, meta={"ground": "#fff8e7"}).save(tmp_path / "code.json")
    draw = ["--size", "48", "--points", "1e4", *(["--seconds", "0.1", "--zoom", "1.01"] if "%" in name else [])]
    render_app.main([str(tmp_path / "code.json"), str(tmp_path / name), *draw])
    for file in tmp_path.glob("*.png"):
        assert tuple(pixels(file)[0, 0]) == (0xff, 0xf8, 0xe7)
    render_app.main([str(tmp_path / "code.json"), str(tmp_path / name), *draw, "--background", "black"])
    for file in tmp_path.glob("*.png"):
        assert not pixels(file)[0, 0].any()


@pytest.mark.parametrize("size", [pytest.param((0, 0), id="unknown"),
                                  pytest.param((24, 40), id="known", marks=pytest.mark.slow)])
def test_a_film_counts_its_frames_on_any_terminal(tmp_path, size):
    """An interruption is answered soon, and leaves nothing of a film of one file."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.execv(sys.executable, [sys.executable, "-m", "fractal_exp.cli", "render", "fern", str(tmp_path / "a.mp4"),
                                  "--size", "64", "--points", "1e4", "--seconds", "1000", "--center", "0.3", "0.7"])
    fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", *size, 0, 0))
    told = b""
    while not re.search(rb"\D[1-9]\d*/30000 \[", told):
        told += os.read(terminal, 4096)
    assert list(tmp_path.iterdir())
    os.write(terminal, b"\x03")
    with contextlib.suppress(OSError):  # when the command has ended
        while some := os.read(terminal, 4096):
            told += some
    os.close(terminal)
    assert b"fractal-render: interrupted" in told
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 130
    assert not list(tmp_path.iterdir())


def test_a_code_with_colours_is_drawn_in_colour(tmp_path, monkeypatch):
    monkeypatch.setattr(rendering, "COLOUR_TILE", 40)
    coloured_triangle(tmp_path / "code.json")
    draw = ["--size", "96", "--points", "2e5", "--supersample", "4"]
    for name, more in {"black": [], "white": ["--background", "white"], "clear": ["--transparent"],
                       "fine": ["--bits", "16"], "plain": ["--mode", "occupancy"]}.items():
        render_app.main([str(tmp_path / "code.json"), str(tmp_path / f"{name}.png"), *draw, *more])
    black, white, clear = (pixels(tmp_path / f"{name}.png").astype(int) for name in ("black", "white", "clear"))
    assert black.shape == (96, 96, 3) and clear.shape == (96, 96, 4) and pixels(tmp_path / "plain.png").ndim == 2
    cover, shade = clear[..., 3:] / 255, clear[..., :3]
    assert np.abs(black - cover * shade).max() <= 1 and np.abs(white - (cover * shade + 255 * (1 - cover))).max() <= 1
    # Each corner is one map's alone: red below on the left, green on the right, blue on top.
    for channel, part in enumerate((black[60:, :40], black[60:, 56:], black[:40])):
        assert part[..., channel].max() > 200 and np.delete(part, channel, -1).max() == 0
    assert (tmp_path / "fine.png").read_bytes()[24] == 16


def test_a_film_in_colour(tmp_path):
    coloured_triangle(tmp_path / "code.json")
    render_app.main([str(tmp_path / "code.json"), str(tmp_path / "zoom.gif"), "--size", "64", "--points", "2e4",
                     "--seconds", "0.5", "--fps", "10", "--zoom", "100", "--center", "0.2", "0.1", "--background",
                     "#ffffff"])
    first = iio.imread(tmp_path / "zoom.gif")[0].astype(int)
    assert first[0, 0].min() > 240 and np.ptp(first, axis=-1).max() > 100
