"""Cameras, films and large files."""

import math
import subprocess

import numpy as np
import pytest
import torch
from imageio_ffmpeg import get_ffmpeg_exe
from PIL import Image

from fractal_exp import IFS, InputError, View, codes
from fractal_exp.ifs import attractor
from fractal_exp.rendering.film import write_film
from fractal_exp.rendering.png import PngWriter
from fractal_exp.rendering.sheets import comparison_strip, contact_sheet, difference
from fractal_exp.rendering.still import render_with_info
from fractal_exp.rendering.zoom import nearest_point, zoom_path
from fractal_exp.suite import random_suite

GASKET = IFS(torch.eye(2).expand(3, 2, 2) / 2, torch.tensor([[0.0, 0], [0.5, 0], [0, 0.5]]))


@pytest.mark.parametrize("code", [GASKET, codes.known("fern"), random_suite(1)[0]], ids=["gasket", "fern", "suite"])
def test_random_and_nearest_points_are_on_the_attractor(code):
    code = attractor.normalize(code)
    points = [attractor.random_point(code, seed) for seed in range(3)] + [nearest_point(code, (0.9, 0.2))]
    assert len(set(points)) == 4
    for point in points:
        assert not render_with_info(code, View(point, 1e9), resolution=8, points_in_view=100)[1].empty


def test_a_zoom_path_is_smooth_exponential_and_ends_at_the_target():
    target = (0.3, -0.4)
    views = zoom_path(target, 101, end_zoom=1e6)
    assert views[0] == View() and views[-1].zoom == pytest.approx(1e6)
    assert views[-1].center == pytest.approx(target, abs=1e-15)
    speed = np.diff(np.log([view.zoom for view in views]))
    assert (speed > 0).all() and np.ptp(speed[20:80]) < 1e-9 and speed[0] < speed[50] / 10
    assert np.abs(np.diff(speed)).max() < speed.max() / 10
    # The target is always in the picture, and moves over it slowly.
    on_screen = np.array([[(t - c) * view.zoom for t, c in zip(target, view.center, strict=True)] for view in views])
    assert np.abs(on_screen).max() <= 0.4 + 1e-9 and np.abs(np.diff(on_screen, axis=0)).max() < 0.03


@pytest.mark.parametrize(("arguments", "message"), [
    ({"frames": 1}, "at least 2 frames"), ({"frames": 5, "end_zoom": 0.5}, "end above"),
    ({"frames": 5, "end_zoom": 1e13}, "at most"), ({"frames": 5, "end_zoom": math.nan}, "end above"),
])
def test_paths_that_lead_nowhere(arguments, message):
    with pytest.raises(InputError, match=message):
        zoom_path((0, 0), **arguments)


@pytest.mark.parametrize("bits", [8, 16])
@pytest.mark.parametrize("transparent", [False, True])
def test_a_png_in_bands_reads_back(tmp_path, bits, transparent):
    image = np.random.default_rng(0).random((97, 23)).astype(np.float32)
    with PngWriter(tmp_path / "image.png", 23, 97, bits=bits, transparent=transparent) as file:
        for band in np.split(image, [5, 6, 80]):
            file.write(band)
    grey = np.asarray(Image.open(tmp_path / "image.png"))
    if transparent:  # which Pillow reads at 8 bits only
        decode = [get_ffmpeg_exe(), "-v", "error", "-i", tmp_path / "image.png", "-f", "rawvideo", "-pix_fmt",
                  {8: "ya8", 16: "ya16le"}[bits], "-"]
        raw = np.frombuffer(subprocess.run(decode, capture_output=True, check=True).stdout, f"<u{bits // 8}")
        white, grey = raw.reshape(97, 23, 2).transpose(2, 0, 1)
        assert (white == 2**bits - 1).all()
    assert grey.shape == (97, 23) and np.abs(grey / (2**bits - 1) - image).max() <= 0.51 / (2**bits - 1)
    assert sorted(tmp_path.iterdir()) == [tmp_path / "image.png"]


def test_a_png_that_breaks_off_leaves_no_file(tmp_path):
    with pytest.raises(RuntimeError), PngWriter(tmp_path / "image.png", 4, 4) as file:
        file.write(np.zeros((2, 4)))
        raise RuntimeError
    assert not list(tmp_path.iterdir())


def test_strips_and_sheets_show_what_they_are_given():
    truth, image = torch.zeros(2, 8, 8), torch.zeros(2, 8, 8)
    truth[0, 2, 3], image[0, 5, 6] = 1, 1
    colours = difference(image[0], truth[0])
    assert colours[2, 3].tolist() == [1, 0.55, 0.1] and colours[5, 6].tolist() == [0.2, 0.6, 1.0]
    assert colours.sum() == pytest.approx(1.65 + 1.8)
    strip = comparison_strip(image, truth, ["whole", "zoomed"], side=80)
    assert strip.dtype == np.uint8 and strip.shape[1] == 3 * 84 + 4
    lit = (strip == 255).all(-1)
    assert lit[4:84, 4:84].sum() == 100 and lit[4:84, 88:168].sum() == 100  # one pixel of 8² at 80²
    sheet = contact_sheet(list(truth), ["a", "b"], columns=2, side=40)
    assert sheet.shape[1] == 2 * 44 + 4


@pytest.mark.parametrize(("work", "message"), [
    (lambda folder: write_film(folder / "zoom.avi", []), ".mp4, .webm, .gif, or .png with"),
    (lambda folder: write_film(folder / "no" / "zoom.gif", []), "cannot write"),
    (lambda folder: write_film(folder / "zoom.gif", [], fps=100), "at most 50"),
    (lambda folder: PngWriter(folder / "image.jpg", 4, 4), r"\.png"),
    (lambda folder: PngWriter(folder / "image.png", 4, 4, bits=12), "8 or 16"),
    (lambda folder: PngWriter(folder / "no" / "image.png", 4, 4).__enter__(), "cannot write"),
    (lambda folder: contact_sheet([], []), "one caption"),
    (lambda folder: comparison_strip(torch.zeros(1, 4, 4), torch.zeros(1, 8, 8), ["a"]), "as many"),
])
def test_bad_input(tmp_path, work, message):
    with pytest.raises(InputError, match=message):
        work(tmp_path)
