"""Shapes in as many bytes: codes of 16 bits, JBIG of a smaller picture, polygons."""

import shutil
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from benchmarks.pictures import equal_bytes, judging
from fractal_exp import codes

ENCODER = pytest.mark.skipif(shutil.which(equal_bytes.ENCODER) is None, reason="pbmtojbg (jbigkit-bin) is absent")


def test_six_numbers_of_16_bits_draw_the_same_shape():
    fern = replace(codes.known("fern"), probabilities=None)
    kept = equal_bytes.rounded(fern)
    assert 0 < float((kept.linear - fern.linear).abs().max()) < 2**-15
    assert 0 < float((kept.offset - fern.offset).abs().max()) < 2**-14
    assert judging.f1_within_a_pixel(judging.drawing(kept, 128), judging.drawing(fern, 128)) > .995


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


def test_the_report_has_the_means_of_each_group_and_counts_ties_for_each():
    rows = pd.DataFrame([{"group": "shapes", "picture": name, "bytes": 384, "code": code, "jbig": .9, "outlines": .9,
                          "lossless": lossless, "commit": "0123456789ab", "machine": "a machine"}
                         for name, code, lossless in (("leaf", .95, 300), ("tree", .7, 500))])
    text = equal_bytes.report(rows)
    assert "commit 012345678, a machine" in text and "F1 within a pixel" in text
    assert "| shapes | 2 | 384 | 0.825 | 0.900 | 0.900 | 1 / 1 / 1 | 400 bytes | 1 |" in text
    assert "| leaf | shapes | 384 | 0.950 | 0.900 | 0.900 | 300 bytes |" in text
