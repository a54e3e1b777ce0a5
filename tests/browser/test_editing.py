"""Maps that are bent in the page: by mouse, touch and keys, at any depth."""


import math

import numpy as np
import pytest
import torch
from browser_helpers import COARSE
from editing_helpers import UNIT, WINDOW, code_of, drag, likeness, middle, outwards, same, select, typed

from fractal_exp import View
from fractal_exp.ifs import attractor


def test_the_page_opens_as_a_viewer_and_the_maps_come_and_go(fern, open_page):
    opened = open_page(WINDOW, **COARSE).go(f"file://{fern[1]}")
    assert not opened.page.is_visible("#panel") and not opened.page.is_visible("#handle-move")
    opened.page.keyboard.press("e")
    opened.page.wait_for_selector("#maps .map-3 > text", state="attached")
    assert opened.page.is_visible("#panel") and opened.page.is_visible("#handle-move")
    assert opened.page.locator("#maps .map > text").count() == 4
    assert opened.page.get_attribute("#do-edit", "aria-pressed") == "true"
    opened.page.keyboard.press("e")
    assert not opened.page.is_visible("#panel") and not opened.page.is_visible("#handle-move")


def test_a_handle_is_dragged_and_code_and_picture_follow(fern, editing):
    code, _ = fern
    opened = editing()
    select(opened, 2)
    drag(opened, "move", 50, -30)
    moved = code_of(opened)
    assert torch.equal(moved.linear, code.linear)
    by = (moved.offset - code.offset).tolist()
    assert by == [[0, 0], [0, 0], pytest.approx([50 / UNIT, 30 / UNIT], abs=1e-5), [0, 0]]
    assert likeness(opened, moved, least=0.96) >= 0.96 and likeness(opened, code) < 0.9
    opened.page.click("#maps-undo")
    assert same(code_of(opened), code)  # the whole drag at once
    opened.page.click("#maps-redo")
    assert same(code_of(opened), moved) and opened.said == [] and len(opened.asked) == 1


BENT = {  # handle -> how far outwards it is taken and moved, and what that does to the matrix
    "turn": (0, (40, 0), lambda a, b: np.allclose(a.T @ a, b.T @ b, atol=1e-6) and not np.allclose(a, b, atol=1e-2)),
    "scale": (10, (0, 0), lambda a, b: np.allclose(a / b, (a / b)[0, 0], rtol=1e-4) and a[0, 0] > 1.02 * b[0, 0]),
    "first": (-10, (0, 6), lambda a, b: np.allclose(a[:, 1], b[:, 1]) and np.abs(a - b)[:, 0].min() > 1e-3),
    "second": (-12, (9, 0), lambda a, b: np.allclose(a[:, 0], b[:, 0]) and np.abs(a - b)[:, 1].min() > 1e-3),
}


def test_every_handle_bends_the_matrix_in_its_way(fern, editing):
    opened = editing()
    select(opened, 1)
    for kind, (away, across, check) in BENT.items():
        along = outwards(opened, kind, away)
        drag(opened, kind, along[0] + across[0], along[1] + across[1])
        assert check(code_of(opened).linear[1].double().numpy(), fern[0].linear[1].double().numpy()), kind
        opened.page.click("#maps-undo")
        assert same(code_of(opened), fern[0])


def test_a_map_that_is_stretched_too_far_still_contracts_and_that_is_said(editing):
    opened = editing()
    select(opened, 1)
    drag(opened, "second", *outwards(opened, "second", 150))
    opened.page.wait_for_selector("#maps-said:has-text('must contract')")
    edited = code_of(opened)
    assert edited.contraction.exponent == pytest.approx(math.log(0.999), abs=1e-4)
    assert float(edited.singular_values()[1, 0]) > 1


def test_by_keyboard_alone_a_map_is_selected_moved_and_put_back(fern, open_page):
    code, path = fern
    opened = open_page(WINDOW, **COARSE).go(f"file://{path}")
    press = opened.page.keyboard.press
    for key in ("e", "m", "m", "Tab"):
        press(key)
    if opened.page.locator(":focus").get_attribute("id") != "handle-move":
        press("Tab")
    opened.page.wait_for_selector("#handle-move:focus[aria-label='Move: map 3, arrow keys']")
    for key in ("ArrowRight", "ArrowRight", "Shift+ArrowUp"):
        press(key)
    moved = code_of(opened)
    assert (moved.offset - code.offset)[2].tolist() == pytest.approx([4 / UNIT, 20 / UNIT], abs=1e-5)
    press("Control+z")
    assert same(code_of(opened), code)
    press("Control+y")
    assert same(code_of(opened), moved)
    for key, count in (("a", 5), ("d", 6), ("Delete", 5), ("Control+z", 6)):
        press(key)
        assert len(code_of(opened)) == count
    press("f")
    flipped = code_of(opened)
    press("f")
    assert bool((torch.linalg.det(flipped.linear) * torch.linalg.det(code_of(opened).linear) < -1e-6).any())


def test_numbers_are_typed_and_what_does_not_contract_is_refused(fern, editing):
    code, _ = fern
    opened = editing()
    select(opened, 1)
    typed(opened, "number-a", "0.5")
    typed(opened, "number-f", "-0.125")
    edited = code_of(opened)
    assert edited.linear[1, 0, 0] == 0.5 and edited.offset[1, 1] == -0.125
    for name, text, message in (("number-a", "3", "must be contractive"), ("number-b", "", "b must be a number"),
                                ("number-e", "1e39", "not finite"), ("chance", "1.5", "from 0 to 1, got 1.5")):
        before = opened.page.input_value(f"#{name}")
        typed(opened, name, text)
        assert message in opened.text("maps-said") and opened.page.input_value(f"#{name}") == before
    assert same(code_of(opened), edited)
    opened.page.locator("#number-a").focus()
    opened.page.keyboard.press("Control+z")
    opened.page.keyboard.press("Control+z")
    assert same(code_of(opened), code)


def test_probabilities_are_typed_or_follow_the_area(fern, editing):
    opened = editing()
    select(opened, 1)
    typed(opened, "chance", "0.4")
    typed_in = code_of(opened).probabilities
    assert typed_in[1] == pytest.approx(0.4) and float(typed_in.sum()) == pytest.approx(1, abs=1e-6)
    opened.page.check("#by-area")
    assert code_of(opened).probabilities is None
    opened.page.click("#maps-add")
    assert code_of(opened).probabilities is None
    opened.page.uncheck("#by-area")
    torch.testing.assert_close(code_of(opened).probabilities, code_of(opened).sampling_probabilities())


def test_a_click_selects_the_map_under_it(editing):
    opened = editing()
    shape = opened.page.locator("#maps .map-2 > .halo").bounding_box()
    opened.page.mouse.click(shape["x"] + shape["width"] / 2, shape["y"] + shape["height"] / 2)
    opened.page.wait_for_selector("#handle-move[aria-label*='map 3,']")
    assert opened.page.input_value("#which") == "2"


def test_maps_are_bent_at_any_depth(fern, editing):
    code, _ = fern
    point = attractor.random_point(code, 3)
    opened = editing(fragment=f"#x={point[0]!r}&y={point[1]!r}&zoom=1e4")
    select(opened, 1)
    drag(opened, "move", 60, 0)
    moved = code_of(opened)
    assert float((moved.offset - code.offset)[1, 0]) == pytest.approx(60 / UNIT / 1e4, rel=0.02)
    assert likeness(opened, moved, View(point, 1e4), least=0.96) >= 0.96
    drag(opened, "turn", 40, 0)
    assert not same(code_of(opened), moved)


@pytest.mark.parametrize("size", [(360, 640), pytest.param((700, 480), marks=pytest.mark.slow), (1280, 800)])
def test_nothing_overlaps_and_all_is_in_the_window(editing, size):
    opened = editing(size)
    select(opened, 1)
    boxes = {name: opened.page.locator(name).bounding_box() for name in ("#panel", "footer", "header h1")}
    for name, box in boxes.items():
        assert box["x"] >= 0 and box["x"] + box["width"] <= size[0] and box["y"] + box["height"] <= size[1], name
    ordered = list(boxes.values())
    for i, one in enumerate(ordered):
        for other in ordered[i + 1:]:
            assert (one["x"] + one["width"] <= other["x"] or other["x"] + other["width"] <= one["x"]
                    or one["y"] + one["height"] <= other["y"] or other["y"] + other["height"] <= one["y"])
    for kind in ("move", "turn", "scale", "first", "second"):
        x, y = middle(opened, kind)
        assert 0 < x < size[0] and 0 < y < size[1]
