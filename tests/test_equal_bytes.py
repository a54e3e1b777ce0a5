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
    scores = [judging.f1_within_a_pixel(equal_bytes.outlined(ring, most), ring) for most in (12, 24, 300)]
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


def test_one_textbook_picture_a_family_is_taken_and_every_shape():
    lines = [{"set": "textbook", "family": "koch", "deepest": deep, "picture": name}
             for name, deep in (("koch-3", False), ("koch-5", True), ("koch-5-red", True))]
    assert [line["picture"] for line in equal_bytes.chosen([*lines, {"set": "shapes", "picture": "leaf"}])] == [
        "leaf", "koch-5"]


def test_the_report_has_a_table_a_set_and_says_what_is_closest():
    rows = pd.DataFrame([{"set": "shapes", "picture": name, "role": "tuning", "bytes": 384, "code": code, "jbig": .9,
                          "outlines": .8, "lossless": 500} for name, code in (("leaf", .95), ("tree", .7))])
    text = equal_bytes.report(rows)
    assert "### shapes" in text and "| leaf | tuning | 384 | 0.950 | 0.900 | 0.800 | 500 bytes |" in text
    assert "| mean | tuning | 384 | 0.825 |" in text and "Closest: code 1, jbig 1, outlines 0." in text
