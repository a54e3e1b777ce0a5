"""The widget of a notebook in a real browser: its module with a model of the test, and codes that go both ways."""

import json
import time
from dataclasses import replace

import pytest
from browser_helpers import COARSE, settled_box

from fractal_exp import IFS, codes
from fractal_exp.ifs import attractor

pytest.importorskip("anywidget", reason="the widget needs `pip install 'fractal-exp[notebook]'`")

from fractal_exp.viewer.widget import CodeWidget  # noqa: E402

SIDE, PANEL = 320, 388  # pixels of the picture, and of what lies beside it
UNIT = SIDE / 2         # pixels to a unit of the canvas
PATIENCE = 30           # seconds
# A model as anywidget gives one to the module: `set` tells those who listen, if the value is another one.
NOTEBOOK = """<!doctype html><title>n</title><style>body {{ margin: 0 }}</style><div id="cell"></div>
<script type="application/json" id="state">{state}</script>
<script type="module">
class Model {{
  listeners = {{}};
  saved = [];
  constructor(state) {{ this.state = state; }}
  get(name) {{ return this.state[name]; }}
  set(name, value) {{
    const same = JSON.stringify(value) === JSON.stringify(this.state[name]);
    this.state[name] = value;
    if (!same) for (const listener of this.listeners[`change:${{name}}`] ?? []) listener();
  }}
  on(event, listener) {{ (this.listeners[event] ??= []).push(listener); }}
  off(event, listener) {{ this.listeners[event] = this.listeners[event].filter((each) => each !== listener); }}
  save_changes() {{ this.saved.push(this.state.code); }}
}}
const state = JSON.parse(document.querySelector("#state").textContent);
window.model = new Model(state);
const address = URL.createObjectURL(new Blob([state._esm], {{ type: "text/javascript" }}));
const widget = (await import(address)).default;
window.show = () => {{ window.away = widget.render({{ model, el: document.querySelector("#cell") }}); }};
show();
</script>"""
# A frame beside the widget's that sends to it, and to the notebook, what only those two may send each other.
STRANGER = """(message) => {
  const frame = document.createElement("iframe");
  frame.srcdoc = `<script>for (const to of [parent, parent.frames[0]]) to.postMessage(${JSON.stringify(message)}, "*");
    parent.postMessage("done", "*");</` + "script>";
  return new Promise((resolve) => {
    addEventListener("message", ({ data }) => { if (data === "done") resolve(); });
    document.body.append(frame);
  });
}"""
FERN = attractor.normalize(codes.known("fern"))


@pytest.fixture
def notebook(open_page, tmp_path):
    """Opens a notebook with a widget in its only cell, whose frame shows the maps."""
    def opened(widget: CodeWidget) -> Notebook:
        (tmp_path / "notebook.html").write_text(NOTEBOOK.format(state=embedded(widget)))
        page = open_page((SIDE + PANEL, 2 * SIDE), **COARSE)
        page.page.goto(f"file://{tmp_path}/notebook.html")
        return Notebook(widget, page)

    return opened


def embedded(widget: CodeWidget) -> str:
    state = {name: widget.get_state(name)[name] for name in ("_esm", "_page", "code", "height")}
    return json.dumps(state).replace("<", "\\u003c")


class Notebook:
    """The test takes the place of the kernel's line: it brings states from the model to the widget and back."""

    def __init__(self, widget: CodeWidget, opened):
        self.widget, self.opened, self.page, self.taken = widget, opened, opened.page, 0
        self.shown()

    def shown(self):
        self.frame = self.page.wait_for_selector("iframe").content_frame()
        self.opened.drawn(self.frame)
        self.frame.click("#do-edit")
        self.frame.wait_for_selector("#panel")

    def set(self, code: IFS):
        self.widget.code = code
        self.page.evaluate("(code) => model.set('code', code)", self.widget.get_state("code")["code"])

    def saved(self) -> list[dict]:
        return self.page.evaluate("model.saved")

    def take(self) -> IFS:
        """What the widget holds, once the model has sent it something since the last time."""
        end = time.monotonic() + PATIENCE
        while len(self.saved()) == self.taken and time.monotonic() < end:
            self.page.wait_for_timeout(50)
        sent = self.saved()
        assert len(sent) > self.taken, "nothing was sent"
        self.taken = len(sent)
        self.widget.set_state({"code": sent[-1]})
        return self.widget.code

    def silent(self) -> bool:
        """Whether nothing more is sent, for longer than the page keeps a code back."""
        self.page.wait_for_timeout(300)
        return len(self.saved()) == self.taken

    def select(self, number: int):
        self.frame.select_option("#which", str(number))
        self.frame.wait_for_selector(f"#handle-move[aria-label*='map {number + 1},']")

    def middle(self) -> tuple[float, float]:
        """Where the handle is that moves a map, once it has come to rest."""
        box = settled_box(self.frame.locator("#handle-move .plate"))
        return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def number(self, name: str, wanted: float):
        """Wait until the panel shows a number of the selected map."""
        end = time.monotonic() + PATIENCE
        while (found := float(self.frame.input_value(f"#number-{name}"))) != pytest.approx(wanted, abs=1e-6):
            assert time.monotonic() < end, f"{name} is {found}, not {wanted}"
            self.page.wait_for_timeout(50)


def moved(code: IFS, number: int, x: float) -> IFS:
    offset = code.offset.clone()
    offset[number, 0] += x
    return replace(code, offset=offset)


def same(one: IFS, other: IFS) -> bool:
    return one.to_json() == other.to_json()


def test_a_map_that_is_dragged_comes_to_python_and_undo_too(notebook):
    widget, heard = FERN.widget(height=SIDE), []
    widget.observe(heard.append, "code")
    cell = notebook(widget)
    assert cell.page.get_attribute("iframe", "sandbox") == "allow-scripts" and cell.silent()
    cell.select(2)
    x, y = cell.middle()
    mouse = cell.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 20, y - 10)
    assert float((cell.take().offset - FERN.offset)[2, 0]) == pytest.approx(20 / UNIT, abs=1e-5)  # during the drag
    mouse.move(x + 50, y - 30)
    mouse.up()
    dragged = cell.take()
    assert (dragged.offset - FERN.offset)[2].tolist() == pytest.approx([50 / UNIT, 30 / UNIT], abs=1e-5)
    assert heard[-1].new is dragged and dragged.meta == FERN.meta
    cell.frame.click("#maps-undo")
    assert same(cell.take(), FERN)
    assert cell.opened.said == [] and all(url.startswith(("file:", "about:", "blob:")) for url in cell.opened.asked)


def test_a_code_that_is_set_in_python_appears_as_a_step(notebook):
    cell = notebook(FERN.widget(height=SIDE))
    cell.select(1)
    cell.frame.click("#closer")
    cell.frame.wait_for_selector("#zoom:text-is('×\u202f2')")
    cell.set(replace(moved(FERN, 1, 0.125), meta={"title": "A fern, bent"}))
    cell.frame.wait_for_selector("#title:text-is('A fern, bent')")
    cell.number("e", float(FERN.offset[1, 0]) + 0.125)
    assert cell.frame.inner_text("#zoom") == "×\u202f2" and cell.silent()
    far = replace(codes.known("heighway_dragon").similar(20, (300, 0)), meta={"title": "A dragon"})
    cell.set(far)
    cell.frame.wait_for_selector("#title:text-is('A dragon')")
    cell.opened.drawn(cell.frame)
    assert cell.frame.locator("#which option").count() == 2
    assert cell.frame.inner_text("#points") != "nothing here"
    assert cell.silent()
    for title in ("A fern, bent", "Barnsley's fern (black spleenwort)"):
        cell.frame.click("#maps-undo")
        back = cell.take()
        assert cell.frame.inner_text("#title") == title
    assert same(back, FERN) and cell.frame.is_disabled("#maps-undo")


def test_a_hand_keeps_its_map_when_python_changes_another(notebook):
    cell = notebook(FERN.widget(height=SIDE))
    cell.select(2)
    x, y = cell.middle()
    mouse = cell.page.mouse
    mouse.move(x, y)
    mouse.down()
    mouse.move(x + 20, y)
    cell.set(moved(cell.take(), 3, 0.25))  # as a function that observes the code may do
    cell.page.wait_for_timeout(200)
    mouse.move(x + 40, y)
    mouse.up()
    both = (cell.take().offset - FERN.offset)[:, 0].tolist()
    assert both == pytest.approx([0, 0, 40 / UNIT, 0.25], abs=1e-5)
    cell.frame.click("#maps-undo")
    assert same(cell.take(), FERN)  # the drag and what came with it at once


def test_a_page_that_is_loaded_again_shows_the_present_code(notebook):
    cell = notebook(FERN.widget(height=SIDE))
    cell.set(moved(FERN, 0, 0.125))
    cell.page.evaluate("document.querySelector('#cell').append(document.querySelector('iframe'))")
    cell.shown()
    cell.select(0)
    cell.number("e", float(FERN.offset[0, 0]) + 0.125)
    assert cell.frame.is_disabled("#maps-undo") and cell.silent()


def test_strangers_are_not_heard(notebook):
    cell = notebook(FERN.widget(height=SIDE))
    cell.select(0)
    message = {"kind": "fractal-exp/code", "code": moved(FERN, 0, 0.25).to_json()}
    cell.page.evaluate(STRANGER, message)
    cell.page.evaluate("(message) => postMessage(message, '*')", message)
    assert cell.silent() and cell.page.evaluate("model.state.code") == FERN.to_json()
    cell.number("e", float(FERN.offset[0, 0]))


WRONG = [(None, "a code is a JSON object"), ({}, "expected format"), ([[1.5, 0, 0, 1, 0, 0]], "must be contractive"),
         ({"ifs_m": "x"}, "needs ifs_t"), ([[0, 0, 0, 0, 0, 0]] * 1001, "at most 1000 maps, got 1001")]


def test_a_wrong_code_from_the_notebook_is_refused_by_the_page(notebook):
    cell = notebook(FERN.widget(height=SIDE))
    cell.select(0)
    for code, why in WRONG:
        cell.page.evaluate("(code) => frames[0].postMessage({ kind: 'fractal-exp/code', code }, '*')", code)
        cell.frame.wait_for_selector(f"#note:text('code is refused'):text('{why}')")
    cell.number("e", float(FERN.offset[0, 0]))
    assert cell.silent() and cell.opened.said == []


def test_a_page_of_its_own_speaks_to_nobody(open_page, tmp_path):
    """Only the page of a widget is one end of a line; a file, or what a notebook shows for a code alone, is not."""
    (tmp_path / "notebook.html").write_text(
        f"<!doctype html><title>n</title><script>addEventListener('message', ({{ data }}) => {{ document.title = "
        f"JSON.stringify(data); }});</script>{FERN._repr_html_()}")
    opened = open_page((SIDE + PANEL, SIDE), **COARSE)
    opened.page.goto(f"file://{tmp_path}/notebook.html")
    frame = opened.page.wait_for_selector("iframe").content_frame()
    opened.drawn(frame)
    frame.click("#do-edit")
    message = {"kind": "fractal-exp/code", "code": moved(FERN, 0, 0.25).to_json()}
    opened.page.evaluate("(message) => frames[0].postMessage(message, '*')", message)
    frame.select_option("#which", "0")
    frame.click("#maps-flip")
    opened.page.wait_for_timeout(300)
    assert opened.page.title() == "n"
    assert float(frame.input_value("#number-e")) == pytest.approx(float(FERN.offset[0, 0]), abs=1e-6)
