"""Nothing that a user has found is lost or shown as what it is not: while it is saved, on a full disk, at the end."""

import asyncio
import json
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from functools import partial

import numpy as np
import pytest
from drawings import declared
from full_disk import a_disk_that_takes
from studio_helpers import SIDE, InThread, free, judged, rows, served

from fractal_exp import IFS, codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.images.reading import ReadImage
from fractal_exp.inversion import Work, conclude
from fractal_exp.methods.base import CodeReconstruction, Progress
from fractal_exp.studio import tasks
from fractal_exp.studio.keeping import Folder
from fractal_exp.studio.session import Session

FIRST = rows([[.5, 0, 0, .5, 0, 0], [.5, 0, 0, .5, .3, 0]])
SECOND = rows([[.5, 0, 0, .5, 0, 0], [.4, 0, 0, .5, .3, .2]])


class Finding(InThread):
    """A worker that knows what each search finds, and judges when it may. searches: those that it was told to do."""

    def __init__(self, searches, may_judge, listen):
        self.searches, self.may_judge = searches, may_judge
        super().__init__(listen)

    def done(self, task):
        if isinstance(task, tasks.Find):
            self.searches.append(task)
            work = Work(CodeReconstruction(IFS.from_json(FIRST)), stopped="done")
            return tasks.Done(conclude(work, task.picture, name="collage"))
        self.may_judge.wait(60)
        return super().done(task)


@pytest.fixture
def searches():
    return []


@pytest.fixture
def may_judge():
    event = threading.Event()
    event.set()
    return event


@pytest.fixture
def quick(tmp_path, monkeypatch, triangle, searches, may_judge):
    """A studio without a process that searches and without a tracker, and a page of it with a picture."""
    pytest.importorskip("websockets", reason="the studio needs `pip install 'fractal-exp[studio]'`")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "nowhere")
    with served(tmp_path, worker=partial(Finding, searches, may_judge)) as studio, studio.tab() as tab:
        assert studio.send(triangle, "triangle.png") == (200, "")
        tab.until(lambda state: free(state) and state["picture"])
        yield studio, tab


def files(folder):
    return {path for path in folder.rglob("*") if path.is_file() and path.name != ".lock"}


def linear(code):
    return None if code is None else code["linear"]


def kept_file(folder, code):
    """The file of the code in the session's folder, once it is there."""
    end = time.monotonic() + 60
    while not (kept := [each.with_name("code.json") for each in folder.rglob("session.json")]) or not (
            kept[0].exists() and linear(IFS.load(kept[0]).to_json()) == code["linear"]):
        assert time.monotonic() < end, "the code is written as it is found, not at the end"
        time.sleep(0.05)
    return kept[0]


async def judging(session):
    """Wait until the code is judged."""
    for _ in range(6000):
        if session.task == "" and session.found is not None:
            return
        await asyncio.sleep(0.01)
    raise AssertionError("it is not judged")


async def changed_while_it_is_saved(folder, picture):
    """Where a session stands after that, and after it is saved again."""
    session = Session(Folder.new(folder), folder, asyncio.get_running_loop(), InThread)
    await session.take(picture, "triangle.png")
    session.edit(IFS.from_json(FIRST))
    await judging(session)
    saving = asyncio.create_task(session.save())
    await asyncio.sleep(0)  # the files are being written, in a thread, which is heard of again when this one waits
    session.edit(IFS.from_json(SECOND))
    during = session.facts()
    await saving
    await judging(session)
    after = session.facts()
    await session.save()
    again = session.facts()
    assert await session.close() == ""
    return during, after, again


def test_a_code_that_is_changed_while_it_is_saved_is_judged_and_not_shown_as_saved(tmp_path, monkeypatch, triangle):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "nowhere")
    with ThreadPoolExecutor(1) as thread:  # where Chromium was tested before, Playwright's loop still runs in this one
        during, after, again = thread.submit(asyncio.run, changed_while_it_is_saved(tmp_path, triangle)).result()
    assert during["task"] == "save" and linear(during["code"]) == SECOND["linear"]
    assert after["saved"] == {} and after["judged"] and linear(after["code"]) == SECOND["linear"]
    saved = again["saved"]
    assert linear(IFS.load(f"{saved['folder']}/code.json").to_json()) == SECOND["linear"]
    assert "correct MLFLOW_TRACKING_URI" in saved["not_tracked"]


def test_what_was_not_saved_is_offered_at_the_next_start_with_the_way_back(tmp_path, quick):
    studio, tab = quick
    tab.do("edit", code=FIRST, mark="mine")
    assert tab.until(judged)["mark"] == "mine"
    tab.do("find", settings={"maps": 2})
    tab.until(judged)
    tab.do("edit", code=SECOND)
    tab.until(judged)
    kept = kept_file(tmp_path, SECOND)
    with served(tmp_path, worker=InThread) as second, second.tab() as other:
        assert other.until(free)["offer"] is None, "the first is still at work"
    studio.end()
    assert str(kept) in studio.left[0]
    with served(tmp_path, worker=InThread) as third, third.tab() as other:
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
    with served(tmp_path, worker=InThread) as second, second.tab() as other:
        assert other.until(free)["offer"] is None
    assert state.exists()


def test_a_full_disk_is_told_and_leaves_no_half_files(tmp_path, quick, triangle):
    studio, tab = quick
    tab.do("edit", code=FIRST)
    tab.until(judged)
    kept_file(tmp_path, FIRST)
    before = files(tmp_path)
    with a_disk_that_takes(0):
        status, why = studio.send(triangle, "other.png")
        assert status == 400 and "File too large" in why and "choose another disk" in why
        assert "File too large" in tab.refused("save")
        tab.do("edit", code=SECOND)
        tab.until(lambda state: judged(state) and linear(state["code"]) == SECOND["linear"]
                  and "File too large" in state["why"])
        studio.end()
        assert files(tmp_path) <= before
    assert "File too large" in studio.left[0]
    code = json.loads(studio.left[0].split("was not saved: ")[1])
    assert code["linear"] == SECOND["linear"], "the terminal is the last place where it can be put"


def test_every_file_of_a_save_is_written_or_none(tmp_path, quick):
    studio, tab = quick
    tab.do("edit", code=FIRST)
    tab.until(judged)
    with a_disk_that_takes(50_000):  # the page alone is larger
        assert "code.html: File too large" in tab.refused("save")
    assert not list(tmp_path.rglob("inversion.json"))


def test_a_picture_of_too_many_pixels_is_refused_before_it_is_decoded(quick):
    studio, _ = quick
    status, why = studio.send(declared(20_000, 1))
    assert status == 400 and "20000×20000 pixels, at most" in why


def test_a_search_may_follow_a_drag_at_once(quick, searches, may_judge):
    _, tab = quick
    may_judge.clear()
    tab.do("edit", code=FIRST)
    tab.until(lambda state: state["task"] == "judge")
    tab.do("polish", settings={})
    tab.until(lambda state: state["task"] == "polish")
    assert not searches
    may_judge.set()
    state = tab.until(judged)
    assert len(searches) == 1 and searches[0].beat is searches[0].begin and linear(state["code"]) == FIRST["linear"]
    change = state["verdict"]["change"]  # more maps, say: a search from the beginning, which can be taken back
    assert change and not state["verdict"]["remedy"]
    tab.do("mend")
    tab.until(lambda state: judged(state) and len(searches) == 2)
    mended = searches[1]
    asked = {**mended.options, "resolution": len(mended.picture.image), "invert": mended.picture.inverted}
    assert change.items() <= asked.items() and mended.begin == "anew"


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
