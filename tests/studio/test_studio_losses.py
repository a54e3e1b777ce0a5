"""Nothing that a user has found is lost or shown as what it is not: while it is saved, on a full disk, at the end."""

import errno
import json
import os
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from studio_helpers import SIDE, TOKEN, InThread, free, judged, rows, served

from fractal_exp import IFS, InputError, codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import ReadImage
from fractal_exp.inversion import Work, conclude
from fractal_exp.methods.base import CodeReconstruction, Progress
from fractal_exp.studio import reading, session, tasks

FIRST = rows([[.5, 0, 0, .5, 0, 0], [.5, 0, 0, .5, .3, 0]])
SECOND = rows([[.5, 0, 0, .5, 0, 0], [.4, 0, 0, .5, .3, .2]])


@pytest.fixture
def quick(tmp_path, monkeypatch, triangle):
    """A studio without a process that searches and without a tracker, and a page of it with a picture."""
    pytest.importorskip("websockets", reason="the studio needs `pip install 'fractal-exp[studio]'`")

    def no_tracker(*_):
        raise InputError("no tracker here")

    monkeypatch.setattr(session, "Worker", InThread)
    monkeypatch.setattr(session.saving, "track", no_tracker)
    with served(tmp_path) as studio, studio.tab() as tab:
        assert studio.send(triangle, "triangle.png") == (200, "")
        tab.until(lambda state: free(state) and state["picture"])
        yield studio, tab


def full(monkeypatch):
    """From now on the disk takes no file."""
    def refuse(_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("fractal_exp.runtime.files.os.fsync", refuse)


def files(folder):
    return {path for path in folder.rglob("*") if path.is_file() and path.name != ".lock"}


def found(task, code):
    """The end of a search that has found a code."""
    work = Work(CodeReconstruction(IFS.from_json(code)), stopped="done")
    return tasks.Done(conclude(work, task.picture, name="collage"))


def linear(code):
    return None if code is None else code["linear"]


def test_a_code_that_is_changed_while_another_tab_saves_is_judged_and_not_shown_as_saved(quick, monkeypatch):
    studio, tab = quick
    begun, go, save = threading.Event(), threading.Event(), session.saving.save

    def slowly(*given):
        begun.set()
        go.wait(60)
        return save(*given)

    monkeypatch.setattr(session.saving, "save", slowly)
    tab.do("edit", code=FIRST)
    tab.until(judged)
    with studio.tab() as other:
        tab.do("save")
        assert begun.wait(60)
        other.do("edit", code=SECOND)
        other.until(lambda state: state["task"] == "save" and linear(state["code"]) == SECOND["linear"])
        go.set()
        state = tab.until(judged)
    assert state["saved"] == {} and state["judged"] and linear(state["code"]) == SECOND["linear"]
    tab.do("save")
    saved = tab.until(lambda state: free(state) and state["saved"])["saved"]
    assert linear(IFS.load(f"{saved['folder']}/code.json").to_json()) == SECOND["linear"]
    assert saved["not_tracked"] == "no tracker here"


def test_what_was_not_saved_is_offered_at_the_next_start_with_the_way_back(tmp_path, quick, monkeypatch):
    studio, tab = quick
    monkeypatch.setattr(tasks.Find, "run", lambda task, tell: found(task, FIRST))
    tab.do("edit", code=FIRST, mark="mine")
    assert tab.until(judged)["mark"] == "mine"
    tab.do("find", settings={"maps": 2})
    tab.until(judged)
    tab.do("edit", code=SECOND)
    tab.until(judged)
    end = time.monotonic() + 60
    while not (kept := list(tmp_path.rglob("code.json"))) or linear(IFS.load(kept[0]).to_json()) != SECOND["linear"]:
        assert time.monotonic() < end, "the code is written as it is found, not at the end"
        time.sleep(0.05)
    with served(tmp_path) as second, second.tab() as other:
        assert other.until(free)["offer"] is None, "the first is still at work"
    studio.end()
    assert str(kept[0]) in studio.left[0]
    with served(tmp_path) as third, third.tab() as other:
        offer = other.until(free)["offer"]
        assert offer["name"] == "triangle.png" and offer["maps"] == 2
        other.do("resume")
        state = other.until(judged)
        assert linear(state["code"]) == SECOND["linear"] and state["picture"]["name"] == "triangle.png"
        assert state["back"] and state["offer"] is None
        other.do("back")
        other.until(judged)
        other.do("back")
        assert linear(other.until(judged)["code"]) == FIRST["linear"]
        other.do("forth")
        other.do("forth")
        state = other.until(lambda state: judged(state) and not state["forth"])
        assert linear(state["code"]) == SECOND["linear"]
        other.do("save")
        other.until(lambda state: free(state) and state["saved"])
    assert not list(tmp_path.glob("*session*")), "all is saved"


def test_a_damaged_session_is_not_offered(tmp_path, quick):
    studio, tab = quick
    tab.do("edit", code=FIRST)
    tab.until(judged)
    studio.end()
    state, = tmp_path.rglob("session.json")
    state.write_text(json.dumps(json.loads(state.read_text()) | {"picture": "../../etc/passwd"}))
    with served(tmp_path) as second, second.tab() as other:
        assert other.until(free)["offer"] is None
    assert state.exists()


def test_a_full_disk_is_told_and_leaves_no_half_files(tmp_path, quick, monkeypatch, triangle):
    studio, tab = quick
    tab.do("edit", code=FIRST)
    tab.until(judged)
    before = files(tmp_path)
    with monkeypatch.context() as patch:
        full(patch)
        status, why = studio.send(triangle, "other.png")
        assert status == 400 and "No space left" in why and "free some space" in why
        assert "No space left" in tab.refused("save")
        tab.do("edit", code=SECOND)
        tab.until(lambda state: judged(state) and linear(state["code"]) == SECOND["linear"]
                  and "No space left" in state["why"])
        assert files(tmp_path) <= before
        studio.end()
    assert "No space left" in studio.left[0]
    code = json.loads(studio.left[0].split("was not saved: ")[1])
    assert code["linear"] == SECOND["linear"], "the terminal is the last place where it can be put"


def test_every_file_of_a_save_is_written_or_none(tmp_path, quick, monkeypatch):
    studio, tab = quick
    tab.do("edit", code=FIRST)
    tab.until(judged)
    with monkeypatch.context() as patch:
        def refuse(*_, **__):
            raise InputError("cannot write code.html: No space left on device")
        patch.setattr(IFS, "save_html", refuse)
        assert "No space left" in tab.refused("save")
    assert not list(tmp_path.rglob("inversion.json"))


def test_previews_are_read_once_and_one_at_a_time(quick, monkeypatch, triangle):
    studio, tab = quick
    at_once, most, read = [], [], reading.read_small

    def counted(*given, **more):
        at_once.append(1)
        most.append(len(at_once))
        time.sleep(0.2)
        at_once.pop()
        return read(*given, **more)

    monkeypatch.setattr(reading, "read_small", counted)
    with ThreadPoolExecutor(4) as threads:
        answers = list(threads.map(lambda _: studio.ask("GET", f"/{TOKEN}/given.png"), range(4)))
    assert {status for status, _ in answers} == {200} and len({png for _, png in answers}) == 1 and most == [1]
    monkeypatch.setattr(reading, "MOST_PIXELS", 1000)
    status, why = studio.send(triangle)
    assert status == 400 and f"{SIDE}×{SIDE} pixels, at most" in why


def test_a_search_may_follow_a_drag_at_once(quick, monkeypatch):
    _, tab = quick
    begun, go, judge = [], threading.Event(), tasks.Judge.run

    def slowly(task, tell):
        go.wait(60)
        return judge(task, tell)

    def find(task, tell):
        begun.append(task)
        return found(task, FIRST)

    monkeypatch.setattr(tasks.Judge, "run", slowly)
    monkeypatch.setattr(tasks.Find, "run", find)
    tab.do("edit", code=FIRST)
    tab.until(lambda state: state["task"] == "judge")
    tab.do("polish", settings={})
    tab.until(lambda state: state["task"] == "polish")
    assert not begun
    go.set()
    state = tab.until(judged)
    assert len(begun) == 1 and begun[0].beat is begun[0].begin and linear(state["code"]) == FIRST["linear"]
    change = state["verdict"]["change"]  # more maps, say: a search from the beginning, which can be taken back
    assert change and not state["verdict"]["remedy"]
    tab.do("mend")
    tab.until(lambda state: judged(state) and len(begun) == 2)
    asked = {**begun[1].options, "resolution": len(begun[1].picture.image), "invert": begun[1].picture.inverted}
    assert change.items() <= asked.items() and begun[1].begin == "anew"


# What a search shows never gets worse.

TRUE = attractor.normalize(codes.known("sierpinski_triangle"))
WORSE = IFS(TRUE.linear * 0.9, TRUE.offset)


@pytest.fixture
def target():
    return ReadImage.of_drawing(suite.target(TRUE, SIDE), "density")


def test_only_better_codes_are_shown(target):
    told = []
    telling = tasks._Telling(told.append, target, None, None)
    for code in (WORSE, TRUE, WORSE):
        telling(Progress(1, 0.5, code=code))
    shown = [word for word in told if isinstance(word, tasks.Best)]
    assert [word.code for word in shown] == [WORSE, TRUE] and shown[0].rank < shown[1].rank
    beaten = tasks._Telling(told.append, target, None, TRUE)
    told.clear()
    beaten(Progress(1, 0.5, code=WORSE))
    assert not any(isinstance(word, tasks.Best) for word in told)


@pytest.mark.parametrize("beat", [None, TRUE])
def test_a_search_ends_with_the_best_code_by_the_figure_that_was_shown(tmp_path, target, monkeypatch, beat):
    def gets_worse(image, *, on_step, **_):
        if beat is None:
            on_step(Progress(1, 0.5, code=TRUE))
        on_step(Progress(2, 0.9, code=WORSE))
        return conclude(Work(CodeReconstruction(WORSE), stopped="all stages done", seconds=3.0), image, name="collage")

    monkeypatch.setattr(tasks, "invert", gets_worse)
    told = []
    done = tasks.Find(target, tmp_path / "search", beat=beat).run(told.append)
    assert done.found.code is TRUE and done.found.seconds == 3 and done.found.stopped == "all stages done"
    shown = [word.likeness.f1_1px for word in told if isinstance(word, tasks.Best)]
    assert shown == sorted(shown) and done.found.likeness.f1_1px >= max(shown, default=0)
    assert np.isclose(done.found.likeness.noise_ratio, 1, atol=0.3)
    assert done.found.code.colours is None
    done = tasks.Find(target, tmp_path / "search", beat=TRUE, colour=True).run(lambda _: None)
    assert done.found.code.linear.equal(TRUE.linear) and done.found.code.colours is not None
