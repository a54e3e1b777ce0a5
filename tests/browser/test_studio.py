"""The studio in a real browser: from a dropped picture to a saved run."""

import base64
import io
import json
import re
import subprocess
import sys

import pytest
from browser_helpers import COARSE, settled_box
from PIL import Image, ImageDraw
from studio_helpers import COMMAND, SIDE, picture_of

from fractal_exp import IFS, codes

PATIENCE = 90_000  # ms
DROP = """([data, name]) => {
  const file = new File([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], name, { type: "image/png" });
  const given = new DataTransfer();
  given.items.add(file);
  document.querySelector("#drop").dispatchEvent(new DragEvent("drop", { dataTransfer: given, bubbles: true }));
}"""
WILD = "<img src=x onerror=\"document.title='taken'\">.png"


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """The command itself, which brings pictures to 64² instead of 256² for a quick search: its address and folder."""
    pytest.importorskip("websockets", reason="the studio needs `pip install 'fractal-exp[studio]'`")
    output = tmp_path_factory.mktemp("studio")
    command = [sys.executable, "-c", COMMAND, "--port", "0", "--no-browser", "--output", output]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    yield re.search(r"http://\S+", process.stdout.readline())[0], output
    process.terminate()
    process.wait(30)


def until(page, name: str, pattern: str) -> str:
    """The text of an element, once a pattern is found in it; the page's policy lets no test wait by a script there."""
    for _ in range(PATIENCE // 100):
        if re.search(pattern, text := page.inner_text(name)):
            return text
        page.wait_for_timeout(100)
    raise AssertionError(f"{name} never had {pattern}, but {text!r}")


@pytest.mark.slow
def test_from_a_dropped_picture_to_a_saved_run(studio, open_page):
    address, output = studio
    opened = open_page((1280, 860), **COARSE)
    page = opened.page
    page.goto(address)
    page.wait_for_selector("#drop span")
    assert page.is_disabled("#do-find") and page.is_disabled("#do-save")
    page.wait_for_selector("#file:enabled")
    page.evaluate(DROP, [base64.b64encode(picture_of("sierpinski_triangle")).decode(), WILD])
    page.wait_for_selector("#understood:not([hidden])")
    assert page.inner_text("#picture-name") == f"{WILD}, {SIDE} × {SIDE} px" and page.title() == "Fractal studio"
    page.wait_for_selector("#do-find:enabled")
    page.fill("#count", "3")
    page.fill("#seconds", "60")
    page.focus("#do-find")
    page.keyboard.press("Enter")
    page.wait_for_selector("#scores:not([hidden])", timeout=PATIENCE)
    assert page.is_visible("#legend") and page.is_disabled("#do-edit") and page.is_visible("#bar")
    page.reload()  # a browser that is closed in the middle loses nothing
    page.wait_for_selector("#scores:not([hidden])")
    assert "recovered" in until(page, "#verdict", ".") and page.inner_text("#map-count") == "3"
    assert page.inner_text("#dimension").startswith("Dimension: code 1.5")
    page.click("#do-edit")
    page.select_option("#which", "1")
    page.focus("#handle-move")
    page.keyboard.press("Shift+ArrowRight")  # once: a verdict on the first of many moves would not be the last one
    until(page, "#verdict", "^(?!recovered).+")  # worse, as it was judged anew
    page.wait_for_selector("#do-save:enabled")
    page.click("#do-save")
    until(page, "#saved", "Tracked|Not tracked")
    code = IFS.load(next(output.rglob("code.json")))
    numbers = [float(page.input_value(f"#number-{name}")) for name in "ef"]
    assert code.offset[1].tolist() == pytest.approx(numbers, abs=1e-6)
    assert {"code.html", "overlay.png", "rendering.png"} <= {path.name for path in output.rglob("*")}
    with page.expect_download() as download:
        page.click("#saved-files >> text=code.json")
    assert IFS.load(download.value.path()).offset.equal(code.offset)
    page.reload()  # and the way back to what was found is still there
    page.wait_for_selector("#do-back:enabled")
    page.click("#do-back")
    assert "recovered" in until(page, "#verdict", "^recovered")
    assert opened.said == [] and all(url.startswith((address, "data:")) for url in opened.asked)


def pair_of_shapes() -> bytes:
    """A PNG of a small square on the left and a larger triangle on the right, 300×120 px."""
    drawing = Image.new("L", (300, 120), 255)
    drawing.paste(0, (20, 40, 70, 90))
    ImageDraw.Draw(drawing).polygon([(190, 10), (280, 100), (170, 110)], fill=0)
    buffer = io.BytesIO()
    drawing.save(buffer, "PNG")
    return buffer.getvalue()


@pytest.fixture
def cropping(studio, open_page):
    """A page with that picture."""
    page = open_page((1280, 860), **COARSE).page
    page.goto(studio[0])
    page.wait_for_selector("#file:enabled")

    def accept(dialog):  # where a test before has left a code, which would go
        dialog.accept()

    page.on("dialog", accept)
    page.set_input_files("#file", {"name": "pair.png", "mimeType": "image/png", "buffer": pair_of_shapes()})
    until(page, "#picture-name", "pair.png")
    page.wait_for_selector("#reading:enabled")
    page.remove_listener("dialog", accept)
    return page


def square(page) -> list[float]:
    """The square that the search sees: left, top, right, bottom in pixels of the picture."""
    x, y, width, height = (float(page.get_attribute("#square", name)) for name in ("x", "y", "width", "height"))
    return [x, y, x + width, y + height]


def typed(page) -> list[int]:
    return [int(page.input_value(f"#part-{name}")) for name in ("left", "top", "width", "height")]


def drag(page, first, last, drop=True) -> None:
    """From one pixel of the picture to another."""
    box = settled_box(page.locator("#crop"))
    for (x, y), act in ((first, page.mouse.down), (last, page.mouse.up if drop else lambda: None)):
        page.mouse.move(box["x"] + x / 300 * box["width"], box["y"] + y / 120 * box["height"], steps=3)
        act()


def test_a_rectangle_dragged_over_the_picture_is_read_alone(cropping):
    page = cropping
    assert typed(page) == [0, 0, 300, 120] and page.is_disabled("#part-all")
    assert square(page)[0] > 100, "the larger shape is taken"
    drag(page, (90, 110), (5, 20))  # from the lower right to the upper left
    until(page, "#notes", "only the part of")
    left, top, width, height = typed(page)
    assert abs(left - 5) <= 1 and abs(top - 20) <= 1 and abs(width - 85) <= 1 and abs(height - 90) <= 1
    assert square(page) == pytest.approx([45 - 100 / 3, 65 - 100 / 3, 45 + 100 / 3, 65 + 100 / 3], abs=0.1)
    page.wait_for_selector("#reading:enabled")
    page.click("#part-all")
    until(page, "#notes", "(?s)^(?!.*only the part)")
    assert typed(page) == [0, 0, 300, 120] and square(page)[0] > 100


def test_a_drag_can_be_given_up_and_a_click_chooses_nothing(cropping):
    page, before = cropping, square(cropping)
    drag(page, (5, 20), (90, 110), drop=False)
    assert typed(page)[2] == pytest.approx(85, abs=1)
    page.keyboard.press("Escape")
    assert typed(page) == [0, 0, 300, 120]
    page.mouse.up()
    drag(page, (30, 30), (31, 31))
    page.wait_for_timeout(300)
    assert typed(page) == [0, 0, 300, 120] and square(page) == before and page.inner_text("#said") == ""


def test_a_part_is_typed_and_one_that_cannot_be_is_put_back_with_the_reason(cropping):
    page = cropping
    page.fill("#part-width", "100")
    page.keyboard.press("Tab")
    until(page, "#notes", "the part of 100×120 px at \\(0, 0\\)")
    page.wait_for_selector("#reading:enabled")
    assert square(page)[2] < 100
    page.fill("#part-left", "250")  # so near the right edge the part is narrower
    page.keyboard.press("Tab")
    until(page, "#notes", "the part of 50×120 px at \\(250, 0\\)")
    page.wait_for_selector("#reading:enabled")
    page.fill("#part-width", "9")
    page.keyboard.press("Tab")
    assert "at least 16 px" in until(page, "#said", "part")
    assert typed(page) == [250, 0, 50, 120]


def test_a_code_of_another_picture_asks_first_and_what_may_help_is_a_button(cropping):
    page, asked = cropping, []
    code = codes.known("sierpinski_triangle").to_json()
    code["meta"] = {"picture": {"name": "fern.png", "sha256": "0" * 64}}
    answers = iter(["dismiss", "accept"])

    def answer(dialog):
        asked.append(dialog.message)
        getattr(dialog, next(answers))()

    page.on("dialog", answer)
    page.fill("#seconds", "1")
    page.click("#do-find")
    until(page, "#verdict", "(?s)^(approximation|not recovered|recovered)")
    page.wait_for_selector("#do-edit:enabled")
    page.click("#do-edit")
    count = page.inner_text("#map-count")
    for seen, maps in ((1, count), (2, "3")):
        page.click("#maps-import")
        page.fill("#in-text", json.dumps(code))
        page.click("#in-read")
        until(page, "#map-count", f"^{maps}$")
        assert len(asked) == seen and "fern.png" in asked[0]
    page.remove_listener("dialog", answer)
    page.wait_for_selector("#do-save:enabled")
    assert "=" not in page.inner_text("#remedy") and re.search(r"\bmay\b|Search|Read|^$", page.inner_text("#do-mend"))


MANY = [[0.1, 0, 0, 0.1, 0.2 * (k % 8) - 0.7, 0.2 * (k // 8) - 0.7] for k in range(64)]
WHERE = """(number) => {
  const group = [...document.querySelectorAll("#maps .bodies > .map")].find((each) => each.textContent === number);
  const { left, top, width, height } = group.querySelector(".halo + polygon").getBoundingClientRect();
  return [left + width / 2, top + height / 2];
}"""
FAINT = """() => [...document.querySelectorAll("#maps .bodies > .map")].filter((each) =>
  getComputedStyle(each).opacity < 0.5).map((each) => Number(each.textContent))"""


def test_of_many_maps_a_click_selects_one_and_the_others_are_dimmed(cropping):
    page = cropping
    page.fill("#seconds", "1")
    page.click("#do-find")
    until(page, "#verdict", ".")
    page.wait_for_selector("#do-edit:enabled")
    page.click("#do-edit")
    page.click("#maps-import")
    page.fill("#in-text", json.dumps({"format": "fractal-exp/ifs", "version": 1, "offset": [row[4:] for row in MANY],
                                      "linear": [[row[:2], row[2:4]] for row in MANY]}))
    page.click("#in-read")
    until(page, "#map-count", "^64$")
    for number in ("37", "20"):
        page.mouse.click(*page.evaluate(WHERE, number))
        page.wait_for_selector(f"#handle-move[aria-label*='map {number},']")
        assert page.input_value("#which") == str(int(number) - 1)
        assert sorted(page.evaluate(FAINT)) == [k for k in range(1, 65) if str(k) != number]
        last = page.evaluate("document.querySelector('#maps .bodies').lastChild.textContent")
        assert last == number, "nothing lies over it"


def test_colours_are_asked_for_by_a_box_and_shown_beside_the_code(studio, open_page):
    page = open_page((1280, 860), **COARSE).page
    page.goto(studio[0])
    page.wait_for_selector("#file:enabled")
    page.on("dialog", lambda dialog: dialog.accept())
    drawing = Image.new("RGB", (120, 120), "white")
    ImageDraw.Draw(drawing).polygon([(60, 10), (110, 100), (10, 100)], fill=(200, 30, 60))
    buffer = io.BytesIO()
    drawing.save(buffer, "PNG")
    page.set_input_files("#file", {"name": "red.png", "mimeType": "image/png", "buffer": buffer.getvalue()})
    until(page, "#picture-name", "red.png")
    page.fill("#seconds", "1")
    page.click("#do-find")
    until(page, "#verdict", ".")
    assert not page.is_checked("#colour") and page.is_hidden("#in-colour") and page.is_hidden("#apart-line")
    page.check("#colour")
    page.wait_for_selector("#in-colour:not([hidden])", timeout=PATIENCE)
    assert float(until(page, "#apart", r"\d")) < 20
    page.reload()
    page.wait_for_selector("#in-colour:not([hidden])")
    assert page.is_checked("#colour") and page.evaluate("document.getElementById('redrawn').decode()") is None
    assert page.evaluate("document.getElementById('redrawn').naturalWidth") == SIDE
    page.uncheck("#colour")
    page.wait_for_selector("#in-colour", state="hidden")


@pytest.mark.parametrize("size", [(390, 844), (1280, 800)])
def test_nothing_is_wider_than_the_window_and_every_control_has_a_name(studio, open_page, size):
    opened = open_page(size, **COARSE)
    opened.page.goto(studio[0])
    opened.page.wait_for_selector("#do-find", timeout=PATIENCE)
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    names = opened.page.evaluate("""() => [...document.querySelectorAll("button, input, select")].map((e) => [e.id,
        e.ariaLabel || e.labels?.[0]?.textContent.trim() || e.textContent.trim()])""")
    assert len(names) > 30 and all(name for _, name in names), names
