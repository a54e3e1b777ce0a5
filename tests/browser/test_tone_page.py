"""A code with a tone in the page, in a real browser: as `render` draws it, at any depth."""

from dataclasses import replace

import numpy as np
import pytest
from browser_helpers import COARSE

from fractal_exp import Colours, View, codes, render
from fractal_exp.ifs import attractor
from fractal_exp.rendering.colour import on_ground

FERN = replace(attractor.normalize(codes.known("fern")), meta={"tone": {"light": 0.3, "gamma": 1.4, "linear": False}})
DEEP = attractor.random_point(FERN, 3)


@pytest.mark.parametrize(("thrower", "zoom"), [
    ("cpu", 1), ("cpu", 16), pytest.param("gpu", 16, marks=pytest.mark.slow)])
def test_a_code_with_a_tone_is_shown_with_it_unless_told_otherwise(tmp_path, open_page, thrower, zoom):
    view = View(DEEP if zoom > 1 else (0.0, 0.0), zoom)
    (x, y), opened = view.center, open_page()
    path, place = FERN.save_html(tmp_path / "fern.html"), f"#x={x!r}&y={y!r}&zoom={view.zoom!r}"
    expected = 255 * render(FERN, view, resolution=128, mode="tone").numpy()
    picture = opened.go(f"file://{path}?thrower={thrower}{place}").colours()[..., 0]
    assert np.abs(picture - expected).mean() < 6
    assert abs(picture[picture > 13].mean() - expected[expected > 13].mean()) < 10
    assert opened.page.input_value("#by") == "own"
    plain = opened.go(f"file://{path}?thrower={thrower}&again{place}&by=plain").colours()[..., 0]
    assert np.abs(plain - 255 * render(FERN, view, resolution=128).numpy()).mean() < 6
    assert not opened.said


@pytest.mark.parametrize("thrower", ["cpu", pytest.param("gpu", marks=pytest.mark.slow)])
def test_a_code_in_colours_covers_the_ground_as_render_has_it(tmp_path, open_page, thrower):
    colours = Colours([[0.1, 0.5, 0.1], [0.2, 0.8, 0.3], [0.9, 0.7, 0.1], [0.6, 0.2, 0.7]], [1, 0.3, 0.6, 0.6])
    code = replace(FERN, colours=colours, meta={"tone": {"light": 0.3, "cover": 0.2}, "ground": "#ffffff"})
    picture = open_page().go(f"file://{code.save_html(tmp_path / 'fern.html')}?thrower={thrower}").colours()
    expected = 255 * on_ground(render(code, resolution=128, mode="colour"), (1.0, 1.0, 1.0)).numpy()
    bare = replace(code, meta={"ground": "#ffffff"})
    without = 255 * on_ground(render(bare, resolution=128, mode="colour"), (1.0, 1.0, 1.0)).numpy()
    assert 3 * np.abs(picture - expected).mean() < np.abs(without - expected).mean() > 6


def test_a_tone_that_is_none_is_left_out_of_the_page(tmp_path, open_page):
    path = replace(FERN, meta={"tone": {"light": "bright"}}).save_html(tmp_path / "fern.html")
    opened = open_page((480, 400), **COARSE).go(f"file://{path}")
    opened.page.keyboard.press("p")
    assert opened.page.input_value("#by") == "plain" and not opened.said
