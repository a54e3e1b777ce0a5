"""Reading targets from arrays: exact framing, polarity, types, every refusal."""

import math

import numpy as np
import pytest
import torch
from drawings import lopsided
from PIL import Image

from fractal_exp import InputError, codes, suite
from fractal_exp.images.pixels import write_image
from fractal_exp.images.reading import read_target


def rectangle(height, width, x0, y0, x1, y1):
    """A white rectangle with exact coverage at its edges, float64."""
    columns = (np.minimum(x1, np.arange(width) + 1) - np.maximum(x0, np.arange(width))).clip(0, 1)
    rows = (np.minimum(y1, np.arange(height) + 1) - np.maximum(y0, np.arange(height))).clip(0, 1)
    return np.outer(rows, columns).astype(np.float64)


def disc(height, width, x, y, radius, fine=16):
    """A white disc, supersampled, float64."""
    rows, columns = (np.arange(height * fine) + 0.5) / fine, (np.arange(width * fine) + 0.5) / fine
    inside = (rows[:, None] - y) ** 2 + (columns - x) ** 2 < radius**2
    return inside.reshape(height, fine, width, fine).mean((1, 3))


def edges(image):
    """Where a solid shape begins and ends along x and y, on the canvas (y down), from its middle row and column."""
    size = image.shape[-1]

    def span(profile):
        level = (profile / profile.max()).repeat_interleave(2)  # an odd size has its middle within a pixel
        return -level[:size].sum() / size, level[size:].sum() / size

    return (*span(image.max(0).values), *span(image.max(1).values))


@pytest.mark.parametrize("resolution", [64, 97, 192])
@pytest.mark.parametrize("box", [(10.3, 20.25, 150.8, 90.6), (0, 0, 200, 77.5), (50.5, 3.2, 71.9, 119.1)])
def test_rectangle_lands_to_the_subpixel(box, resolution):
    width, height = box[2] - box[0], box[3] - box[1]
    target = read_target(rectangle(120, 200, *box), resolution, invert=False)
    half_x, half_y = 0.75 * width / max(width, height), 0.75 * height / max(width, height)
    tolerance = 2e-3 if resolution < max(width, height) else 2e-2
    np.testing.assert_allclose(edges(target.image), (-half_x, half_x, -half_y, half_y), atol=tolerance)
    assert target.image.mean() == pytest.approx(half_x * half_y, rel=5 * tolerance)
    assert target.scale == pytest.approx(0.75 * resolution / max(width, height), rel=1e-6)
    x0, y0, x1, y1 = target.crop_box
    assert (x0 + x1) / 2 == pytest.approx((box[0] + box[2]) / 2) and x1 - x0 == pytest.approx(y1 - y0)


def test_up_stays_up():
    picture = rectangle(100, 100, 20, 20, 80, 80)
    picture[20:50, 20:50] = 0
    image = read_target(picture, 80).image
    assert image[20, 20] == 0 and image[20, 60] == image[60, 20] == image[60, 60] == 1


def test_black_on_white_and_its_inverse_are_the_same_target():
    picture = np.rint(disc(90, 120, 70, 40, 30) * 255).astype(np.uint8)
    white, black = read_target(picture, 48), read_target(255 - picture, 48)
    torch.testing.assert_close(white.image, black.image, atol=1e-6, rtol=0)
    assert not white.inverted and black.inverted
    assert "white shape on black" in white.notes and "black shape on white: inverted" in black.notes


@pytest.mark.parametrize("quality", [30, 75])
def test_jpeg_artefacts_do_not_move_the_frame(tmp_path, quality):
    picture = disc(301, 420, 199.4, 142.7, 88.2)
    Image.fromarray(np.rint(picture * 255).astype(np.uint8)).save(tmp_path / "disc.jpg", quality=quality)
    clean, read = read_target(picture, 96), read_target(tmp_path / "disc.jpg", 96)
    np.testing.assert_allclose(read.crop_box, clean.crop_box, atol=1.0)
    assert (read.image - clean.image).abs().mean() < 0.01


def test_keep_frame_leaves_a_framed_target_alone():
    image = torch.rand(48, 48, generator=torch.Generator().manual_seed(0)) * torch.from_numpy(lopsided()[:48, :48] > 0)
    kept = read_target(image, 48, frame="keep", invert=False)
    assert torch.equal(kept.image, image) and kept.crop_box == (0, 0, 48, 48) and kept.scale == 1
    halved = read_target(image, 24, frame="keep", invert=False).image
    torch.testing.assert_close(halved, torch.nn.functional.avg_pool2d(image[None], 2)[0])
    odd = read_target(image, 35, frame="keep", invert=False).image
    assert float(odd.mean()) == pytest.approx(float(image.mean()), rel=1e-5)


def test_a_target_of_our_own_stays_as_it_is(tmp_path):
    image = suite.target(codes.known("fern"), 64)
    written = write_image(tmp_path / "fern.png", image, bits=16)
    for source, atol in ((image, 0), (image.numpy(), 0), (written, 1e-5)):
        read = read_target(source, 64)
        assert (read.image - image).abs().max() <= atol and read.crop_box == (0, 0, 64, 64)
    assert any("a target of this package" in note for note in read.notes)


@pytest.mark.parametrize("dtype", ["bool", "uint8", "uint16", "float16", "float32", "float64", ">f4", ">u2"])
def test_types_of_arrays_and_tensors_agree(dtype):
    white = {"b": 1, "u": 65535 if "2" in dtype or "16" in dtype else 255, "f": 1}[np.dtype(dtype).kind]
    picture = (lopsided() > 0.4) * white
    expected = read_target((lopsided() > 0.4).astype(np.float64), 40).image
    torch.testing.assert_close(read_target(picture.astype(dtype), 40).image, expected)
    if dtype[0] != ">":
        torch.testing.assert_close(read_target(torch.from_numpy(picture.astype(dtype)), 40).image, expected)


def test_transparent_picture_is_laid_on_what_it_stands_out_from():
    shape = rectangle(60, 60, 10, 10, 50, 50)
    ramp = np.linspace(0, 0.3, 60) * shape
    dark = read_target(np.dstack([ramp] * 3 + [shape]), 40)
    assert dark.inverted and "transparent parts laid on white" in dark.notes and dark.image[0, 0] == 0
    assert float(dark.image[20, 20]) > 0.7
    light = read_target(np.dstack([1 - ramp] * 3 + [shape]), 40)
    assert not light.inverted and "transparent parts laid on black" in light.notes
    torch.testing.assert_close(light.image, dark.image, atol=1e-5, rtol=0)


SQUARE = rectangle(40, 40, 10, 10, 30, 30)
BAD_IMAGES = {
    "empty": (np.zeros((40, 40)), r"empty \(all black\): its levels run from 0.000 to 0.000"),
    "white": (np.full((40, 40), 255, np.uint8), "all white"),
    "grey": (np.full((40, 40, 3), 0.5), "evenly grey"),
    "faint": (SQUARE * 0.01 + 0.5, "evenly grey: its levels run from 0.500 to 0.510"),
    "nan": (np.where(SQUARE > 0, np.nan, 0), "400 of its values are NaN or infinite"),
    "above one": (SQUARE * 255, r"in \[0, 1\] if it holds floats, got 0 to 255; divide it"),
    "small": (SQUARE[:15], "at least 16 px on each side, got 40×15"),
    "no pixels": (np.zeros((0, 40)), "has no pixels"),
    "one axis": (np.zeros(40), r"must have shape \(H, W\).*got \(40,\)"),
    "channels first": (np.zeros((3, 40, 40)), "move the channels last"),
    "batch": (np.zeros((1, 40, 40, 3)), r"got \(1, 40, 40, 3\)"),
    "int64": (torch.zeros(40, 40, dtype=torch.int64), "got int64; convert it"),
    "transparent": (np.zeros((40, 40, 4)), "fully transparent"),
    "list": ([[0, 1]], "a path, a NumPy array or a torch tensor, got list"),
}


@pytest.mark.parametrize("case", BAD_IMAGES)
def test_unusable_images_are_refused(case):
    image, message = BAD_IMAGES[case]
    with pytest.raises(InputError, match=message) as caught:
        read_target(image, 32)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("options, message", [
    ({"resolution": 15}, "at least 16 pixels, got 15"),
    ({"resolution": True}, "got True"),
    ({"threshold": 0}, "threshold must be between 0 and 1"),
    ({"threshold": math.nan}, "got nan"),
    ({"padding": 1}, "padding must be at least 0 and below 1"),
    ({"invert": "yes"}, 'invert must be "auto", true or false, got \'yes\''),
    ({"clean": "yes"}, "clean must be true or false, got 'yes'"),
    ({"frame": "crop"}, 'frame must be one of fit, part, keep, got \'crop\''),
])
def test_unusable_options_are_refused(options, message):
    with pytest.raises(InputError, match=message):
        read_target(SQUARE, **{"resolution": 32, **options})
