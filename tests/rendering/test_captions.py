"""Captions of strips and sheets stay below their own picture."""

import pytest
from PIL import ImageFont

from fractal_exp.rendering import sheets as pictures

CAPTION = "suite2025-007-collage-full-laptop-seed0-a1b2c3, zoomed 17.3 times, F1 0.981"


@pytest.mark.parametrize("side", [48, 96, 160, 320])
@pytest.mark.parametrize("caption", [CAPTION, "whole, F1 1.000", "", "W" * 300, "two\nlines"])
def test_a_caption_is_no_wider_than_its_picture(side, caption):
    font = ImageFont.load_default(size=max(9, side // 24))
    text, fitting = pictures.fitted(caption, side, font)
    assert fitting.getlength(text) <= side and fitting.size >= 9
    if font.getlength(caption.split("\n")[0]) <= side:
        assert text == " ".join(caption.split()) and fitting.size == font.size
