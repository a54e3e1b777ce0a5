"""Codes that a page reads and writes."""

import json

import pytest
import torch
from browser_helpers import COARSE
from editing_helpers import WINDOW, close, code_of, dialog, likeness, same, with_maps

from fractal_exp import IFS, codes
from fractal_exp.ifs import attractor

WILD = "<img src=x onerror=\"document.title='taken'\"><script>document.title='taken'</script>"
HOSTILE = [
    ("[[0.5,0,0,0.5,0,NaN]]", "the text is not JSON"),
    ("[[1.5,0,0,0.5,0,0]]", "since map 1 has singular value 1.5; shrink its matrix"),
    (f'{{"{WILD}": 1}}'.replace('"document', "'").replace("taken'\"", ""), "unknown keys '<img src=x"),
    ("fern { .5 0 0 .5 0 0 }", "`fractal-convert FILE code.json` makes JSON"),
    ('<flame name="&lt;script&gt;alert(1)&lt;/script&gt;"/>', "`fractal-convert FILE code.json` makes JSON"),
    ("[" + ",".join(["[0,0,0,0,0,0]"] * 200_000) + "]", "at most 1000 maps, got 200000"),
]


@pytest.fixture(scope="module")
def shared(fern, pages):
    """One such page for all tests that leave its code as it was: to open one takes seconds."""
    with pages.lent() as open_page:
        yield with_maps(open_page(WINDOW, **COARSE).go(f"file://{fern[1]}"))


def test_what_is_not_edited_is_exported_to_the_last_bit(fern, editing):
    code, _ = fern
    back = code_of(editing())
    assert same(back, code) and torch.equal(back.probabilities, code.probabilities)
    assert back.meta["title"] == "Barnsley's fern (black spleenwort)" and back.meta["name"] == "fern"


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
    opened.page.locator("#picture").focus()
    opened.page.keyboard.press("o")
    opened.page.set_input_files("#in-file", dragon.save(tmp_path / "dragon.flame"))
    opened.page.wait_for_selector("#in-said:has-text('fractal-convert FILE code.json')")
    opened.page.set_input_files("#in-file", dragon.save(tmp_path / "dragon.json"))
    opened.page.wait_for_selector("#in", state="hidden")
    assert same(code_of(opened), dragon) and opened.text("title") == WILD == opened.page.title()
    assert likeness(opened, attractor.normalize(dragon), least=0.95) >= 0.95
    opened.page.click("#maps-undo")
    assert same(code_of(opened), fern[0]) and opened.text("title") == "Barnsley's fern (black spleenwort)"
    assert opened.said == [] and len(opened.asked) == 1


@pytest.mark.parametrize("key", ["json", "svg"])
def test_a_code_and_its_drawing_are_saved(fern, shared, tmp_path, key):
    code, _ = fern
    opened = shared
    dialog(opened, "out")
    opened.page.select_option("#out-format", key)
    with opened.page.expect_download() as download:
        opened.page.click("#out-save")
    assert download.value.suggested_filename == f"barnsley-s-fern-black-spleenwort.{key}"
    path = tmp_path / f"code.{key}"
    download.value.save_as(path)
    close(opened, "out")
    if key == "svg":
        assert len(path.read_bytes()) > 10_000
    else:
        assert same(IFS.load(path), code) and torch.equal(IFS.load(path).probabilities, code.probabilities)


def test_a_sandboxed_frame_offers_the_text_of_a_code(fern, open_page, tmp_path):
    code, _ = fern
    (tmp_path / "notebook.html").write_text(f"<!doctype html><title>n</title>{code._repr_html_()}")
    opened = open_page((900, 520), **COARSE)
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
    assert opened.said == []
