"""One session of the studio: a picture is read, its code found, stopped, gone on with, edited, polished and saved."""

import io
import json
import math
import multiprocessing
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image
from studio_helpers import SIDE, TOKEN, free, judged, plain, rows

from fractal_exp import IFS, codes
from fractal_exp.ifs import attractor
from fractal_exp.studio.worker import _compile


@pytest.fixture
def tab(studio):
    with studio.tab() as tab:
        tab.until(lambda state: state["ready"] and free(state))
        yield tab


def test_what_is_no_picture_is_refused_by_its_own_name_and_the_one_before_stays(studio, tab, triangle):
    assert studio.send(triangle, "triangle.png") == (200, "")
    for data, name, message in ((b"", "empty.png", "empty.png"), (b"%PDF-1.7", "scan.png", "a PDF"),
                                (b"<svg/>", "../../<img%20src=x>.svg", "<img src=x>.svg"),
                                (triangle[:200], "cut.png", "cut.png")):
        status, why = studio.send(data, name)
        assert status == 400 and message in why and str(studio.output) not in why
    state = tab.until(lambda state: free(state) and state["picture"])
    assert state["picture"]["name"] == "triangle.png"
    assert len(list(studio.output.rglob("*picture*"))) == 1
    assert studio.ask("GET", f"/{TOKEN}/target.png")[1][:4] == b"\x89PNG"


def test_the_reading_is_corrected_by_hand(studio, tab, triangle):
    studio.send(triangle)
    tab.until(lambda state: free(state) and state["picture"])
    tab.do("read", reading={"invert": True, "frame": "keep", "threshold": 0.5, "clean": False})
    state = tab.until(lambda state: free(state) and state["picture"]["reading"]["threshold"] == 0.5)
    assert state["picture"]["inverted"] and "binary at the threshold 0.5" in state["picture"]["notes"]
    assert state["picture"]["square"] == [0, 0, SIDE, SIDE]
    for reading, message in (({"threshold": 7}, "below 1"), ({"colour": 1}, "no parameter colour"),
                             ({"invert": "no"}, "invert"), ({"frame": "wide"}, "frame"),
                             ({"resolution": 4096}, "at most 512")):
        assert message in tab.refused("read", reading=reading)


def test_a_part_of_the_picture_is_read_alone_until_all_of_it_is_wanted(studio, tab, triangle):
    studio.send(triangle)
    whole = tab.until(lambda state: free(state) and state["picture"])["picture"]
    assert whole["reading"]["crop"] is None
    tab.do("read", reading={"crop": [8, 32, 32, 60]})  # the lower left of the three triangles
    part = tab.until(lambda state: free(state) and state["picture"]["reading"]["crop"])["picture"]
    assert part["reading"]["crop"] == [8, 32, 32, 60] and (part["width"], part["height"]) == (SIDE, SIDE)
    assert part["scale"] > 1.5 * whole["scale"]
    x0, y0, x1, y1 = part["square"]
    assert 0 < x0 and x1 < 45 and 20 < y0 and y1 < SIDE and "the part of 24×28 px at (8, 32)" in part["notes"][0]
    for crop, message in (([0, 0, 65, 64], "within (0, 0, 64, 64)"), ([40, 0, 40, 64], "empty"),
                          ([0, 0, 9, 9], "16 px"), (["0", 0, 32, 32], "a whole number"),
                          ("all", "a list")):
        why = tab.refused("read", reading={"crop": crop})
        assert message in why and str(studio.output) not in why
    tab.do("read", reading={"crop": None})
    again = tab.until(lambda state: free(state) and not state["picture"]["reading"]["crop"])["picture"]
    assert again["square"] == whole["square"]


def test_what_cannot_be_is_refused_with_the_reason(studio, tab, triangle):
    studio.send(triangle)
    tab.until(lambda state: free(state) and state["picture"])
    for act, more, message in (
            ("save", {}, "no code to save"), ("polish", {}, "no code to begin with"), ("stop", {}, "no search"),
            ("go_on", {}, "no search that was stopped"), ("choose", {"index": 0}, "the curve has 0 codes"),
            ("back", {}, "no code before"), ("mend", {}, "nothing that the studio could do"),
            ("resume", {}, "no session to open"), ("find", {"settings": {"seconds": 0}}, "at least 1"),
            ("find", {"settings": {"maps": 2.5}}, "a whole number"), ("find", {"settings": {"levels": "x"}}, "'auto'"),
            ("find", {"settings": {"path": "/etc"}}, "no parameter path"),
            ("find", {"settings": 3}, "settings: Input should be an object"), (["find"], {}, "expected tags"),
            ("edit", {"code": rows([[2, 0, 0, 2, 0, 0]])}, "contractive"), ("edit", {"code": 3}, "an object"),
            ("__class__", {}, "expected tags"), ("stop", {"more": 1}, "not permitted")):
        assert message in tab.refused(act, **more), act


JAMS = [
    "[" * 5000, "{", '"stop"', '{"do": "\\ud800"}', '{"do": "edit", "code": ' + 600 * '{"meta":' + "0" + 601 * "}",
    json.dumps({"do": "edit", "code": {**rows([[.5, 0, 0, .5, 0, 0]]), "meta": {"note": math.nan}}}),
    json.dumps({"do": "edit", "code": rows([[math.nan, 0, 0, .5, 0, 0]])}),
    json.dumps({"do": "edit", "code": rows(8000 * [[.5, 0, 0, .5, 0, 0]])}),
    json.dumps({"do": "edit", "code": rows([[1e300, 0, 0, .5, 0, 0]])}),
    '{"do": "choose", "index": 1' + 5000 * "0" + "}",
]


def test_no_message_jams_the_session(studio, tab, triangle):
    studio.send(triangle)
    before = tab.until(lambda state: free(state) and state["picture"])
    for sent in JAMS:
        began = time.process_time()
        tab.socket.send(sent)
        why = tab.why()
        assert time.process_time() - began < 2 and len(why) < 1000, sent[:100]
    tab.do("edit", code=rows([[.5, 0, 0, .5, 0, 0], [.5, 0, 0, .5, .3, 0]]))
    assert tab.until(judged)["version"]["code"] == before["version"]["code"] + 1


def red_on_white(triangle: bytes) -> bytes:
    """The same picture, red on white."""
    light = np.asarray(Image.open(io.BytesIO(triangle)).convert("L"))
    buffer = io.BytesIO()
    Image.fromarray(np.dstack([np.full_like(light, 255), 255 - light, 255 - light])).save(buffer, "PNG")
    return buffer.getvalue()


def test_a_code_has_the_colours_of_its_picture_while_they_are_asked_for(studio, tab, triangle):
    studio.send(red_on_white(triangle), "red.png")
    tab.until(lambda state: free(state) and state["picture"])
    tab.do("edit", code=plain(attractor.normalize(codes.known("sierpinski_triangle"))))
    grey = tab.until(judged)
    assert grey["dimension"].startswith("code 1.5850, exact (similarity); picture 1.")
    assert not grey["coloured"] and studio.ask("GET", f"/{TOKEN}/redrawn.png")[0] == 404
    tab.do("colour", yes=True)
    state = tab.until(lambda state: judged(state) and state["coloured"])
    assert state["apart"] < 10 and state["settings"]["colour"] and state["version"] == grey["version"]
    drawn = np.asarray(Image.open(io.BytesIO(studio.ask("GET", f"/{TOKEN}/redrawn.png")[1]))).astype(int)
    assert drawn[0, 0].tolist() == [255, 255, 255] and (drawn[..., 0] - drawn[..., 1:].mean(-1)).max() > 100
    tab.do("save")
    saved = Path(tab.until(lambda state: free(state) and state["saved"])["saved"]["folder"])
    colours = IFS.load(saved / "code.json").colours
    assert (colours.rgb[:, :1] - colours.rgb[:, 1:]).min() > 0.25
    assert np.asarray(Image.open(saved / "redrawn.png")).shape == (SIDE, SIDE, 3)
    tab.do("find", settings={"maps": 3, "seconds": 3, "colour": True})  # and a search has them at its end
    tab.until(lambda state: state["task"] == "find")
    assert tab.until(judged)["coloured"]
    tab.do("colour", yes=False)
    state = tab.until(judged)
    assert not state["coloured"] and state["apart"] is None and not state["saved"]
    for yes in ("yes", None, 1):
        assert "valid boolean" in tab.refused("colour", yes=yes)


def test_from_a_picture_to_a_saved_code_with_a_stop_and_a_closed_page_between(studio, tab, triangle):
    studio.send(triangle, "triangle.png")
    tab.until(lambda state: free(state) and state["picture"])
    with studio.tab() as other:  # a second page follows the same session
        other.do("find", settings={"maps": 3, "seconds": 60})
        first = tab.until(lambda state: state["task"] == "find" and state["code"])
        assert 0 < first["likeness"] <= 1
        assert "stop it first" in other.refused("save")
        assert "stop it first" in other.refused("edit", code=rows([[.5, 0, 0, .5, 0, 0]]))
    tab.do("stop")  # the page that began it is gone
    stopped = tab.until(lambda state: free(state) and not state["stopping"])
    assert stopped["can_go_on"] and stopped["code"]
    tab.do("go_on")
    found = tab.until(lambda state: judged(state))
    assert tab.progress and not found["can_go_on"], found["why"]
    assert "recovered" in found["verdict"]["words"] and found["likeness"] >= 0.985
    tab.do("save")
    saved = tab.until(lambda state: free(state) and state["saved"])["saved"]
    assert {"code.json", "code.html", "rendering.png", "overlay.png"} <= set(saved["names"])
    status, text = studio.ask("GET", f"/{TOKEN}/saved/code.json")
    assert status == 200 and text == Path(saved["folder"], "code.json").read_bytes()
    assert studio.ask("GET", f"/{TOKEN}/saved/..%2f..%2fsession.json")[0] == 404
    assert "triangle" in saved["folder"] and saved["folder"].startswith(str(studio.output))
    assert len(IFS.load(f"{saved['folder']}/code.json")) == 3
    if "run" in saved:
        assert (studio.output / "mlflow.db").exists()
    else:
        assert "fractal-exp[study]" in saved["not_tracked"]


def test_a_code_made_by_hand_is_judged_and_polished(studio, tab, triangle):
    studio.send(triangle)
    tab.until(lambda state: free(state) and state["picture"])
    true = attractor.normalize(codes.known("sierpinski_triangle"))
    wrong = IFS(true.linear, true.offset + torch.tensor([[0.03, 0.0], [0.0, 0.02], [0.0, 0.0]]))
    tab.do("edit", code=plain(wrong))
    by_hand = tab.until(lambda state: judged(state))
    tab.do("polish", settings={})
    polished = tab.until(lambda state: judged(state) and state["code"] != by_hand["code"])
    assert polished["likeness"] > by_hand["likeness"] and polished["likeness"] > 0.985


def test_a_worker_that_dies_is_replaced_and_that_is_said(studio, tab, triangle):
    studio.send(triangle)
    tab.until(lambda state: free(state) and state["picture"])
    tab.do("find", settings={"maps": 3})
    tab.until(lambda state: state["task"] == "find" and state["code"])
    os.kill(next(each.pid for each in multiprocessing.active_children() if each.name == "studio search"),
            signal.SIGKILL)
    state = tab.until(lambda state: "process ended (signal 9)" in state["why"])
    assert state["code"]
    tab.until(lambda state: judged(state))  # by the next worker


class Asked:
    """A pipe in which a task lies as soon as it has been asked for one so many times."""

    def __init__(self, times):
        self.times, self.asked = times, 0

    def poll(self):
        self.asked += 1
        return self.asked >= self.times


@pytest.mark.parametrize("times", [1, 3])
def test_warming_up_gives_way_to_a_task_that_waits_or_comes_in_its_midst(times):
    pipe = Asked(times)
    _compile(pipe)
    assert pipe.asked == times, "it would have gone on asking"
