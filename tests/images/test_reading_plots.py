"""Plots: what stands in them beside the shape is left out, empty axes are refused, and no shape is taken for a plot."""

import io
from pathlib import Path

import numpy as np
import plots
import pytest
import torch
from drawings import alike
from PIL import Image, ImageDraw

from fractal_exp import InputError
from fractal_exp.images.reading import read_target
from fractal_exp.methods.base import check_target

QUICK = ("leaf of four colours", "density in inferno", "by Pillow")


def read(drawn, folder: Path):
    if not isinstance(drawn, io.BytesIO):
        return read_target(drawn, 256)
    path = folder / "plot.jpeg"
    path.write_bytes(drawn.getvalue())
    return read_target(path, 256)


@pytest.mark.parametrize("name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow)
                                  for name in plots.SET])
def test_a_plot_gives_the_target_of_its_shape_alone(name, tmp_path):
    plot = plots.SET[name]
    found, alone = (read(plots.draw(plot, plain), tmp_path) for plain in (False, True))
    assert alike(found.image, alone.image, 0.1 if plot.format == "jpeg" else 0.02) >= 0.98, found.notes
    several = any("2 plots in one picture" in warning for warning in found.warnings)
    assert several == ("second" in plot.beside)


@pytest.mark.parametrize("beside", ["", "grid title"])
def test_empty_axes_are_refused(beside):
    empty = plots.draw(plots.Plot("fern", "dots", beside, count=0))
    with pytest.raises(InputError, match="the image is a plot with empty axes: .*plot the points before you save"):
        read_target(empty, 64)


def test_a_grid_alone_is_a_shape():
    picture = Image.new("L", (300, 300), 255)
    for place in range(15, 300, 30):
        ImageDraw.Draw(picture).line((place, 0, place, 299), 0)
        ImageDraw.Draw(picture).line((0, place, 299, place), 0)
    assert not any("ignored" in note for note in read_target(np.asarray(picture), 64).notes)


def test_a_shape_that_fills_its_axes_is_told():
    """Its rim is along the axes, where the ground is in other plots."""
    found = read_target(plots.draw(plots.SET["black carpet that fills its axes"]), 256)
    assert any("that along the axes was taken; invert=false" in warning for warning in found.warnings)


def test_a_ground_that_may_be_the_shape_is_told():
    """A black carpet in axes on white paper might also be white squares on a black ground."""
    carpet = np.kron(np.array([[0, 0, 0], [0, 255, 0], [0, 0, 0]]), np.ones((90, 90)))
    picture = Image.new("L", (420, 380), 255)
    picture.paste(Image.fromarray(carpet.astype(np.uint8)), (90, 40))
    for place in range(60, 300, 50):
        for text, x, y in ((str(place), 55, place), (str(place), place + 40, 318)):
            ImageDraw.Draw(picture).text((x, y), text, 0)
    square, whole = read_target(np.asarray(picture), 64), read_target(np.asarray(picture), 64, invert=True)
    assert any("invert=true takes it the other way" in warning for warning in square.warnings)
    assert square.image[32, 32] == 1 and square.image[32, 10] == 1
    assert whole.image[32, 32] == 0 and whole.image[32, 10] == 1


@pytest.mark.parametrize("low, high, remedy", [
    (-1, 1, r"of numbers in \[-1, 1\], take \(x \+ 1\) / 2"), (0, 255, "divide it by its white level"),
    (-3, 9, "subtract its minimum first")])
def test_the_remedy_fits_the_range(low, high, remedy):
    picture = np.linspace(low, high, 32 * 32).reshape(32, 32)
    for use in (lambda: read_target(picture, 64), lambda: check_target(torch.from_numpy(picture))):
        with pytest.raises(InputError, match=remedy):
            use()
