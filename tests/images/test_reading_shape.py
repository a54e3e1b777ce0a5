"""The one shape of a picture: what is left out beside it, and that no part of a fractal is."""

import numpy as np
import pytest
import torch
from drawings import fern_plot, koch, star, write
from PIL import Image, ImageDraw

from fractal_exp import InputError, suite
from fractal_exp.images.reading import read_target

CANTOR = np.kron([1, 0, 1, 0, 0, 0, 1, 0, 1], np.ones(30))  # twice the middle third left out


def assert_alike(found, expected, share=0.02):
    """Images that differ by little of what is lit."""
    difference = float((found - expected).abs().sum() / expected.sum())
    assert difference <= share, f"the images differ by {difference:.3g} of what is lit, at most {share} may"


def carpet(depth):
    whole = np.ones((1, 1))
    for _ in range(depth):
        whole = np.block([[whole, whole, whole], [whole, 0 * whole, whole], [whole, whole, whole]])
    return np.pad(np.kron(whole, np.ones((243 // 3**depth,) * 2)), 20)


def dust(depth):
    line = np.ones(1)
    for _ in range(depth):
        line = np.concatenate([line, 0 * line, line])
    return np.pad(np.kron(np.outer(line, line), np.ones((243 // 3**depth,) * 2)), 20)


def bars(depth):
    picture, line = np.zeros((30 * depth + 60, 800)), np.ones(1)
    for row in range(depth + 1):
        picture[30 + 30 * row:42 + 30 * row, 30:759] = np.kron(line, np.ones(729 // 3**row))
        line = np.concatenate([line, 0 * line, line])
    return picture


def right_triangle(size=256):
    y, x = np.mgrid[:size, :size]
    return np.pad(((x & (size - 1 - y)) == 0).astype(float), 16)


CLASSICS = {
    **{f"carpet {depth}": carpet(depth) for depth in (1, 2, 3, 4)},
    **{f"dust {depth}": dust(depth) for depth in (1, 2, 3, 4)},
    **{f"bars {depth}": bars(depth) for depth in (1, 2, 4)},
    "row": np.pad(np.tile(CANTOR, (12, 1)), 40),
    "right triangle": right_triangle(),
    "curve": 1 - np.asarray(koch().convert("L")) / 255,
}


@pytest.mark.parametrize("name", CLASSICS)
def test_a_textbook_fractal_comes_through_unchanged(name):
    picture = CLASSICS[name]
    for pixels in (picture, np.rint(255 * (1 - picture)).astype(np.uint8)):
        assert torch.equal(read_target(pixels, 128).image, read_target(pixels, 128, clean=False).image)


@pytest.mark.parametrize("kind", ["grey", "binary"])
@pytest.mark.parametrize("seed", [2025, pytest.param(31, marks=pytest.mark.slow)])
def test_a_random_fractal_comes_through_unchanged(kind, seed):
    for code in suite.random_suite(12, seed):
        drawn = suite.target(code, 192, kind).numpy()
        for pixels in (drawn, 255 - np.rint(255 * drawn).astype(np.uint8)):
            assert torch.equal(read_target(pixels, 128).image, read_target(pixels, 128, clean=False).image), code


@pytest.mark.parametrize("options", [{}, {"box": False}], ids=str)
def test_the_axes_of_a_plot_are_ignored(options):
    alone, framed = read_target(fern_plot(axes=False), 128), read_target(fern_plot(**options), 128)
    assert_alike(framed.image, alone.image, 0.05)
    assert "axes or a frame around the shape were ignored, with all beyond them" in framed.notes


@pytest.mark.parametrize("jpeg", [False, True])
def test_a_caption_is_ignored(tmp_path, jpeg):
    alone = read_target(np.asarray(koch()), 128)
    picture = write(write(koch(), "Figure 3. The Koch curve, depth 4", 300, 330), "(von Koch, 1904)", 300, 360, 14)
    path = tmp_path / ("curve.jpg" if jpeg else "curve.png")
    picture.save(path, **({"quality": 70} if jpeg else {}))
    found = read_target(path, 128)
    assert "text beside the shape was ignored" in found.notes
    np.testing.assert_allclose(found.crop_box, alone.crop_box, atol=1.5)
    assert_alike(found.image, alone.image, 0.15 if jpeg else 0)


def test_specks_are_ignored():
    picture = koch()
    for x, y in ((12, 15), (580, 20), (300, 380)):
        ImageDraw.Draw(picture).rectangle((x, y, x + 1, y + 1), "black")
    found = read_target(np.asarray(picture), 128)
    assert "small specks away from the shape were ignored" in found.notes
    assert torch.equal(found.image, read_target(np.asarray(koch()), 128).image)


@pytest.mark.parametrize("suffix", ["png", "jpg"])
def test_of_several_shapes_the_largest_is_taken_and_said(tmp_path, suffix):
    picture = star(Image.new("L", (700, 400), 255), 200, 200, 110, 0)
    alone = read_target(np.asarray(picture), 128)
    star(picture, 560, 200, 60, 0).save(tmp_path / f"two.{suffix}")
    found = read_target(tmp_path / f"two.{suffix}", 128)
    assert any("2 shapes in one picture: the largest was taken" in warning for warning in found.warnings)
    assert_alike(found.image, alone.image, 0.03)


def test_a_page_of_text_is_no_clear_shape():
    page = Image.new("L", (500, 420), 255)
    words = "a quick brown fox jumps over the lazy dog while other animals look on".split()
    for row in range(12):
        write(page, " ".join(words[row % 5:row % 5 + 7]), 250, 30 + 30 * row, 15)
    found = read_target(np.asarray(page), 128)
    assert found.unclear == "it looks like a page of text"
    assert any("not a clear shape" in warning and "cut one shape out" in warning for warning in found.warnings)


@pytest.mark.parametrize("channels", [(), (3,)])
def test_noise_is_refused(channels):
    noise = np.random.default_rng(0).random((200, 240, *channels))
    with pytest.raises(InputError, match="the image is noise: neighbouring pixels have nothing to do with one another"):
        read_target(noise, 64)


@pytest.mark.parametrize("box, edges", [
    ((0, 0, 300, 300), None), ((150, 0, 300, 300), "left"), ((0, 0, 150, 300), "right"), ((0, 150, 300, 300), "top"),
    ((0, 0, 300, 150), "bottom"), ((20, 20, 281, 281), "left, right, top, bottom")])
def test_a_shape_that_reaches_the_edge_of_the_picture_is_told(box, edges):
    picture = Image.new("L", (300, 300))
    ImageDraw.Draw(picture).polygon([(20, 150), (150, 20), (280, 150), (150, 280)], fill=255)
    told = [note for note in read_target(np.asarray(picture.crop(box)), 64).notes if "edge" in note]
    assert [f"({edges})" in note for note in told] == ([] if edges is None else [True])
