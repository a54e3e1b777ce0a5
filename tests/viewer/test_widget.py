"""The widget of a code in Python: what its trait takes, what it sends, and what a page may not do to a kernel."""

import json
import os
import queue
import sys
from collections.abc import Iterator
from typing import Any

import pytest
import torch
from jupyter_client import KernelManager
from jupyter_client.blocking import BlockingKernelClient

from fractal_exp import IFS, Colours, InputError, View, codes
from fractal_exp.runtime import extras
from fractal_exp.viewer.page import page as page_of

pytest.importorskip("anywidget", reason="the widget needs `pip install 'fractal-exp[notebook]'`")

from fractal_exp.viewer.widget import CodeWidget  # noqa: E402

FERN, DRAGON = codes.known("fern"), codes.known("heighway_dragon")
WILD = IFS([[[1.01, 0], [0, 0.5]]], [[0.0, 0.0]])
HALF = [[[0.5, 0], [0, 0.5]]], [[0.0, 0.0]]
COLOURED = IFS(*HALF, [1.0], {"title": "A dot"}, Colours([[1, 0.5, 0.1]], [0.7]))
PATIENCE = 60  # seconds


def held(page: str) -> dict[str, Any]:
    return json.loads(page.partition('id="given">')[2].partition("</script>")[0])


def test_a_widget_has_the_page_of_its_code_which_alone_is_live():
    page = FERN.widget(view=View((0.1, -0.3), 64))._page
    assert held(page)["live"] is True and held(page)["view"] == {"x": 0.1, "y": -0.3, "zoom": 64}
    assert held(page_of(FERN))["live"] is False
    assert len(page.encode()) <= 200_000 and "data:image/png" in page


@pytest.mark.parametrize("code", [FERN, DRAGON, COLOURED], ids=["probabilities", "none", "colours"])
def test_a_code_goes_to_the_page_and_back_to_the_last_bit(code):
    widget = CodeWidget(FERN)
    widget.code = code
    sent = json.loads(json.dumps(widget.get_state("code")["code"]))
    assert sent == code.to_json() and widget.code is code
    widget.set_state({"code": sent})
    assert widget.code is not code and widget.code.to_json() == code.to_json()


@pytest.mark.parametrize(("code", "message"), [
    (FERN.to_json(), "a widget shows an IFS, got dict; IFS.load reads one from a file, and IFS.from_json"),
    (WILD, "map 1 has singular value 1.01"),
    (IFS(torch.zeros(1001, 2, 2), torch.zeros(1001, 2)), "at most 1000 maps, got 1001"),
    (IFS(*HALF, meta={"source": torch.zeros(1)}), "nothing but JSON"),
    (IFS(*HALF, meta={"error": float("nan")}), "nothing but JSON"),
])
def test_what_a_page_cannot_show_is_refused_at_the_start_and_later(code, message):
    with pytest.raises(InputError, match=message):
        CodeWidget(code)
    widget = CodeWidget(FERN)
    with pytest.raises(InputError, match=message):
        widget.code = code
    assert widget.code is FERN


def without(data: dict[str, Any], key: str) -> dict[str, Any]:
    return {name: value for name, value in data.items() if name != key}


class Line:
    """To a page, as a kernel has it."""

    comm_id = "line"

    def __init__(self):
        self.sent = []

    def send(self, data, buffers):
        self.sent.append(data)

    def on_msg(self, callback):
        pass


@pytest.mark.parametrize("data", [
    None, 3, "code", [], {}, WILD.to_json(), without(FERN.to_json(), "offset"), FERN.to_json() | {"version": 2},
    FERN.to_json() | {"linear": "x"}, FERN.to_json() | {"probabilities": [1, 1, 1, 1]}, FERN.to_json() | {"meta": 3},
    FERN.to_json() | {"more": 1}, [[0, 0, 0, 0, 0, 0]] * 1001, [[0, 0, 0, 0, 0, float("nan")]],
])
def test_a_wrong_code_of_the_page_is_refused_and_the_right_one_sent_again(data, caplog):
    widget, line, heard = CodeWidget(FERN), Line(), []
    widget.comm = line
    widget.observe(heard.append, "code")
    widget.log.addHandler(caplog.handler)
    try:
        widget.set_state({"code": data})
    finally:
        widget.log.removeHandler(caplog.handler)
    assert widget.code is FERN and heard == [] and "The page's code is refused: " in caplog.text
    assert line.sent[-1]["method"] == "update" and line.sent[-1]["state"] == {"code": FERN.to_json()}


def test_without_the_extra_the_remedy_is_named(monkeypatch):
    monkeypatch.delitem(sys.modules, "fractal_exp.viewer.widget")
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"anywidget is not installed; pip install 'fractal-exp\[notebook\]'"):
        FERN.widget()


@pytest.fixture
def kernel() -> Iterator[BlockingKernelClient]:
    manager = KernelManager(kernel_name="python3")
    manager.start_kernel(env={**os.environ})
    client = manager.client()
    client.start_channels()
    client.wait_for_ready(timeout=PATIENCE)
    yield client
    client.stop_channels()
    manager.shutdown_kernel(now=True)


def value(kernel: BlockingKernelClient, code: str, expression: str) -> str:
    """What an expression is in the kernel, as text, after some code has run."""
    reply = kernel.execute(code, user_expressions={"it": expression}, reply=True, timeout=PATIENCE)
    assert reply["content"]["status"] == "ok", reply["content"]
    return reply["content"]["user_expressions"]["it"]["data"]["text/plain"]


def states_sent(kernel: BlockingKernelClient) -> list[dict[str, Any]]:
    """The states of widgets that the kernel has sent so far."""
    found = []
    while True:
        try:
            content = kernel.get_iopub_msg(timeout=1)["content"]
        except queue.Empty:
            return found
        if content.get("data", {}).get("method") == "update":
            found.append(content["data"]["state"])


def test_a_kernel_hears_the_page_and_outlives_what_is_wrong(kernel):
    model = value(kernel, "from fractal_exp import codes\nw = codes.known('fern').widget()\nheard = []\n"
                          "w.observe(lambda change: heard.append(len(change.new)), 'code')", "w.model_id").strip("'")
    for data in (DRAGON.to_json(), WILD.to_json(), {"format": []}):
        state = {"method": "update", "state": {"code": data}, "buffer_paths": []}
        kernel.shell_channel.send(kernel.session.msg("comm_msg", {"comm_id": model, "data": state}))
    assert value(kernel, "", "(heard, w.code)") == "([2], IFS('heighway_dragon', 2 maps))"
    assert states_sent(kernel) == [{"code": DRAGON.to_json()}] * 2  # for the two that were refused
