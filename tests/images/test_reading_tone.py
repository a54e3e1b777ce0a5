"""The levels of a shape: flat colours, coloured pens, noise, and what is kept as it is."""

import numpy as np
import pytest
import torch
from drawings import fern_plot, leaf
from PIL import Image, ImageDraw

from fractal_exp.images.reading import read_target


@pytest.mark.parametrize("colour, paper", [
    ((0, 100, 0), "white"), ((90, 90, 90), "white"), ((255, 255, 150), "white"), ((60, 60, 60), (200, 200, 200)),
    ((40, 30, 20), (250, 240, 220)), ((200, 30, 30), "black"), ((255, 255, 0), (0, 0, 255)), ((30, 30, 120), "black")])
def test_a_leaf_of_any_flat_colour_is_white_on_black(colour, paper):
    expected = read_target(np.asarray(leaf("black")), 96).image
    found = read_target(np.asarray(leaf(colour, paper)), 96)
    torch.testing.assert_close(found.image, expected, atol=0.02, rtol=0)
    assert found.inverted == (paper not in ("black", (0, 0, 255)))


@pytest.mark.parametrize("quality", [40, 70])
def test_a_leaf_as_jpeg_is_the_same(tmp_path, quality):
    leaf((0, 100, 0)).save(tmp_path / "leaf.jpg", quality=quality)
    found, expected = read_target(tmp_path / "leaf.jpg", 96), read_target(np.asarray(leaf("black")), 96)
    assert float((found.image - expected.image).abs().mean()) < 0.01
    assert float((found.image[:8] > 0).float().mean()) == 0, "nothing is left of the JPEG's errors"


def lines(ink):
    picture = Image.new("RGB", (300, 300), "white")
    for k in range(12):
        ImageDraw.Draw(picture).line([(30, 40 + 20 * k), (270, 30 + 18 * k)], fill=ink)
    return picture


@pytest.mark.parametrize("ink, name, options, closer", [
    *(pytest.param(ink, "lines.jpg", {"quality": 70}, 0.5, id=f"jpeg-{number}")
      for number, ink in enumerate([(200, 30, 45), (0, 128, 0), (255, 140, 0), (31, 119, 180)])),
    pytest.param((0, 128, 0), "lines.tif", {"compression": "jpeg"}, 0.1, id="tiff"),
    pytest.param((0, 128, 0), "lines.webp", {"quality": 70}, 0.75, id="webp")])
def test_coloured_lines_are_the_same_in_a_lossy_file(tmp_path, ink, name, options, closer):
    """Only if the reader knows that the file is lossy."""
    picture = lines(ink)
    picture.save(tmp_path / name, **options)
    lossless, found, blurred = (read_target(given, 256) for given in (
        np.asarray(picture), tmp_path / name, np.asarray(Image.open(tmp_path / name).convert("RGB"))))
    away, without = (float((each.image - lossless.image).square().mean().sqrt()) for each in (found, blurred))
    assert away < closer * without
    np.testing.assert_allclose(found.crop_box, lossless.crop_box, atol=1)


def test_the_dots_of_a_coloured_jpeg_are_not_blurred(tmp_path):
    """A JPEG stores colours at half the resolution, but not their luma."""
    plot = fern_plot(axes=False)
    Image.fromarray(plot).save(tmp_path / "fern.jpg", quality=70)
    lossless, found = read_target(plot, 128).image, read_target(tmp_path / "fern.jpg", 128).image
    brighter = (found * lossless).sum() / found.square().sum()
    assert float((brighter * found - lossless).square().mean().sqrt()) < 0.0105, "by colour it is .0125"


def test_a_pen_that_differs_in_colour_alone_is_read_by_colour(tmp_path):
    picture = Image.new("RGB", (200, 200), (0, 150, 0))
    ImageDraw.Draw(picture).ellipse([50, 50, 150, 150], fill=(255, 20, 0))
    picture.save(tmp_path / "disc.jpg", quality=90)
    found = read_target(tmp_path / "disc.jpg", 64)
    assert float(found.image[32, 32]) > 0.9 and float(found.image[2:5].max()) == 0


@pytest.mark.parametrize("level", [0.3, 0.6])
def test_a_density_keeps_its_levels(level):
    """Shares of 16² subpixels about a level scatter as points of a chaos game do."""
    rng = np.random.default_rng(0)
    picture = np.zeros((200, 200))
    picture[50:150, 40:160] = rng.binomial(256, level, (100, 120)) / 256
    found = read_target(picture, 128)
    assert torch.equal(found.image, read_target(picture, 128, clean=False).image)


@pytest.mark.parametrize("suffix", ["jpg", "png"])
def test_a_large_picture_is_shrunk_as_it_is_read(tmp_path, suffix):
    small = Image.new("L", (1200, 300))
    small.paste(leaf("black", fine=1).convert("L"))
    large = small.resize((8400, 2100), Image.Resampling.NEAREST)
    large.save(tmp_path / f"large.{suffix}", **({"quality": 95} if suffix == "jpg" else {}))
    found, expected = read_target(tmp_path / f"large.{suffix}", 96), read_target(np.asarray(small), 96)
    assert found.source_size == (8400, 2100)
    assert "shrunk 2 times as it was read, from 8400×2100 px" in found.notes
    np.testing.assert_allclose(np.array(found.crop_box) / 7, expected.crop_box, atol=0.5)
    assert found.scale == pytest.approx(expected.scale / 7, rel=0.01)
    np.testing.assert_allclose(found.placement.to_canvas([(1050, 1050)]), expected.placement.to_canvas([(150, 150)]),
                               atol=0.01)


def test_a_large_picture_that_keeps_its_frame_is_read_whole(tmp_path):
    large = leaf("black", fine=1).convert("L").resize((8192, 8192), Image.Resampling.NEAREST)
    large.save(tmp_path / "large.png", compress_level=1)
    assert not any("shrunk" in note for note in read_target(tmp_path / "large.png", 96, frame="keep").notes)
