"""Colours in the page, in a real browser: those of a code as `render` draws them, and those that a hand chooses."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from browser_helpers import COARSE

from fractal_exp import IFS, Colours, View, codes, render
from fractal_exp.ifs import attractor
from fractal_exp.rendering.colour import on_ground

FERN = replace(attractor.normalize(codes.known("fern")), colours=Colours(
    [[0.4, 0.25, 0.15], [0.1, 0.6, 0.3], [0.85, 0.8, 0.1], [0.9, 0.25, 0.3]], [0.9, 0.15, 0.5, 0.7]))
DEEP = attractor.random_point(FERN, 3)


@pytest.fixture(scope="module")
def path(tmp_path_factory) -> Path:
    return FERN.save_html(tmp_path_factory.mktemp("page") / "fern.html")


def truth(code: IFS, view: View, side: int = 128, ground: float = 0.0) -> np.ndarray:
    return 255 * on_ground(render(code, view, resolution=side, mode="colour"), (ground, ground, ground)).numpy()


@pytest.mark.parametrize(("thrower", "zoom"), [
    ("cpu", 1), ("gpu", 1e5), *(pytest.param(*case, marks=pytest.mark.slow) for case in (("cpu", 1e5), ("gpu", 1)))])
def test_a_code_with_colours_is_shown_in_them_at_any_depth(path, open_page, thrower, zoom):
    view = View() if zoom == 1 else View(DEEP, zoom)
    (x, y), opened = view.center, open_page()
    opened.go(f"file://{path}?thrower={thrower}#x={x!r}&y={y!r}&zoom={view.zoom!r}")
    expected, picture = truth(FERN, view), opened.colours()
    lit = expected.sum(-1) > 0
    assert lit.any() and np.abs(picture - expected)[lit].mean() < 14  # the points differ, the colours do not:
    assert np.abs(picture[lit].mean(0) - expected[lit].mean(0)).max() < 3
    assert not opened.said


@pytest.mark.parametrize("thrower", ["cpu", pytest.param("gpu", marks=pytest.mark.slow)])
def test_other_colours_are_chosen_by_keys_alone(path, open_page, thrower):
    opened = open_page((480, 400), device_scale_factor=0.25).go(f"file://{path}?thrower={thrower}")
    page = opened.page
    assert not page.is_visible("#colours")
    page.keyboard.press("p")
    assert page.is_visible("#colours") and page.input_value("#by") == "own" and page.is_disabled("#palette")
    pictures = {}
    for by in ("plain", "map", "address", "density"):
        opened.redrawn(partial(page.select_option, "#by", by))
        page.keyboard.press("Escape")
        assert not page.is_visible("#colours") and page.evaluate("document.activeElement.id") == "do-colour"
        pictures[by] = opened.colours()
        page.keyboard.press("p")
    assert np.ptp(pictures["plain"], axis=-1).max() == 0
    for by in ("map", "address", "density"):
        assert np.ptp(pictures[by], axis=-1).max() > 60, by
    assert np.abs(pictures["map"] - pictures["address"]).max() > 60
    assert page.is_enabled("#tone") and page.is_enabled("#palette")
    page.focus("#tone")
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    page.keyboard.press("Escape")
    assert opened.colours().sum() != pictures["density"].sum()
    opened.page.wait_for_timeout(500)
    assert "by=density" in page.url and "tone=2" in page.url
    assert not opened.said


def test_a_ground_of_ones_own_and_a_link_that_keeps_it(path, open_page):
    opened = open_page((480, 400), **COARSE).go(f"file://{path}#x=0&y=0&zoom=1&by=map&palette=fire&ground=204060")
    assert opened.colours()[0, 0].tolist() == [0x20, 0x40, 0x60]
    opened.page.keyboard.press("p")
    assert opened.page.input_value("#palette") == "fire" and opened.page.is_checked("#own-ground")
    opened.page.uncheck("#own-ground")
    opened.page.keyboard.press("Escape")
    assert opened.colours()[0, 0].tolist() == [0, 0, 0]


def test_a_code_with_colours_stands_on_the_ground_that_they_were_found_on(tmp_path, open_page):
    found = replace(FERN, meta={"ground": "#fff8e7"})
    opened = open_page((900, 600), **COARSE).go(f"file://{found.save_html(tmp_path / 'found.html')}")
    page, ground = opened.page, [0xff, 0xf8, 0xe7]
    assert opened.colours()[0, 0].tolist() == ground
    page.keyboard.press("p")
    page.select_option("#by", "plain")
    opened.drawn()
    page.keyboard.press("Escape")
    assert opened.colours()[0, 0].tolist() == [0, 0, 0], "white ink would not be seen on it"
    page.keyboard.press("e")
    page.keyboard.press("x")
    exported = json.loads(page.input_value("#out-text"))
    assert exported["meta"]["ground"] == "#fff8e7"
    page.keyboard.press("Escape")
    for named, expected in (("navy", [0, 0, 128]), ("no colour", [0, 0, 0])):
        page.keyboard.press("o")
        page.fill("#in-text", json.dumps(exported | {"meta": {"ground": named}}))
        page.click("#in-read")
        page.keyboard.press("p")
        page.select_option("#by", "own")
        page.keyboard.press("Escape")
        opened.drawn()
        assert opened.colours()[0, 0].tolist() == expected, named
    assert not opened.said


def test_a_code_without_colours_offers_none_until_one_with_colours_is_imported(tmp_path, open_page):
    plain = replace(FERN, colours=None).save_html(tmp_path / "plain.html")
    opened = open_page((900, 600), **COARSE).go(f"file://{plain}")
    page = opened.page
    options = "Array.from(document.getElementById('by').options, (option) => option.value)"
    assert "own" not in page.evaluate(options) and np.ptp(opened.colours(), axis=-1).max() == 0
    page.keyboard.press("e")
    page.keyboard.press("o")
    page.fill("#in-text", FERN.save(tmp_path / "code.json").read_text())
    opened.redrawn(partial(page.click, "#in-read"))
    assert "own" in page.evaluate(options) and page.input_value("#by") == "own"
    assert np.ptp(opened.colours(), axis=-1).max() > 60
    page.keyboard.press("x")
    exported = IFS.from_json(json.loads(page.input_value("#out-text")))
    assert exported.colours.rgb.tolist() == FERN.colours.rgb.tolist()
    assert not opened.said
