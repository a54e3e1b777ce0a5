"""Pictures as files: every kind that people have, damaged ones, and the PNGs that are written."""

import os
import socket

import numpy as np
import pytest
import torch
from drawings import declared, lopsided
from PIL import Image

from fractal_exp import InputError
from fractal_exp.images.pixels import read_colour, read_small, write_image
from fractal_exp.images.reading import read_target

LEAF = np.rint(lopsided() * 255).astype(np.uint8)


def save_variants(folder):
    """The same grey picture as the files people have."""
    grey = Image.fromarray(LEAF)
    opaque = Image.fromarray(np.full_like(LEAF, 255))
    files = {
        "grey.png": grey,
        "rgb.png": grey.convert("RGB"),
        "palette.png": grey.convert("P"),
        "16bit.png": Image.fromarray(LEAF.astype(np.uint16) * 257),
        "rgba.png": Image.merge("RGBA", [grey, grey, grey, opaque]),
        "la.png": Image.merge("LA", [grey, opaque]),
        "grey.tif": grey,
        "float.tif": Image.fromarray(LEAF.astype(np.float32) / 255),
        "grey.bmp": grey,
        "grey.webp": grey.convert("RGB"),
        "cut.gif": grey,
        "shape_in_alpha.png": Image.merge("RGBA", [opaque, opaque, opaque, grey]),
        "black_in_alpha.png": Image.merge("LA", [Image.new("L", grey.size, 0), grey]),
    }
    for name, picture in files.items():
        picture.save(folder / name, **({"lossless": True} if name.endswith("webp") else {}))
    return list(files)


def test_every_kind_of_file_gives_the_same_target(tmp_path):
    expected = read_target(LEAF, 40).image
    for name in save_variants(tmp_path):
        read = read_target(str(tmp_path / name), 40)
        torch.testing.assert_close(read.image, expected, atol=2e-3, rtol=0, msg=name)
        assert read.source_size == (80, 60), name
    assert "the shape is in the alpha channel alone: opaque is white" in read.notes


def test_unusable_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="cannot read the picture .*nowhere.png: No such file .*; check the path"):
        read_target(tmp_path / "nowhere.png", 32)
    with pytest.raises(InputError, match="is a folder"):
        read_target(tmp_path, 32)
    (tmp_path / "text.png").write_text("not a picture")
    with pytest.raises(InputError, match="text.png is not a picture of a supported format .PNG, JPEG, "):
        read_target(tmp_path / "text.png", 32)
    (tmp_path / "nothing.png").touch()
    with pytest.raises(InputError, match="not a picture of a supported format"):
        read_target(tmp_path / "nothing.png", 32)


@pytest.mark.parametrize("suffix", ["png", "jpg", "tif", "gif", "bmp"])
def test_truncated_files_are_refused(tmp_path, suffix):
    noise = np.random.default_rng(0).integers(0, 256, (64, 64), dtype=np.uint8)
    whole = tmp_path / f"whole.{suffix}"
    Image.fromarray(noise).save(whole)
    (tmp_path / f"cut.{suffix}").write_bytes(whole.read_bytes()[: whole.stat().st_size * 2 // 3])
    with pytest.raises(InputError, match=r"cut short|not a picture of a supported format") as caught:
        read_target(tmp_path / f"cut.{suffix}", 32)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("side", [20_001, 30_000])  # where Pillow warns, and where it refuses
def test_decompression_bomb_is_refused(tmp_path, side):
    (tmp_path / "bomb.png").write_bytes(declared(side, 1))
    before = Image.MAX_IMAGE_PIXELS
    with pytest.raises(InputError, match="more than 400000000 pixels, .*; shrink the picture first"):
        read_target(tmp_path / "bomb.png", 32)
    assert Image.MAX_IMAGE_PIXELS == before, "Pillow's own bound is as before"


def test_written_images_read_back_exactly(tmp_path):
    levels = torch.arange(256, dtype=torch.float32).reshape(16, 16) / 255
    path = write_image(tmp_path / "grey.png", levels)
    assert path.is_absolute()
    np.testing.assert_array_equal(np.asarray(Image.open(path)).ravel(), np.arange(256))
    between = np.full((16, 16), 0.7 / 255)
    assert np.asarray(Image.open(write_image(tmp_path / "grey.png", between))).max() == 1
    fine = np.linspace(0, 1, 65536).reshape(256, 256)
    np.testing.assert_array_equal(np.asarray(Image.open(write_image(tmp_path / "fine.png", fine, bits=16))).ravel(),
                                  np.arange(65536))
    colour = np.random.default_rng(0).integers(0, 256, (20, 30, 3), dtype=np.uint8)
    np.testing.assert_array_equal(np.asarray(Image.open(write_image(tmp_path / "colour.PNG", colour))), colour)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["colour.PNG", "fine.png", "grey.png"]


def test_formats_that_call_other_programs_are_not_read(tmp_path):
    Image.fromarray(LEAF).save(tmp_path / "leaf.eps")
    (tmp_path / "leaf.png").write_bytes((tmp_path / "leaf.eps").read_bytes())
    for name in ("leaf.eps", "leaf.png"):
        with pytest.raises(InputError, match="not a picture of a supported format"):
            read_target(tmp_path / name, 32)


def test_what_is_no_ordinary_file_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(str(tmp_path / "socket.png"))
    for path, kind in ((tmp_path / "pipe.png", "a pipe"), (tmp_path / "socket.png", "a socket"),
                       ("/dev/zero", "a device")):
        with pytest.raises(InputError, match=f"it is {kind}; give the path of a file"):
            read_target(path, 32)
    with pytest.raises(InputError, match="File name too long"):
        read_target(tmp_path / ("x" * 300), 32)


@pytest.mark.parametrize("colour", [0, 2, 3, 4, 6])
def test_a_png_without_all_its_rows_is_damaged_and_not_black_or_transparent(tmp_path, colour):
    for rows in (0, 1, 10, 399):
        (tmp_path / "short.png").write_bytes(declared(400, rows, colour))
        with pytest.raises(InputError, match="damaged or cut short"):
            read_target(tmp_path / "short.png", 32)
    (tmp_path / "whole.png").write_bytes(declared(400, 400, colour))
    with pytest.raises(InputError, match="transparent|stands out"):
        read_target(tmp_path / "whole.png", 32)


def test_no_memory_is_taken_for_pixels_that_a_short_file_cannot_hold(tmp_path):
    """Of as many pixels as are read, which is more than Pillow's own bound."""
    (tmp_path / "bomb.png").write_bytes(declared(20_000, 1))
    before = Image.core.get_stats()["allocated_blocks"]
    with pytest.raises(InputError, match="pixels are missing"):
        read_target(tmp_path / "bomb.png", 32)
    assert Image.core.get_stats()["allocated_blocks"] == before, "Pillow's blocks of memory"


def test_the_pixels_that_are_decoded_are_bounded_as_asked(tmp_path):
    Image.new("L", (200, 100)).save(tmp_path / "large.png")
    with pytest.raises(InputError, match="200×100 pixels, at most"):
        read_target(tmp_path / "large.png", 32, most_pixels=19_999)


@pytest.mark.parametrize("size", [(1000, 700), (480, 300), (37, 961)])
def test_a_picture_is_shrunk_as_it_is_read_to_what_it_looks_like(tmp_path, size):
    rough = np.random.default_rng(0).integers(0, 256, (5, 7, 4), np.uint8)
    Image.fromarray(rough).resize(size, Image.Resampling.BILINEAR).save(tmp_path / "colours.png")
    small, whole = read_small(tmp_path / "colours.png", 240, 1.0), read_colour(tmp_path / "colours.png", 1.0)
    assert max(small.shape) == 240 and small.dtype == np.uint8
    expected = Image.fromarray(whole).resize(small.shape[1::-1], Image.Resampling.BOX)
    assert np.abs(small.astype(float) - np.asarray(expected)).mean() < 3
