"""A code with a tone in the page, in a real browser: as `render` draws it, at any depth."""

from dataclasses import replace

import numpy as np
import pytest
from browser_helpers import COARSE
from test_colour_page import seen

from fractal_exp import View, codes, render
from fractal_exp.ifs import attractor

FERN = replace(attractor.normalize(codes.known("fern")), meta={"tone": {"light": 0.3, "gamma": 1.4, "linear": False}})
DEEP = attractor.random_point(FERN, 3)


@pytest.mark.parametrize(("thrower", "zoom"), [
    ("cpu", 1), ("cpu", 16), pytest.param("gpu", 16, marks=pytest.mark.slow)])
def test_a_code_with_a_tone_is_shown_with_it_unless_told_otherwise(tmp_path, open_page, thrower, zoom):
    view = View(DEEP if zoom > 1 else (0.0, 0.0), zoom)
    (x, y), opened = view.center, open_page()
    path, place = FERN.save_html(tmp_path / "fern.html"), f"#x={x!r}&y={y!r}&zoom={view.zoom!r}"
    expected = 255 * render(FERN, view, resolution=128, mode="tone").numpy()
    picture = seen(opened.go(f"file://{path}?thrower={thrower}{place}"))[..., 0]
    assert np.abs(picture - expected).mean() < 6
    assert abs(picture[picture > 13].mean() - expected[expected > 13].mean()) < 10
    assert opened.page.input_value("#by") == "own"
    plain = seen(opened.go(f"file://{path}?thrower={thrower}&again{place}&by=plain"))[..., 0]
    assert np.abs(plain - 255 * render(FERN, view, resolution=128).numpy()).mean() < 6
    assert not opened.said


def test_a_tone_that_is_none_is_left_out_of_the_page(tmp_path, open_page):
    path = replace(FERN, meta={"tone": {"light": "bright"}}).save_html(tmp_path / "fern.html")
    opened = open_page((480, 400), **COARSE).go(f"file://{path}")
    opened.page.keyboard.press("p")
    assert opened.page.input_value("#by") == "plain" and not opened.said
