"""The page in a real browser: it draws what `render` draws, at any depth, for hands and keys, and asks nobody."""

import re
import time
from collections.abc import Callable

import numpy as np
import pytest
import torch
from browser_helpers import CHROMIUM, COARSE, PATIENCE, QUIET, Opened, settled_box

from fractal_exp import IFS, View, codes, render
from fractal_exp.evaluation.metrics import f1
from fractal_exp.ifs import attractor
from fractal_exp.suite import random_suite

LEAST_F1 = 0.97
MOST_CHI_SQUARE = 0.8                  # a part; two independent counts of points would have 1, of lit subpixels less
BLOCK, SUBPIXELS, LEAST_COUNT = 8, 64, 20  # pixels a side of a part; in a pixel; lit in a part that counts
MORE = [pytest.param(name, marks=pytest.mark.slow) for name in ("suite-011", "heighway_dragon", "maple_leaf")]
BY_LOT = {("maple_leaf", 1e6), ("suite-011", 1e6)}  # where words are drawn by lot, parts are less even than `render`'s


def named(name: str) -> IFS:
    return attractor.normalize(random_suite(12)[11] if name == "suite-011" else codes.known(name))


def address(path, view: View, query: str = "") -> str:
    (x, y), zoom = view.center, view.zoom
    return f"file://{path}{query}#x={x!r}&y={y!r}&zoom={zoom!r}"


def alike(picture: np.ndarray, code: IFS, view: View) -> float:
    truth = render(code, view, resolution=len(picture))
    return float(f1(torch.tensor(picture, dtype=torch.float32)[None], truth[None]))


def chi_square(one: np.ndarray, other: np.ndarray) -> float:
    """Pearson's statistic of the lit subpixels in square parts of two pictures, a part: whether the points are
    distributed alike, whatever their number."""
    a, b = (SUBPIXELS * np.asarray(each, float).reshape(len(each) // BLOCK, BLOCK, -1, BLOCK).sum((1, 3))
            for each in (one, other))
    a = a * b.sum() / a.sum()
    a, b = (each[a + b >= LEAST_COUNT] for each in (a, b))
    return float(((a - b) ** 2 / (a + b)).mean())


def shown_view(opened: Opened, wanted: Callable[[View], bool]) -> View:
    """The view that the link names, once it is one that is wanted, or the last within a minute: a page writes its
    address a while after it has moved."""
    end = time.monotonic() + PATIENCE / 1000
    while True:
        opened.page.wait_for_timeout(500)  # browsers refuse to write an address more often
        found = re.search(r"#x=(.+)&y=(.+)&zoom=(.+)", opened.page.url)
        view = View((float(found[1]), float(found[2])), float(found[3])) if found else None
        if view and wanted(view) or time.monotonic() > end:
            return view


def agrees(picture: np.ndarray, code: IFS, view: View, resolution: tuple[int, int]) -> bool:
    """Whether a picture that is not square has the size and the lit pixels of `render`'s."""
    truth = render(code, view, resolution=resolution)
    return picture.shape == resolution and float(f1(torch.tensor(picture, dtype=torch.float32)[None],
                                                    truth[None])) >= LEAST_F1


def test_the_picture_fills_a_window_of_any_format_as_render_draws_it(fern, open_page):
    code, path = fern
    for width, height in ((240, 96), (96, 160)):
        assert agrees(open_page((width, height)).go(address(path, View((0.1, 0.2), 2))).picture(), code,
                      View((0.1, 0.2), 2), (height, width))


@pytest.mark.parametrize("window", [(700, 500), pytest.param((420, 640), marks=pytest.mark.slow)])
def test_a_picture_of_a_given_size_is_scaled_into_any_window(fern, tmp_path, open_page, window):
    code, view = fern[0], View((0.1, 0.2), 2)
    path = code.save_html(tmp_path / "wide.html", view=view, resolution=(90, 160))
    opened = open_page(window).go(f"file://{path}")
    assert agrees(opened.picture(), code, view, (90, 160))
    box = opened.page.locator("#picture").bounding_box()
    assert box["width"] == pytest.approx(min(window[0], window[1] * 160 / 90), abs=1)
    assert box["height"] == pytest.approx(box["width"] * 90 / 160, abs=1)
    assert [box["x"] + box["width"] / 2, box["y"] + box["height"] / 2] == pytest.approx([w / 2 for w in window], abs=1)

    # A hand moves the picture by what the hand moves: half of the shorter side is 1 / zoom.
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    opened.page.mouse.move(*middle)
    opened.page.mouse.down()
    opened.page.mouse.move(middle[0] - box["height"] / 4, middle[1])
    opened.page.mouse.up()
    moved = shown_view(opened, lambda found: found.center[0] > 0.2)
    assert moved.center == pytest.approx((0.1 + 0.5 / view.zoom, 0.2), abs=0.02) and moved.zoom == view.zoom

    # The maps lie on the picture.
    opened.page.keyboard.press("e")
    opened.page.wait_for_selector("#maps:not([hidden])")
    boxes = [opened.page.locator(name).bounding_box() for name in ("#picture", "#maps")]
    assert boxes[0] == boxes[1] and boxes[0]["height"] == pytest.approx(boxes[0]["width"] * 90 / 160, abs=1)
    assert agrees(opened.drawn().picture(), code, moved, (90, 160))


def test_a_click_selects_the_map_that_is_seen_there(fern, tmp_path, open_page):
    path = fern[0].save_html(tmp_path / "wide.html", resolution=(90, 160))
    opened = open_page((1000, 900), **COARSE).go(f"file://{path}")
    opened.page.keyboard.press("e")
    opened.page.wait_for_selector("#maps:not([hidden])")
    window, polygons = settled_box(opened.page.locator("#maps")), opened.page.locator("#maps .bodies polygon")
    corners = [np.array([corner.split(",") for corner in polygons.nth(i).get_attribute("points").split()], float)
               for i in range(len(fern[0]))]

    def holds(corners: np.ndarray, point: np.ndarray) -> bool:
        side, to = np.roll(corners, -1, 0) - corners, point - corners
        turns = np.sign(side[:, 0] * to[:, 1] - side[:, 1] * to[:, 0])
        return abs(turns.sum()) == len(turns)

    chosen = set()
    for each in corners:
        place = np.array([0.4, 0.15, 0.1, 0.35]) @ each  # beside the handles of a map that is selected
        opened.page.mouse.click(window["x"] + place[0], window["y"] + place[1])
        chosen.add(int(opened.page.locator("#which").input_value()))
        assert holds(corners[int(opened.page.locator("#which").input_value())], place)
    assert len(chosen) > 1


def test_a_page_from_a_file_says_nothing_and_asks_for_nothing(fern, open_page):
    _, path = fern
    opened = open_page((700, 400), **COARSE).go(f"file://{path}")
    assert opened.said == [] and opened.asked == [f"file://{path}"]
    assert opened.text("title") == "Barnsley's fern (black spleenwort)"
    assert opened.text("zoom") == "×\u202f1" and opened.text("address") == "whole"
    assert opened.text("points").endswith("points")   # how many depends on how busy the machine is
    assert not opened.page.is_visible("#poster")


@pytest.mark.parametrize("name", ["fern", *MORE])
def test_stills_agree_with_render_at_any_zoom(name, tmp_path, open_page):
    code = named(name)
    path = code.save_html(tmp_path / "page.html")
    point = attractor.random_point(code, 3)
    for view in (View(), View(point, 64), View(point, 1e6)):
        picture = open_page().go(address(path, view)).picture()
        truth = render(code, view, resolution=128)
        assert picture.shape == (128, 128) and alike(picture, code, view) >= LEAST_F1
        assert picture.mean() == pytest.approx(float(truth.mean()), rel=0.15)
        assert (name, view.zoom) in BY_LOT or chi_square(picture, truth) <= MOST_CHI_SQUARE


def test_the_gpu_throws_the_same_picture_as_the_processor(fern, open_page):
    code, path = fern
    view = View(attractor.random_point(code, 3), 1e6)
    pictures = [open_page(96).go(address(path, view, f"?thrower={thrower}")).picture() for thrower in ("gpu", "cpu")]
    for picture in pictures:
        assert alike(picture, code, view) >= LEAST_F1
    assert pictures[0].mean() == pytest.approx(pictures[1].mean(), rel=0.03)


@pytest.mark.parametrize("name", ["fern", *MORE])
def test_no_view_on_the_attractor_is_black_down_to_a_billion(name, tmp_path, open_page):
    code = named(name)
    path = code.save_html(tmp_path / "page.html")
    for seed, zoom in enumerate((1e5, 1e7, 1e9)):
        picture = open_page(64).go(address(path, View(attractor.random_point(code, seed), zoom))).picture()
        assert (picture > 0).mean() > 0.01


def test_points_do_not_swim_where_a_deep_view_is_moved(fern, open_page):
    code, path = fern
    opened = open_page().go(address(path, View(attractor.random_point(code, 3), 1e9)))
    before, url_before = opened.picture(), opened.page.url
    opened.page.mouse.move(90, 60)
    opened.page.mouse.down()
    opened.page.mouse.move(50, 70)
    opened.page.mouse.up()
    opened.page.wait_for_url(lambda url: url != url_before)
    opened.page.wait_for_timeout(300)
    after = opened.drawn().picture()
    a, b = (torch.tensor(part, dtype=torch.float32)[None] for part in (before[:-10, 40:], after[10:, :-40]))
    assert float(f1(a, b)) >= LEAST_F1


def test_the_wheel_zooms_a_million_times_to_the_pointer(open_page, tmp_path):
    """The origin, a fixed point of the dragon's, stays under the pointer; there the picture agrees with `render`."""
    code = codes.known("heighway_dragon")
    path = code.save_html(tmp_path / "dragon.html")
    opened = open_page().go(address(path, View((0.25, 0.25), 2.0)))
    opened.page.mouse.move(32, 96)
    while "million" not in opened.text("zoom"):
        opened.page.mouse.wheel(0, -120)
    view = shown_view(opened, lambda view: view.zoom > 9e5)
    opened.drawn()
    quarter = 0.5 / view.zoom
    assert view.zoom > 9e5 and max(abs(part - quarter) for part in view.center) < 1e-3 * quarter
    assert alike(opened.picture(), code, view) >= LEAST_F1


def test_the_keyboard_alone_moves_zooms_and_goes_home(fern, open_page):
    _, path = fern
    opened = open_page((600, 300), **COARSE).go(f"file://{path}")
    press = opened.page.keyboard.press
    for key in ["PageUp", "PageUp", "ArrowUp", "+"]:
        press(key)
        opened.page.wait_for_timeout(300)
    view = shown_view(opened, lambda view: view.zoom == pytest.approx(96))
    assert view.zoom == pytest.approx(96) and view.center == (0, pytest.approx(0.24 / 64))
    press("0")
    assert shown_view(opened, lambda view: view == View()) == View()
    press("h")
    assert opened.page.is_visible("#help")
    press("Escape")
    opened.page.wait_for_selector("#picture:focus")  # where the keys go once the help is closed
    assert not opened.page.is_visible("#help")
    labels = []
    for _ in range(9):
        press("Tab")
        labels.append(opened.page.locator(":focus").get_attribute("aria-label"))
    assert labels == ["Zoom in", "Zoom out", "Show the whole", "Edit the maps", "Colours", "Swap light and dark",
                      "Copy the link to this view", "Save the picture as PNG", "Help"]
    press("Enter")
    assert opened.page.is_visible("#help") and opened.said == []


def test_a_light_page_draws_dark_on_white_and_can_be_swapped(fern, open_page):
    _, path = fern
    opened = open_page(scheme="light").go(f"file://{path}")
    light = opened.picture()
    opened.page.keyboard.press("i")
    dark = opened.picture()
    assert light[0, 0] == 1 and dark[0, 0] == 0 and np.abs(1 - light - dark).max() < 0.01
    opened.page.emulate_media(color_scheme="dark")
    opened.page.wait_for_timeout(200)
    assert opened.picture()[0, 0] == 1


def test_pinching_zooms(fern, open_page):
    _, path = fern
    opened = open_page((400, 400), **COARSE, has_touch=True).go(f"file://{path}")
    touch = opened.page.context.new_cdp_session(opened.page)
    for kind, spread in (("touchStart", 40), ("touchMove", 80), ("touchMove", 160), ("touchEnd", None)):
        points = [] if spread is None else [{"x": 200 + sign * spread, "y": 150, "id": k} for k, sign in
                                            enumerate((-1, 1))]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    assert shown_view(opened, lambda view: view.zoom > 3.9).zoom == pytest.approx(4, rel=0.01)


FRAMES = {"srcdoc": "{frame}", "blob": """<template>{frame}</template>
<script>const frame = document.querySelector("template").content.querySelector("iframe");
frame.src = URL.createObjectURL(new Blob([frame.srcdoc], {{type: "text/html"}}));
frame.removeAttribute("srcdoc");
document.body.append(frame);</script>"""}


@pytest.mark.parametrize("kind", ["srcdoc", pytest.param("blob", marks=pytest.mark.slow)])
def test_a_sandboxed_frame_draws_and_offers_what_it_may_not_save(fern, open_page, tmp_path, kind):
    code, _ = fern
    (tmp_path / "notebook.html").write_text(
        f"<!doctype html><title>n</title><body>{FRAMES[kind].format(frame=code._repr_html_())}")
    opened = open_page((700, 520), **COARSE)
    opened.page.goto(f"file://{tmp_path}/notebook.html")
    frame = opened.page.wait_for_selector("iframe").content_frame()
    opened.drawn(frame)
    assert frame.url.split(":")[0] == ("blob" if kind == "blob" else "about")
    frame.click("#do-save")
    frame.wait_for_selector("#still[src^='data:image/png']")
    assert "lets no page save files" in frame.inner_text("#why")
    assert frame.input_value("#text").startswith("View(center=")
    frame.click("#offer button")
    frame.click("#do-link")
    frame.wait_for_selector("#offer[open]")
    assert frame.input_value("#text") == "View(center=(0, 0), zoom=1)" and not frame.is_visible("#still")
    assert opened.said == [] and all(url.startswith(("file://", "blob:", "data:", "about:")) for url in opened.asked)


def test_a_name_is_text_whatever_it_holds(fern, open_page, tmp_path):
    code, _ = fern
    name = "</script><script>document.title = 'taken'</script><img src=x onerror=alert(1)>&amp; $title ${x}"
    path = IFS(code.linear, code.offset, code.probabilities, {"title": name}).save_html(tmp_path / "hostile.html")
    opened = open_page((500, 300), **COARSE).go(f"file://{path}")
    assert opened.text("title") == name and opened.page.title() == name
    assert opened.said == [] and opened.asked == [f"file://{path}"]


def test_without_webgl_a_still_is_shown_and_the_reason_said(fern, playwright):
    _, path = fern
    browser = playwright.chromium.launch(executable_path=CHROMIUM,
                                         args=[*QUIET, "--disable-gpu", "--disable-3d-apis"])
    opened = Opened(browser.new_page())
    opened.page.goto(f"file://{path}")
    assert opened.page.is_visible("#poster") and opened.text("note") == (
        "A still picture only: this browser has no WebGL 2")
    browser.close()


def test_without_scripts_the_still_is_shown(fern, open_page):
    _, path = fern
    opened = open_page((300, 300), **COARSE, java_script_enabled=False)
    opened.page.goto(f"file://{path}")
    assert opened.page.is_visible("#poster")


def test_a_view_beside_the_attractor_says_so(fern, open_page):
    _, path = fern
    opened = open_page((600, 300), **COARSE).go(address(path, View((40, 40), 3)))
    assert opened.text("points") == "nothing here" and "press 0 for the whole" in opened.text("note")
