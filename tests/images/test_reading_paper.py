"""Photographs of paper: an uneven light is evened out, grain is no shape, and no other picture is taken for paper."""

import numpy as np
import pytest
from drawings import alike, koch, leaf
from PIL import Image
from scipy.ndimage import gaussian_filter

from fractal_exp import codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.images.bands import Bands
from fractal_exp.images.checks import Notes
from fractal_exp.images.paper import evened
from fractal_exp.images.reading import read_target

LIGHTS = {
    "even": lambda x, y: 1 + 0 * x,
    "aslant": lambda x, y: 1 - 0.35 * (x + y) / 2,
    "lamp": lambda x, y: 1 - 0.5 * ((x - 0.3)**2 + (y - 0.6)**2) / 0.85,
    "shadow": lambda x, y: 1 - 0.4 / (1 + np.exp((x + 0.3 * y - 0.6) / 0.03)),
}


def photographed(picture, light, paper=(0.93, 0.91, 0.85), noise=0.015):
    """A picture (H,W,3) of dark ink on white, printed on paper and seen under a light: uint8."""
    rng, ink = np.random.default_rng(0), 1 - np.asarray(picture.convert("RGB")) / 255
    y, x = (each / np.array(ink.shape[:2])[k] for k, each in enumerate(np.mgrid[:ink.shape[0], :ink.shape[1]]))
    grain = 1 + gaussian_filter(rng.normal(0, 0.08, ink.shape[:2]), 1.5)
    page = np.array(paper) * (1 - 0.88 * ink) * (grain * LIGHTS[light](x, y))[..., None]
    seen = gaussian_filter(page, (0.6, 0.6, 0)) + rng.normal(0, noise, ink.shape)
    return (255 * seen).clip(0, 255).round().astype(np.uint8)


@pytest.fixture(scope="module", params=[koch(), koch(pen="orangered"), leaf("black"), leaf((0, 100, 0))],
                ids=["lines", "orange lines", "solid", "green solid"])
def drawing(request):
    """A drawing, and what is read of it without any paper."""
    return request.param, read_target(np.asarray(request.param), 128)


@pytest.mark.parametrize("light, format", [
    *((light, "array") for light in LIGHTS), ("shadow", "jpeg"),
    *(pytest.param(light, "jpeg", marks=pytest.mark.slow) for light in LIGHTS if light != "shadow")])
def test_a_drawing_is_read_under_any_light(drawing, light, format, tmp_path):
    picture, expected = drawing
    source = photographed(picture, light)
    if format == "jpeg":
        Image.fromarray(source).save(tmp_path / "photo.jpg", quality=80)
    found = read_target(source if format == "array" else tmp_path / "photo.jpg", 128)
    assert alike(found.image, expected.image) >= 0.98 and found.inverted and found.known is None
    np.testing.assert_allclose(found.crop_box, expected.crop_box, atol=3)
    assert any("the light on the paper is uneven" in note for note in found.notes) == (light != "even")


def test_the_darkest_part_of_the_light_is_told():
    notes = Notes()
    pixels = Bands.of_array(photographed(koch(), "aslant", paper=(0.9,) * 3) / np.float32(255))
    assert evened(pixels, notes).full == (600, 400)
    assert "down to 65% of its brightest" in notes[0] or "down to 66% of its brightest" in notes[0]


def on_desk(picture):
    """A photograph of a picture's sheet on a dark desk, a little turned; and the shape's box in it."""
    sheet = Image.new("RGBA", (800, 640))
    sheet.paste(picture.convert("RGBA"), (100, 120))
    turned = np.asarray(sheet.rotate(2, Image.Resampling.BICUBIC)) / 255.0
    rng, alpha = np.random.default_rng(0), turned[..., 3:]
    seen = alpha * (0.1 + 0.8 * turned[..., :3]) + (1 - alpha) * np.array([0.3, 0.22, 0.15])
    return (255 * (seen * np.linspace(1, 0.75, 800)[:, None] + rng.normal(0, 0.015, seen.shape))).clip(0, 255).astype(
        np.uint8)


@pytest.mark.parametrize("pen", ["black", "orange"])
def test_what_is_drawn_on_a_sheet_is_read_and_not_the_sheet(pen):
    photograph = on_desk(koch(pen=pen))
    found = read_target(photograph, 128)
    assert found.inverted and any("a sheet of paper lies on" in warning for warning in found.warnings)
    x0, y0, x1, y1 = found.crop_box  # the curve spans (50, 116) to (550, 260) of the sheet
    np.testing.assert_allclose([(x0 + x1) / 2, (y0 + y1) / 2, 0.75 * (x1 - x0)], [395, 309, 504], atol=8)
    assert not read_target(photograph, 128, invert=False).inverted


def test_a_drawing_that_reaches_the_sides_of_its_sheet_is_told():
    whole = koch().crop((40, 0, 560, 400)).resize((600, 400))
    assert any("seems to lie on something darker" in each for each in read_target(on_desk(whole), 128).warnings)


def test_a_white_square_with_holes_is_no_sheet():
    carpet = np.kron(np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]]), np.ones((60, 60)))
    found = read_target(np.pad(carpet, 40), 64)
    assert not found.inverted and found.warnings == ()


def test_chalk_on_a_board_stays_white():
    board = 255 - photographed(koch(), "aslant", paper=(0.8, 0.8, 0.8))
    found = read_target(board, 128)
    assert not found.inverted and alike(found.image, read_target(np.asarray(koch()), 128).image) >= 0.98


def test_lone_specks_of_noise_do_not_move_the_frame():
    found = read_target(photographed(koch(pen=(200, 200, 200)), "even"), 128)  # without their removal: by 50 px
    np.testing.assert_allclose(found.crop_box, read_target(np.asarray(koch()), 128).crop_box, atol=3)


def test_no_other_picture_is_taken_for_paper():
    y, x = np.mgrid[:200, :200] / 200.0
    pictures = {"slope": x, "glow": np.exp(-8 * ((x - 0.5)**2 + (y - 0.5)**2)), "bowl": (x - 0.5)**2 + (y - 0.5)**2,
                "stripes": (np.floor(20 * x) % 2), "sky": 0.3 + 0.6 * y * (np.sin(40 * x) > 0)}
    for code in (attractor.normalize(codes.known(name)) for name in ("fern", "sierpinski_carpet", "twindragon")):
        drawn = suite.target(code, 200).numpy()
        parts = drawn, 1 - drawn, drawn[60:, 40:150], 1 - drawn[80:]
        pictures |= {f"{code!r} {k}": part for k, part in enumerate(parts)}
    for name, picture in pictures.items():
        whole = Bands.of_array(np.ascontiguousarray(picture, np.float32))
        assert evened(whole, Notes()) is whole, name
