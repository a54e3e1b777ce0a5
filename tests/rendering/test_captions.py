"""Captions of strips and sheets stay below their own picture."""

import numpy as np
import pytest
import torch
from PIL import ImageFont

from fractal_exp.rendering import sheets as pictures

CAPTION = "suite2025-007-collage-full-laptop-seed0-a1b2c3, zoomed 17.3 times, F1 0.981"


@pytest.mark.parametrize("side", [48, 96, 160, 320])
@pytest.mark.parametrize("caption", [CAPTION, "whole, F1 1.000", "", "W" * 300, "two\nlines"])
def test_a_caption_is_no_wider_than_its_picture(side, caption):
    font = ImageFont.load_default(size=max(9, side // 24))
    text, fitting = pictures._fitted(caption, side, font)
    assert fitting.getlength(text) <= side and fitting.size >= 9
    if font.getlength(caption.split("\n")[0]) <= side:
        assert text == " ".join(caption.split()) and fitting.size == font.size


def test_a_long_caption_keeps_its_beginning_and_its_end():
    text, _ = pictures._fitted(CAPTION, 160, ImageFont.load_default(size=9))
    assert text.startswith("suite2025") and text.endswith(".981") and text.count("…") == 1


def test_no_caption_of_a_strip_runs_into_the_next_or_past_the_edge():
    side, black = 120, torch.zeros(2, 8, 8)
    strip = pictures.comparison_strip(black, black, [CAPTION, "W" * 300], side=side)
    background = (strip == 32).all(-1)
    for column in range(4):  # the gaps between pictures, and the edges
        gap = background[:, column * (side + pictures.GAP):column * (side + pictures.GAP) + pictures.GAP - 1]
        assert gap.all()
    assert background[-2:].all() and (strip > 150).any(), "captions are there, and whole"
    assert np.ptp(strip[4:4 + side, 4:4 + side]) == 0, "and not on the pictures"
