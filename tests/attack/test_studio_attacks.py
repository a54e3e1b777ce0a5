"""Campaigns against the local page as a user starts it: kills, closed terminals, and hostile pictures.

They are slow tests. Their seeds are fixed, the moments come as they fall.
"""

import contextlib
import random
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor

import psutil
import pytest
from drawings import declared
from PIL import Image, ImageDraw
from studio_helpers import COMMAND, Studio, free, picture_of, plain, png

from fractal_exp import IFS, codes
from fractal_exp.ifs import attractor

pytestmark = pytest.mark.slow

SEED, KILLS = 21, 8
SAVED = {"code.json", "inversion.json", "target.png", "redrawn.png", "rendering.png", "code.html", "overlay.png"}


class Command:
    """The command in a process of its own, and what a page would do."""

    def __init__(self, output):
        arguments = [sys.executable, "-c", COMMAND, "--port", "0", "--no-browser", "--output", str(output)]
        self.process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                                        start_new_session=True,
                                        preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_DFL))
        found = re.search(r"http://127.0.0.1:(\d+)/([\w-]+)/", self.process.stdout.readline())
        self.token, self.page = found[2], Studio(int(found[1]), output)

    def tab(self):
        return self.page.tab(self.token)

    def send(self, data, name="picture.png"):
        status, text = self.page.ask("POST", f"/{self.token}/picture?name={name}", data)
        return status, text.decode()

    def workers(self):
        return psutil.Process(self.process.pid).children(recursive=True)

    def end(self, number):
        """End it by a signal; what it said. Its processes are gone within five seconds."""
        workers = self.workers()
        self.process.send_signal(number)
        said = self.process.communicate(timeout=60)[1]
        _, alive = psutil.wait_procs(workers, timeout=5)
        for each in alive:
            each.kill()
        assert not alive, "a worker lives on"
        return said


@pytest.fixture
def start(tmp_path):
    pytest.importorskip("websockets")
    with contextlib.ExitStack() as stack:
        def started(output=tmp_path / "out"):
            command = Command(output)
            stack.callback(lambda: command.process.poll() is None and command.end(signal.SIGKILL))
            return command
        yield started


@pytest.fixture(scope="module")
def fern():
    return picture_of("fern")


def whole(folder):
    """The folders in which a code is saved, each with all files."""
    saved = [path.parent for path in folder.rglob("code.json") if "-session" not in path.parent.name]
    return [each for each in saved if {path.name for path in each.iterdir()} >= SAVED]


def test_a_page_that_is_killed_again_and_again_leaves_no_process_and_loses_no_code(start, fern, tmp_path):
    chance, seen = random.Random(SEED), None
    for number in range(KILLS):
        command = start()
        with command.tab() as tab:
            state = tab.until(lambda state: state["ready"] and free(state))
            if seen is not None:
                assert state["offer"], f"what kill {number} met was not offered"
                tab.do("resume")
                state = tab.until(lambda state: free(state) and state["code"])
                assert state["likeness"] >= seen - 0.02, (state["likeness"], seen)
            else:
                command.send(fern)
                tab.until(lambda state: free(state) and state["picture"])
            tab.do(*(("go_on",) if state["can_go_on"] else ("find",)))
            state = tab.until(lambda state: state["task"] == "find" and state["likeness"])
            end = time.monotonic() + chance.uniform(0, 5)
            while time.monotonic() < end:
                state = tab.until(lambda state: True) if not free(state) else state
            seen = state["likeness"]
            time.sleep(0.5)  # of what a page was told in the last moments, nothing is promised
        command.end(signal.SIGKILL)
    assert seen is not None


def test_a_save_that_is_killed_leaves_a_whole_folder_or_an_offer(start, fern, tmp_path):
    chance, tried = random.Random(SEED), 0
    for number in range(KILLS):
        output = tmp_path / str(number)
        command = start(output)
        with command.tab() as tab:
            command.send(fern)
            tab.until(lambda state: free(state) and state["picture"])
            tab.do("edit", code=plain(attractor.normalize(codes.known("fern"))))
            tab.until(lambda state: free(state) and state["judged"])
            time.sleep(0.5)
            tab.do("save")
            time.sleep(chance.uniform(0, 3))
            command.end(signal.SIGKILL)
        again = start(output)
        with again.tab() as tab:
            offer = tab.until(free)["offer"]
        assert whole(output) or offer, f"kill {number}"
        tried += offer is not None
        again.end(signal.SIGKILL)
    assert tried


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGINT, signal.SIGTERM])
def test_the_end_of_a_terminal_keeps_the_code_and_says_so_without_a_traceback(start, fern, tmp_path, number):
    command = start()
    with command.tab() as tab:
        command.send(fern)
        tab.until(lambda state: free(state) and state["picture"])
        tab.do("find", settings={})
        tab.until(lambda state: state["likeness"])
        said = command.end(number)
    kept, = tmp_path.rglob("code.json")
    assert str(kept) in said and "Traceback" not in said and len(IFS.load(kept)) > 0
    again = start()
    with again.tab() as tab:
        assert tab.until(free)["offer"]["maps"] == len(IFS.load(kept))


def test_the_memory_that_a_picture_takes_is_bounded_whatever_it_declares(start):
    command = start()
    flat = Image.new("L", (9900, 9900), 255)
    ImageDraw.Draw(flat).polygon([(2000, 9000), (5000, 1000), (8000, 9000)], fill=0)
    with command.tab() as tab:
        tab.until(lambda state: state["ready"])
        server = psutil.Process(command.process.pid)
        before = server.memory_info().rss
        status, why = command.send(declared(20_000, 1))
        assert status == 400 and "million" in why
        for rows in (1, 500):
            status, why = command.send(declared(9900, rows))
            assert status == 400 and "damaged" in why, why
        assert command.send(png(flat))[0] == 200
        with ThreadPoolExecutor(8) as threads:
            asked = threads.map(lambda _: command.page.ask("GET", f"/{command.token}/given.png")[0], range(8))
            assert set(asked) == {200}
    peak = int(re.search(r"VmHWM:\s+(\d+)", open(f"/proc/{server.pid}/status").read())[1]) * 1024
    print(f"a picture of {len(png(flat))} bytes and 98 million pixels: {(peak - before) / 2**20:.0f} MiB at most")
    assert peak - before < 700 * 2**20
    assert "Traceback" not in command.end(signal.SIGINT)
