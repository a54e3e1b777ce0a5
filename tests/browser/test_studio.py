"""The studio in a real browser: from a dropped picture to a saved run."""

import base64
import re
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from fractal_exp import IFS, codes, suite
from fractal_exp.ifs import attractor

PATIENCE = 90_000  # ms
DROP = """([data, name]) => {
  const file = new File([Uint8Array.from(atob(data), (c) => c.charCodeAt(0))], name, { type: "image/png" });
  const given = new DataTransfer();
  given.items.add(file);
  document.querySelector("#drop").dispatchEvent(new DragEvent("drop", { dataTransfer: given, bubbles: true }));
}"""
SIDE = 64
SMALL = f"""
from fractal_exp.cli import studio
from fractal_exp.studio import reading

if __name__ == "__main__":
    reading.RESOLUTION = {SIDE}
    studio.main()
"""
WILD = "<img src=x onerror=\"document.title='taken'\">.png"


@pytest.fixture(scope="module")
def studio(tmp_path_factory):
    """The command itself, which brings pictures to 64² instead of 256² for a quick search: its address and folder."""
    pytest.importorskip("websockets", reason="the studio needs `pip install 'fractal-exp[studio]'`")
    output = tmp_path_factory.mktemp("studio")
    command = [sys.executable, "-c", SMALL, "--port", "0", "--no-browser", "--output", output]
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


def test_from_a_dropped_picture_to_a_saved_run(studio, open_page, tmp_path):
    address, output = studio
    triangle = attractor.normalize(codes.known("sierpinski_triangle"))
    picture = np.rint(255 * suite.target(triangle, SIDE).numpy()).astype(np.uint8)
    Image.fromarray(picture).save(tmp_path / "triangle.png")
    opened = open_page((1280, 860))
    page = opened.page
    page.goto(address)
    page.wait_for_selector("#drop span")
    assert page.is_disabled("#do-find") and page.is_disabled("#do-save")
    page.wait_for_selector("#file:enabled")
    page.evaluate(DROP, [base64.b64encode((tmp_path / "triangle.png").read_bytes()).decode(), WILD])
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
    assert opened.said == [] and all(url.startswith((address, "data:")) for url in opened.asked)


def test_a_page_without_the_token_shows_nothing(studio, open_page):
    address, _ = studio
    opened = open_page((600, 400))
    answer = opened.page.goto(re.sub(r"/[^/]+/$", "/wrong/", address))
    assert answer.status == 403 and "fractal-studio printed" in opened.page.inner_text("body")


@pytest.mark.parametrize("size", [(390, 844), (1280, 800)])
def test_nothing_is_wider_than_the_window_and_every_control_has_a_name(studio, open_page, size):
    opened = open_page(size)
    opened.page.goto(studio[0])
    opened.page.wait_for_selector("#do-find", timeout=PATIENCE)
    assert opened.page.evaluate("document.documentElement.scrollWidth") <= size[0]
    names = opened.page.evaluate("""() => [...document.querySelectorAll("button, input, select")].map((e) => [e.id,
        e.ariaLabel || e.labels?.[0]?.textContent.trim() || e.textContent.trim()])""")
    assert len(names) > 30 and all(name for _, name in names), names
