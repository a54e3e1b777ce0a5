"""Maps that are bent in the page: by mouse, touch and keys, at any depth, in and out of every format."""

import json
import re
import time

import numpy as np
import pytest
import torch
from conftest import PATIENCE, Opened, pages

from fractal_exp import IFS, View, codes, render
from fractal_exp.evaluation.metrics import f1
from fractal_exp.ifs import attractor

VIEW = View()
SIDE, PANEL = 600, 388  # pixels of the picture, and of what lies beside it
UNIT = SIDE / 2         # pixels to a unit of the canvas
WILD = "<img src=x onerror=\"document.title='taken'\"><script>document.title='taken'</script>"
HOSTILE = [
    ("[[0.5,0,0,0.5,0,NaN]]", "the file is not JSON"),
    ("[[1.5,0,0,0.5,0,0]]", "map 1 does not contract: it has singular value 1.5"),
    (f'{{"{WILD}": 1}}'.replace('"document', "'").replace("taken'\"", ""), "unknown keys '<img src=x"),
    (f"{WILD[:20]}{{ x }}".replace("<img", "img"), "entry 'img src=x onerror=\"': has 1 numbers"),
    ("fern { .5 0 0 .5 0 nan }", "entry 'fern': number 6 must be a number, got 'nan'"),
    ('<!DOCTYPE f [<!ENTITY a "aaaa">]><flame name="&a;"/>', "the file declares a document type or an entity"),
    ('<flame name="&lt;script&gt;alert(1)&lt;/script&gt;"/>', "flame '<script>alert(1)</script>': the code has no map"),
    ('<flame><xform weight="1" swirl="1" coefs="1 0 0 1 0 0"/></flame>', "variation or parameter 'swirl'"),
    ("[" + ",".join(["[0,0,0,0,0,0]"] * 200_000) + "]", "at most 1000 maps, got 200000"),
]


@pytest.fixture(scope="module")
def fern(tmp_path_factory):
    code = attractor.normalize(codes.known("fern"))
    return code, code.save_html(tmp_path_factory.mktemp("page") / "fern.html")


@pytest.fixture
def editing(fern, open_page):
    """Opens the fern's page with its maps shown."""
    def opened(side=(SIDE + PANEL, SIDE), fragment="", **settings) -> Opened:
        return with_maps(open_page(side, **settings).go(f"file://{fern[1]}{fragment}"))

    return opened


@pytest.fixture(scope="module")
def shared(fern, browser):
    """One such page for all tests that leave its code as it was: to open one takes seconds."""
    with pages(browser) as open_page:
        yield with_maps(open_page((SIDE + PANEL, SIDE)).go(f"file://{fern[1]}"))


def with_maps(opened: Opened) -> Opened:
    opened.page.click("#do-edit")
    opened.page.wait_for_selector("#panel")
    return opened


def select(opened: Opened, number: int) -> None:
    opened.page.select_option("#which", str(number))
    opened.page.wait_for_selector(f"#handle-move[aria-label*='map {number + 1},']")


def dialog(opened: Opened, name: str) -> None:
    """Open the dialog that reads a code, or the one that writes it."""
    opened.page.locator("#picture").focus()
    opened.page.keyboard.press({"in": "o", "out": "x"}[name])
    opened.page.wait_for_selector(f"#{name}[open]")


def close(opened: Opened, name: str) -> None:
    opened.page.keyboard.press("Escape")
    opened.page.wait_for_selector(f"#{name}", state="hidden")


def exported(opened: Opened, key: str = "json") -> str:
    dialog(opened, "out")
    opened.page.select_option("#out-format", key)
    text = opened.page.input_value("#out-text")
    close(opened, "out")
    return text


def code_of(opened: Opened) -> IFS:
    return IFS.from_json(json.loads(exported(opened)))


def middle(opened: Opened, kind: str) -> tuple[float, float]:
    """Where a handle is, once it has come to rest."""
    before, box = None, opened.page.locator(f"#handle-{kind} .plate").bounding_box()
    while box is None or box != before:
        opened.page.wait_for_timeout(100)
        before, box = box, opened.page.locator(f"#handle-{kind} .plate").bounding_box()
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def likeness(opened: Opened, code: IFS, view: View = VIEW, least: float = 0.0) -> float:
    """F1 of the picture that is seen, once it is drawn, and of the code's. A page takes a while until it begins to draw
    what was changed, so `least` is waited for."""
    truth = render(code, view, resolution=SIDE)[None]
    end = time.monotonic() + PATIENCE / 1000
    while True:
        found = float(f1(torch.tensor(opened.drawn().picture(), dtype=torch.float32)[None], truth))
        if found >= least or time.monotonic() > end:
            return found
        opened.page.wait_for_timeout(100)


def drag(opened: Opened, kind: str, dx: float, dy: float) -> None:
    x, y = middle(opened, kind)
    mouse = opened.page.mouse
    mouse.move(x, y)
    mouse.down()
    for share in (0.3, 0.7, 1):
        mouse.move(x + share * dx, y + share * dy)
    mouse.up()


def outwards(opened: Opened, kind: str, pixels: float) -> tuple[float, float]:
    """Pixels away from the map's centre, on either side of which a handle may stand."""
    (x, y), (x0, y0) = middle(opened, kind), middle(opened, "move")
    length = np.hypot(x - x0, y - y0)
    return pixels * (x - x0) / length, pixels * (y - y0) / length


def typed(opened: Opened, name: str, text: str) -> None:
    opened.page.fill(f"#{name}", text)
    opened.page.keyboard.press("Enter")


def same(a: IFS, b: IFS) -> bool:
    return torch.equal(a.linear, b.linear) and torch.equal(a.offset, b.offset)


def test_the_page_opens_as_a_viewer_and_the_maps_come_and_go(fern, open_page):
    opened = open_page((SIDE + PANEL, SIDE)).go(f"file://{fern[1]}")
    assert not opened.page.is_visible("#panel") and not opened.page.is_visible("#handle-move")
    opened.page.keyboard.press("e")
    opened.page.wait_for_selector("#maps .map-3 > text", state="attached")
    assert opened.page.is_visible("#panel") and opened.page.is_visible("#handle-move")
    assert opened.page.locator("#maps .map > text").count() == 4
    assert opened.page.get_attribute("#do-edit", "aria-pressed") == "true"
    opened.page.keyboard.press("e")
    assert not opened.page.is_visible("#panel") and not opened.page.is_visible("#handle-move")


def test_what_is_not_edited_is_exported_to_the_last_bit(fern, editing):
    code, _ = fern
    back = code_of(editing())
    assert same(back, code) and torch.equal(back.probabilities, code.probabilities)
    assert back.meta["title"] == "Barnsley's fern (black spleenwort)" and back.meta["name"] == "fern"


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


@pytest.mark.parametrize(("kind", "away", "across", "check"), [
    ("turn", 0, (40, 0), lambda a, b: np.allclose(a.T @ a, b.T @ b, atol=1e-6) and not np.allclose(a, b, atol=1e-2)),
    ("scale", 10, (0, 0), lambda a, b: np.allclose(a / b, (a / b)[0, 0], rtol=1e-4) and a[0, 0] > 1.02 * b[0, 0]),
    ("first", -10, (0, 6), lambda a, b: np.allclose(a[:, 1], b[:, 1]) and np.abs(a - b)[:, 0].min() > 1e-3),
    ("second", -12, (9, 0), lambda a, b: np.allclose(a[:, 0], b[:, 0]) and np.abs(a - b)[:, 1].min() > 1e-3),
])
def test_every_handle_bends_the_matrix_in_its_way(fern, editing, kind, away, across, check):
    opened = editing()
    select(opened, 1)
    along = outwards(opened, kind, away)
    drag(opened, kind, along[0] + across[0], along[1] + across[1])
    assert check(code_of(opened).linear[1].double().numpy(), fern[0].linear[1].double().numpy())


def test_a_map_that_is_stretched_too_far_still_contracts_and_that_is_said(editing):
    opened = editing()
    select(opened, 1)
    drag(opened, "second", *outwards(opened, "second", 150))
    opened.page.wait_for_selector("#maps-said:has-text('must contract')")
    assert 0.99 < float(code_of(opened).singular_values()[1, 0]) < 1


def test_by_keyboard_alone_a_map_is_selected_moved_and_put_back(fern, open_page):
    code, path = fern
    opened = open_page((SIDE + PANEL, SIDE)).go(f"file://{path}")
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


def test_every_control_has_a_name(shared):
    names = [(each.get_attribute("id"), each.evaluate("(e) => e.ariaLabel || e.labels?.[0]?.textContent.trim() || "
                                                      "e.textContent.trim()"))
             for each in shared.page.locator("button, input, select, textarea, [tabindex]").all()]
    assert len(names) > 40 and all(name for _, name in names), names


def test_numbers_are_typed_and_what_does_not_contract_is_refused(fern, editing):
    code, _ = fern
    opened = editing()
    select(opened, 1)
    typed(opened, "number-a", "0.5")
    typed(opened, "number-f", "-0.125")
    edited = code_of(opened)
    assert edited.linear[1, 0, 0] == 0.5 and edited.offset[1, 1] == -0.125
    for name, text, message in (("number-a", "1.2", "does not contract"), ("number-b", "", "b must be a number"),
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
    shapes = [shape.bounding_box() for shape in opened.page.locator("#maps .map > .halo").all()]
    opened.page.mouse.click(shapes[2]["x"] + shapes[2]["width"] / 2, shapes[2]["y"] + shapes[2]["height"] / 2)
    opened.page.wait_for_selector("#handle-move[aria-label*='map 3,']")
    assert opened.page.input_value("#which") == "2"


def test_a_map_is_moved_by_a_finger(fern, editing):
    opened = editing(has_touch=True)
    select(opened, 3)
    x, y = middle(opened, "move")
    touch = opened.page.context.new_cdp_session(opened.page)
    for kind, by in (("touchStart", 0), ("touchMove", 20), ("touchMove", 50), ("touchEnd", None)):
        points = [] if by is None else [{"x": x + by, "y": y, "id": 1}]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    assert (code_of(opened).offset - fern[0].offset)[3].tolist() == [pytest.approx(50 / UNIT, abs=1e-4), 0]


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


@pytest.mark.parametrize(("text", "message"), HOSTILE, ids=range(len(HOSTILE)))
def test_a_hostile_text_is_refused_as_text(fern, shared, text, message):
    opened = shared
    dialog(opened, "in")
    opened.page.fill("#in-text", text)
    opened.page.click("#in-read")
    assert message in opened.page.locator("#in-said").text_content()
    assert opened.page.locator("#in-said *").count() == 0 and opened.page.title() != "taken"
    close(opened, "in")
    assert same(code_of(opened), fern[0]) and opened.said == [] and len(opened.asked) == 1


def test_files_are_opened_and_their_names_stay_text(fern, editing, tmp_path):
    opened = editing()
    dragon = IFS(*(getattr(codes.known("heighway_dragon"), part) for part in ("linear", "offset")), None,
                 {"name": WILD, "title": WILD})
    for name in ("dragon.json", "dragon.flame"):
        opened.page.locator("#picture").focus()
        opened.page.keyboard.press("o")
        opened.page.set_input_files("#in-file", dragon.save(tmp_path / name))
        opened.page.wait_for_selector("#in", state="hidden")
        assert same(code_of(opened), dragon) and opened.text("title") == WILD == opened.page.title()
    assert likeness(opened, attractor.normalize(dragon), least=0.95) >= 0.95
    opened.page.click("#maps-undo")
    opened.page.click("#maps-undo")
    assert same(code_of(opened), fern[0]) and opened.text("title") == "Barnsley's fern (black spleenwort)"
    assert opened.said == [] and len(opened.asked) == 1


def test_one_of_several_codes_in_a_file_is_chosen(editing):
    opened = editing()
    opened.page.keyboard.press("o")
    opened.page.fill("#in-text", f"first {{ .5 0 0 .5 0 0 }}\n{WILD} {{ .4 0 0 .4 0 0 1 .3 0 0 .3 1 1 3 }}\n"
                                 "bad { x }")
    opened.page.click("#in-read")
    assert opened.page.locator("#in-which option").all_text_contents() == ["first", WILD, "bad"]
    opened.page.select_option("#in-which", "2")
    opened.page.click("#in-take")
    assert "entry 'bad': has 1 numbers" in opened.text("in-said")
    opened.page.select_option("#in-which", "1")
    opened.page.click("#in-take")
    opened.page.wait_for_selector("#in", state="hidden")
    assert code_of(opened).probabilities.tolist() == [0.25, 0.75] and opened.text("title") == WILD


@pytest.mark.parametrize(("key", "suffix"), [("json", "json"), ("rows", "json"), ("lists", "json"), ("fractint", "ifs"),
                                             ("flame", "flame"), ("svg", "svg"), ("ply", "ply")])
def test_every_format_is_saved_and_read_again(fern, shared, tmp_path, key, suffix):
    code, _ = fern
    opened = shared
    dialog(opened, "out")
    opened.page.select_option("#out-format", key)
    with opened.page.expect_download() as download:
        opened.page.click("#out-save")
    assert download.value.suggested_filename == f"barnsley-s-fern-black-spleenwort.{suffix}"
    path = tmp_path / f"code.{suffix}"
    download.value.save_as(path)
    close(opened, "out")
    if suffix in ("svg", "ply"):
        assert len(path.read_bytes()) > (3_000_000 if suffix == "ply" else 10_000)
    else:
        assert same(IFS.load(path), code) and torch.equal(IFS.load(path).probabilities, code.probabilities)


def test_the_drawing_opens_in_a_browser_with_maps_over_the_shape(shared, open_page, tmp_path):
    (tmp_path / "maps.svg").write_text(exported(shared, "svg"))
    drawing = open_page(300)
    drawing.page.goto(f"file://{tmp_path}/maps.svg")
    assert drawing.page.locator("polygon").count() == 4 and drawing.page.locator("image").count() == 1
    assert drawing.said == []


def test_a_sandboxed_frame_offers_the_text_of_a_code(fern, open_page, tmp_path):
    code, _ = fern
    (tmp_path / "notebook.html").write_text(f"<!doctype html><title>n</title>{code._repr_html_()}")
    opened = open_page((900, 520))
    opened.page.goto(f"file://{tmp_path}/notebook.html")
    opened.page.wait_for_timeout(200)
    frame = opened.page.frames[-1]
    opened.drawn(frame)
    frame.click("#do-edit")
    frame.select_option("#which", "1")
    frame.click("#maps-flip")
    frame.click("#maps-export")
    assert not frame.is_visible("#out-save") and "lets no page save files" in frame.inner_text("#out-said")
    edited = IFS.from_json(json.loads(frame.input_value("#out-text")))
    assert len(edited) == 4 and not same(edited, code)
    frame.click("#out-copy")
    frame.wait_for_selector("#out-said:has-text('Copy the selected text')")
    frame.select_option("#out-format", "ply")
    assert "Nor can this file be copied" in frame.inner_text("#out-said") and not frame.is_visible("#out-copy")
    assert opened.said == []


@pytest.mark.parametrize("size", [(360, 640), (700, 480), (1280, 800)])
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


def test_a_thousand_maps_are_edited(open_page, tmp_path):
    generator = torch.Generator().manual_seed(0)
    code = IFS((torch.rand(1000, 2, 2, generator=generator) - 0.5) / 9, torch.rand(1000, 2, generator=generator))
    opened = open_page((SIDE + PANEL, SIDE)).go(f"file://{code.save_html(tmp_path / 'many.html')}")
    opened.page.click("#do-edit")
    select(opened, 777)
    drag(opened, "move", 30, 0)
    moved = code_of(opened)
    assert int(((moved.offset - code.offset).abs().sum(1) > 0).sum()) == 1
    opened.page.click("#maps-add")
    assert re.search("at most 1000 maps", opened.text("maps-said"))
