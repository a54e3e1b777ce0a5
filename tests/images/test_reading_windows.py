"""A picture that cuts its shape off is read as a part: the box that it shows is known, and what lies beyond is not."""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
import torch
from PIL import Image, ImageDraw

from fractal_exp import InputError, codes
from fractal_exp.cli import reading
from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import View
from fractal_exp.images.checks import Frame
from fractal_exp.images.known import Known
from fractal_exp.images.levels import TargetImage
from fractal_exp.images.reading import ReadImage, read_target
from fractal_exp.inversion import Inversion
from fractal_exp.likeness import Likeness, camera_for
from fractal_exp.rendering.still import render
from fractal_exp.targets import Picture
from fractal_exp.verdict import Verdict

FERN = attractor.normalize(codes.known("fern"))
SIDE = 96


@pytest.fixture(scope="module")
def fern() -> np.ndarray:
    """The fern on 400² pixels, whole."""
    return (255 * render(FERN, resolution=400)).round().byte().numpy()


def told(read: ReadImage) -> list[str]:
    return [note for note in read.notes if "cuts the shape off" in note]


def test_a_picture_that_cuts_a_shape_off_is_read_as_a_part(fern):
    read = read_target(fern[:250, :215], SIDE)
    known = read.known
    assert known is not None and (known.left, known.top) == (-1.0, 1.0)
    x, y = read.placement.to_canvas((215, 250))
    assert known.right == pytest.approx(x, abs=0.02) and known.bottom == pytest.approx(y, abs=0.02)
    assert len(told(read)) == 1 and "(right, bottom)" in told(read)[0]
    assert (read.image[~known.mask(SIDE)] <= read.image.max() / 2).all()


def test_a_whole_picture_knows_all(fern):
    read = read_target(fern, SIDE)
    assert read.known is None and not told(read)


def test_a_picture_that_is_trimmed_to_its_shape_is_whole_unless_it_is_a_crop(fern):
    rows, columns = (np.flatnonzero((fern > 100).any(axis)) for axis in (1, 0))
    trimmed = fern[rows[0] + 5:rows[-1] - 4, columns[0] + 5:columns[-1] - 4]  # so far that sides are lit along much
    read = read_target(trimmed, SIDE)
    assert read.known is None and any("it is taken to end there" in note for note in read.notes)
    height, width = trimmed.shape
    assert read_target(np.pad(trimmed, 9), SIDE, crop=(9, 9, width + 9, height + 9)).known is not None


def test_a_crop_that_cuts_a_shape_off_is_a_part_too_and_one_that_holds_it_is_not(fern):
    part = read_target(fern, SIDE, crop=(0, 0, 400, 250))
    assert part.known == read_target(fern[:250], SIDE).known is not None
    assert read_target(fern, SIDE, crop=(20, 20, 390, 390)).known is None


def test_a_tip_or_a_straight_side_may_touch_the_edge():
    diamond = Image.new("L", (261, 261))
    ImageDraw.Draw(diamond).polygon([(0, 130), (130, 0), (260, 130), (130, 260)], fill=255)
    assert read_target(np.asarray(diamond), SIDE).known is None
    block = np.zeros((200, 200), np.uint8)
    block[50:150, :100] = 255   # lit along all of its span
    read = read_target(block, SIDE)
    assert read.known is None and any("it is taken to end there" in note for note in read.notes)
    assert read_target(np.pad(block, ((0, 0), (40, 0))), SIDE, crop=(40, 0, 240, 200)).known is not None


def test_a_close_view_of_thin_lines_is_a_part_if_that_is_said():
    triangle = attractor.normalize(codes.known("sierpinski_triangle"))
    close = (255 * render(triangle, View((-0.3, -0.2), 2.5), resolution=400)).round().byte().numpy()
    assert read_target(close, SIDE).known is None  # it reaches all four sides, as a trimmed picture does
    read = read_target(close, SIDE, frame="part")
    assert read.known == Known(*(pytest.approx(end, abs=0.02) for end in (-0.75, -0.75, 0.75, 0.75)))
    assert told(read) and read.image.shape == (SIDE, SIDE)
    tip = np.zeros((200, 200), np.uint8)
    tip[99:102, 150:] = tip[60:140, 60:150] = 255   # one side, lit along little
    known = read_target(tip, SIDE, frame="part").known
    assert known is not None and known.right < 1.0 and (known.left, known.bottom, known.top) == (-1.0, -1.0, 1.0)


def test_every_way_to_read_a_picture_can_say_so(fern, tmp_path):
    assert reading.FRAMES == get_args(Frame)
    trimmed = fern[np.ix_(*((fern > 100).any(axis) for axis in (1, 0)))]
    Image.fromarray(trimmed).save(tmp_path / "fern.png")
    known = read_target(trimmed, SIDE, frame="part").known
    assert known is not None
    command = argparse.ArgumentParser()
    reading.add_reading(command)
    options = command.parse_args(["--frame", "part"])
    options.resolution = SIDE
    assert reading.read_picture(str(tmp_path / "fern.png"), options).known == known
    assert Picture(str(tmp_path / "fern.png"), frame="part").load(SIDE).read.known == known


def test_what_lies_within_its_picture_is_no_part(fern):
    with pytest.raises(InputError, match='frame="part" needs a shape that reaches a side.*leave frame="part" out'):
        read_target(fern, SIDE, frame="part")
    strip = np.zeros((400, 20), np.uint8)
    strip[20:380, :14] = 255
    assert not any("frame=part" in note for note in read_target(strip, SIDE).notes)
    with pytest.raises(InputError, match="wider than an eighth of the canvas"):
        read_target(strip, SIDE, frame="part")


def test_what_is_known_is_kept_with_other_levels():
    known = Known(-1.0, -0.5, 1.0, 1.0)
    target = TargetImage(torch.rand(SIDE, SIDE), levels="drawn", known=known)
    assert TargetImage.of(target).known == known == TargetImage.of(target, "coverage").known
    assert TargetImage.of(target.image).known is None


def test_a_result_keeps_what_is_known_in_its_file(fern, tmp_path):
    read = read_target(fern[:250], SIDE)
    scale = 2 * 200 / read.placement.side
    code = FERN.similar(scale, tuple(read.placement.to_canvas((200, 200)).tolist()))
    camera = camera_for(code, read)
    likeness = Likeness.of(code, read, camera)
    found = Inversion(code, read, read.image, likeness, Verdict.of(likeness, 4, read), camera, (), "", 0.0, "collage")
    words = "recovered: the shape is explained to within a pixel by 4 maps, as far as the picture shows it"
    assert found.verdict.words == words
    again = Inversion.load(found.save(tmp_path / "found"))
    assert again.target.known == read.known is not None
    whole = replace(found, target=replace(read, known=None))
    assert Inversion.load(whole.save(tmp_path / "whole")).target.known is None
    file = tmp_path / "found" / "inversion.json"
    file.write_text(file.read_text().replace('"top": 1.0', '"top": 7.0'))
    with pytest.raises(InputError, match="must be a box within"):
        Inversion.load(tmp_path / "found")


def test_a_strip_too_narrow_to_be_searched_in_is_read_as_whole(fern):
    read = read_target(fern, SIDE, crop=(0, 180, 400, 197))
    assert read.known is None and not told(read)
    wide = read_target(fern, SIDE, crop=(0, 100, 400, 300))
    assert wide.known is not None and not wide.image[~wide.known.mask(SIDE)].any()
