"""One session of the studio: a picture is read, its code found, stopped, gone on with, edited, polished and saved."""

import json
import multiprocessing
import os
import queue
import signal

import pytest
import torch
from studio_helpers import SIDE, TOKEN, deaf, served

from fractal_exp import IFS, api, codes
from fractal_exp.ifs import attractor
from fractal_exp.studio.worker import Ready, Worker, _compile


def free(state) -> bool:
    return state["task"] == ""


def judged(state) -> bool:
    return free(state) and state["verdict"] is not None


def plain(code: IFS) -> dict:
    return {name: part for name, part in code.to_json().items() if name != "meta"}


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
    for reading, message in (({"threshold": 7}, "between 0 and 1"), ({"colour": 1}, "not read with 'colour'"),
                             ({"invert": "no"}, "invert"), ({"frame": "wide"}, "frame")):
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
                          ([0, 0, 9, 9], "16 px"), (["0", 0, 32, 32], "four whole numbers"),
                          ("all", "four whole numbers")):
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
            ("find", {"settings": {"seconds": 0}}, "1 to 86400 seconds"),
            ("find", {"settings": {"maps": 2.5}}, "2 to 1000"), ("find", {"settings": {"levels": "x"}}, "one of auto"),
            ("find", {"settings": {"path": "/etc"}}, "got 'path'"),
            ("find", {"settings": 3}, "settings must be a mapping, got int"), (["find"], {}, "the studio knows read"),
            ("edit", {"code": [[2, 0, 0, 2, 0, 0]]}, "contractive"), ("edit", {"code": 3}, "got int"),
            ("__class__", {}, "the studio knows read")):
        assert message in tab.refused(act, **more), act
    tab.socket.send("[" * 5000)
    assert "load it again" in json.loads(tab.socket.recv())["why"]


def test_from_a_picture_to_a_saved_code_with_a_stop_and_a_closed_page_between(studio, tab, triangle):
    studio.send(triangle, "triangle.png")
    tab.until(lambda state: free(state) and state["picture"])
    with studio.tab() as other:  # a second page follows the same session
        other.do("find", settings={"maps": 3, "seconds": 60})
        first = tab.until(lambda state: state["task"] == "find" and state["code"])
        assert 0 < first["scores"]["iou"] <= first["scores"]["f1"] <= 1
        assert "stop it first" in other.refused("save") and "stop it before" in other.refused("edit", code=[])
    tab.do("stop")  # the page that began it is gone
    stopped = tab.until(lambda state: free(state) and not state["stopping"])
    assert stopped["can_go_on"] and stopped["code"]
    tab.do("go_on")
    found = tab.until(lambda state: judged(state))
    assert tab.progress and not found["can_go_on"], found["why"]
    assert "recovered" in found["verdict"]["words"] and found["likeness"] >= 0.985
    tab.do("save")
    saved = tab.until(lambda state: free(state) and state["saved"])["saved"]
    assert {"code.json", "code.html", "rendering.png", "overlay.png"} <= set(saved["files"].split(", "))
    assert "triangle" in saved["folder"] and saved["folder"].startswith(str(studio.output))
    assert len(IFS.load(f"{saved['folder']}/code.json")) == 3
    if "run" in saved:
        assert (studio.output / "mlflow.db").exists()
    else:
        assert "fractal-exp[study]" in saved["not_tracked"]


@pytest.mark.slow
def test_a_task_that_does_not_stop_is_ended_by_force_and_the_next_one_is_left_alone(monkeypatch):
    monkeypatch.setattr("fractal_exp.studio.worker.PATIENCE", 0.5)
    words = queue.Queue()
    worker = Worker(words.put, deaf)
    assert isinstance(words.get(timeout=90), Ready)
    ends = []
    for seconds, stopped in ((0.1, True), (1.0, False), (60, True)):
        worker.do(seconds)
        if stopped:
            worker.stop()
        ends.append(words.get(timeout=90).why)
    worker.close()
    assert ends[:2] == ["", ""] and "ended (signal 9)" in ends[2]


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


def test_a_code_that_nobody_saved_is_kept_at_the_end(tmp_path, triangle):
    pytest.importorskip("websockets", reason="the studio needs `pip install 'fractal-exp[studio]'`")
    with served(tmp_path) as studio, studio.tab() as tab:
        studio.send(triangle)
        tab.until(lambda state: free(state) and state["picture"])
        code = attractor.normalize(codes.known("fern"))
        tab.do("edit", code=plain(code))
        tab.until(lambda state: state["code"])
    kept = [IFS.load(path) for path in studio.kept]
    assert [each.to_json()["linear"] for each in kept] == [code.to_json()["linear"]]
    assert sorted(path.name for path in tmp_path.rglob("*") if path.is_file()) == ["code.json"]


def test_warming_up_gives_way_to_a_task(monkeypatch):
    ours, theirs = multiprocessing.Pipe()
    steps, invert = [], api.invert

    def watched(*image, on_step, **options):
        def step(progress):
            steps.append(progress)
            if len(steps) == 2:
                ours.send_bytes(b"a task")
            on_step(progress)
        return invert(*image, on_step=step, **options)

    monkeypatch.setattr(api, "invert", watched)
    monkeypatch.setattr("fractal_exp.studio.worker.WARM_SECONDS", 60)
    _compile(theirs)
    assert len(steps) == 2, "it was in the middle"
    _compile(theirs)
    assert len(steps) == 2, "the task is still waiting"
