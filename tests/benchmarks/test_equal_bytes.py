"""Shapes in as many bytes: codes of 16 bits, JBIG of a smaller picture, polygons."""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from benchmarks.pictures import equal_bytes, judging
from fractal_exp import codes

ENCODER = pytest.mark.skipif(shutil.which(equal_bytes.ENCODER) is None, reason="pbmtojbg (jbigkit-bin) is absent")


def disc(side: int = 64) -> np.ndarray:
    at = np.linspace(-1, 1, side)
    return at[:, None]**2 + at**2 < .5


def test_six_numbers_of_16_bits_draw_the_same_shape():
    fern = replace(codes.known("fern"), probabilities=None)
    kept = equal_bytes.rounded(fern)
    assert 0 < float((kept.linear - fern.linear).abs().max()) < 2**-15
    assert 0 < float((kept.offset - fern.offset).abs().max()) < 2**-14
    assert judging.f1_within_a_pixel(judging.drawing(kept, 128), judging.drawing(fern, 128)) > .995


def test_outlines_come_closer_with_more_bytes_and_keep_holes():
    ring = disc(96) & ~np.pad(disc(48), 24)
    scores = [judging.f1_within_a_pixel(equal_bytes.outlined(ring, most), ring) for most in (14, 28, 300)]
    assert scores == sorted(scores) and scores[0] < scores[-1] and scores[-1] > .99
    assert not equal_bytes.outlined(ring, 300)[48, 48], "a hole stays a hole"
    assert not equal_bytes.outlined(ring, 3).any(), "nothing fits into three bytes"
    assert not equal_bytes.outlined(np.zeros((16, 16), bool), 100).any()


@ENCODER
def test_a_smaller_picture_is_taken_where_the_whole_does_not_fit():
    rng = np.random.default_rng(0)
    shape = disc() & (rng.random((64, 64)) < .9)
    whole = equal_bytes.jbig_bytes(shape)
    assert 0 < equal_bytes.jbig_bytes(disc()) < whole
    assert np.array_equal(equal_bytes.smaller(shape, whole), shape)
    half = equal_bytes.smaller(shape, whole // 4)
    assert not np.array_equal(half, shape) and judging.f1_within_a_pixel(half, shape) > .9
    assert not equal_bytes.smaller(shape, 1).any()


def test_packed_polygons_come_back():
    rng = np.random.default_rng(0)
    outlines = [rng.integers(0, 256, (corners, 2)) for corners in (3, 254, 255, 700)]
    for some in (outlines, outlines[:1]):
        back = equal_bytes.unpacked(*equal_bytes.packed(some))
        assert all(np.array_equal(a, b) for a, b in zip(back, some, strict=True))
    square = [np.array([[0, 0], [0, 9], [9, 9], [9, 0]])] * 50
    data, by_zlib = equal_bytes.packed(square)
    assert by_zlib and len(data) < 50 and len(equal_bytes.unpacked(data, by_zlib)) == 50
    assert equal_bytes.packed([]) == (b"", False)


def test_the_deepest_textbook_pictures_are_taken_and_every_shape():
    lines = [{"set": "textbook", "deepest": deep, "jpeg": jpeg, "picture": name} for name, deep, jpeg in (
        ("koch-5-red-jpeg", True, True), ("koch-3", False, False), ("koch-5", True, False))]
    assert [line["picture"] for line in equal_bytes.chosen([{"set": "shapes", "picture": "leaf"}, *lines])] == [
        "leaf", "koch-5"]


def test_the_report_has_the_means_of_each_group_and_counts_ties_for_each():
    rows = pd.DataFrame([{"group": "shapes", "picture": name, "bytes": 384, "code": code, "jbig": .9, "outlines": .9,
                          "lossless": lossless, "commit": "0123456789ab", "machine": "a machine"}
                         for name, code, lossless in (("leaf", .95, 300), ("tree", .7, 500))])
    text = equal_bytes.report(rows)
    assert "commit 012345678, a machine" in text and "F1 within a pixel" in text
    assert "| shapes | 2 | 384 | 0.825 | 0.900 | 0.900 | 1 / 1 / 1 | 400 bytes | 1 |" in text
    assert "| leaf | shapes | 384 | 0.950 | 0.900 | 0.900 | 300 bytes |" in text
