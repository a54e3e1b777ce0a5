"""A part of a picture is read as if it were all, and lies where it lay."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from drawings import koch, leaf
from PIL import Image

from fractal_exp import InputError, codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.images import bands
from fractal_exp.images.pixels import read_colour
from fractal_exp.images.reading import read_target
from fractal_exp.inversion import Inversion
from fractal_exp.likeness import Likeness, camera_for
from fractal_exp.verdict import Verdict

CROP = (310, 40, 590, 310)  # of a page: the leaf on its right


@pytest.fixture(scope="module")
def page() -> Image.Image:
    """A Koch curve on the left and a larger leaf on the right of a page, 600×320 px."""
    page = Image.new("RGB", (600, 320), "white")
    page.paste(koch(size=(600, 400)).resize((280, 200)), (10, 20))
    page.paste(leaf((0, 100, 0)).resize((260, 260)), (320, 45))
    return page


def assert_same_place(found, part, origin=CROP[:2], size=(600, 320)):
    """A reading of a crop equals that of the part alone, and lies at `origin` in the whole."""
    assert torch.equal(found.image, part.image), "the crop is read as another image than the part alone"
    assert (found.source_size, found.scale, found.inverted) == (size, part.scale, part.inverted)
    np.testing.assert_allclose(found.crop_box, np.add(part.crop_box, [*origin, *origin]), atol=1e-9)


@pytest.mark.parametrize("options", [
    {}, {"clean": False}, {"threshold": 0.4}, {"invert": True, "padding": 0.5}])
def test_a_part_of_an_array_is_read_as_that_part_alone(page, options):
    pixels, (left, top, right, bottom) = np.asarray(page), CROP
    part = read_target(pixels[top:bottom, left:right], 96, **options)
    for source in (pixels, torch.from_numpy(pixels.copy())):
        found = read_target(source, 96, crop=CROP, **options)
        assert_same_place(found, part)
        assert found.crop == CROP
        assert found.notes[0] == "only the part of 280×270 px at (310, 40) is read, as asked"
    assert read_target(pixels, 96, **options).crop is None


def test_a_square_part_keeps_its_frame(page):
    square = (300, 20, 580, 300)
    found = read_target(np.asarray(page), 140, crop=square, frame="keep")
    assert found.crop_box == square and found.scale == 0.5
    with pytest.raises(InputError, match=r'a square picture, the part \(310, 40, 590, 310\) of the image is 280×270'):
        read_target(np.asarray(page), 140, crop=CROP, frame="keep")


@pytest.mark.parametrize("name, mode", [
    ("rgb.png", "RGB"), ("grey.png", "L"), ("palette.png", "P"), ("palette.gif", "P"), ("bits.png", "1"),
    ("alpha.png", "RGBA"), ("cmyk.tif", "CMYK"), ("cmyk.jpg", "CMYK"), ("deep.png", "I;16")])
def test_a_part_of_a_file_is_that_part_of_the_picture_as_shown(page, tmp_path, name, mode):
    if mode == "RGBA":
        picture = page.copy()
        picture.putalpha(page.convert("L").point(lambda level: 255 * (level < 250)))
    elif mode == "I;16":
        picture = Image.fromarray(np.asarray(page.convert("L")).astype(np.uint16) * 257)
    else:
        picture = page.convert(mode)
    picture.save(tmp_path / name)
    shown = Image.open(tmp_path / name)
    if mode in ("P", "CMYK", "1"):
        shown = shown.convert("L" if mode == "1" else "RGB")
    left, top, right, bottom = CROP
    options = {"clean": False, "threshold": 0.5} if name.endswith("jpg") else {}  # an array tells nothing of errors
    part = read_target(np.asarray(shown)[top:bottom, left:right], 96, **options)
    assert_same_place(read_target(tmp_path / name, 96, crop=CROP, **options), part)


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_crop_is_that_of_the_upright_picture(page, tmp_path, orientation):
    exif = Image.Exif()
    exif[bands.EXIF_ORIENTATION] = orientation
    page.save(tmp_path / "turned.png", exif=exif)
    upright = read_colour(tmp_path / "turned.png")
    height, width = upright.shape[:2]
    assert (width, height) == ((600, 320) if orientation < 5 else (320, 600))
    crop = np.array([20, 15, width - 25, height - 30])  # NumPy's whole numbers are whole numbers, too
    part = read_target(upright[crop[1]:crop[3], crop[0]:crop[2]], 96)
    assert_same_place(read_target(tmp_path / "turned.png", 96, crop=crop), part, crop[:2], (width, height))


@pytest.mark.parametrize("crop, message", [
    ((0, 0, 100), r"four whole numbers \(left, top, right, bottom\), in pixels of the picture, got \(0, 0, 100\)"),
    ((0, 0, 100.0, 100), "four whole numbers"), ((0, 0, True, 100), "four whole numbers"), ("0000", "got '0000'"),
    ((50, 0, 50, 100), r"left below right and top below bottom, got \(50, 0, 50, 100\), which is empty"),
    ((0, 90, 100, 80), "which is empty"),
    ((-1, 0, 100, 100), r"must lie within \(0, 0, 600, 320\), the whole picture, got \(-1, 0, 100, 100\)"),
    ((0, -1, 100, 100), "within"), ((0, 0, 601, 100), "within"), ((0, 0, 100, 321), "within"),
    ((10, 10, 25, 100), r"the part \(10, 10, 25, 100\) of .* at least 16 px on each side, got 15×90"),
    ((0, 0, 40, 16), r"the part \(0, 0, 40, 16\) of .* is all white"),
])
@pytest.mark.parametrize("kind", ["array", "file"])
def test_a_crop_that_cannot_be_is_refused(page, tmp_path, crop, message, kind):
    page.save(tmp_path / "page.png")
    with pytest.raises(InputError, match=message) as caught:
        read_target(np.asarray(page) if kind == "array" else tmp_path / "page.png", 64, crop=crop)
    assert "\n" not in str(caught.value)


def _blue(laid):
    return laid[..., 2] - laid[..., 0] > 50


def test_an_overlay_lies_over_the_part_that_was_read(tmp_path):
    code = attractor.normalize(codes.known("sierpinski_triangle"))
    drawn = np.rint(255 * suite.target(code, 160).numpy()).astype(np.uint8)
    Image.fromarray(np.pad(np.hstack([drawn, drawn]), ((31, 4), (17, 9)))).save(tmp_path / "twins.png")
    read = read_target(tmp_path / "twins.png", 160, crop=(177, 20, 340, 195))
    likeness = Likeness.of(code, read)
    found = Inversion(code=code, target=read, source=read.source, likeness=likeness, history=(), stopped="",
                      verdict=Verdict.of(likeness, 3, read), method="hand", seconds=0.0,
                      camera=camera_for(code, read))
    wrong = replace(found, code=code.similar(1.0, (0.2, 0.0)))
    height, width = np.asarray(Image.open(tmp_path / "twins.png")).shape
    right, blue = (np.asarray(each.overlay(opacity=1.0))[:height].astype(int) for each in (found, wrong))
    assert right.shape == (height, width, 3) and _blue(right).sum() < 50 < 1000 < _blue(blue).sum()
    assert _blue(blue)[:, :177].sum() == 0, "nothing is marked beside the part that was read"
    found.save(tmp_path / "found")
    assert Inversion.load(tmp_path / "found").placement == read.placement
