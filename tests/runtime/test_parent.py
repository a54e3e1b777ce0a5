"""A worker ends with the process that it works for, whoever started the worker."""

import os
import signal
import subprocess
import sys
import time

import pytest

from fractal_exp.runtime import parent

WORKER = """
import sys, time
from fractal_exp.runtime import parent

parent.POLL_SECONDS = 0.01
parent.follow(int(sys.argv[1]))
time.sleep(0.5)
print("alive", flush=True)
time.sleep(60)
"""
SLEEP = [sys.executable, "-c", "import time; time.sleep(120)"]


def ends(pid):
    end = time.monotonic() + 5
    while parent.is_alive(pid):
        if time.monotonic() > end:
            os.kill(pid, signal.SIGKILL)
            pytest.fail("it lives on")
        time.sleep(0.05)


def test_a_worker_that_another_process_started_lives_as_long_as_the_sweep():
    with subprocess.Popen(SLEEP) as sweep, subprocess.Popen([sys.executable, "-c", WORKER, str(sweep.pid)], text=True,
                                                            stdout=subprocess.PIPE) as worker:
        said = worker.stdout.readline()
        sweep.kill()
        assert said == "alive\n" and worker.wait(30) == 143


def test_a_worker_whose_sweep_is_gone_already_ends():
    with subprocess.Popen(SLEEP) as sweep:
        sweep.kill()
    done = subprocess.run([sys.executable, "-c", WORKER, str(sweep.pid)], capture_output=True, text=True, timeout=50)
    assert done.returncode == 143 and done.stdout == ""


SPINNING = """
import multiprocessing, os, time
from fractal_exp.runtime import parent

def spin():
    parent.follow_starter()
    print(os.getpid(), flush=True)
    while True:  # the busiest of tasks: it looks at nothing
        pass

if __name__ == "__main__":
    multiprocessing.get_context("spawn").Process(target=spin, daemon=True).start()
    time.sleep(600)
"""


def test_a_busy_process_ends_with_the_one_that_started_it_however_that_ends(tmp_path):
    (tmp_path / "spinning.py").write_text(SPINNING)
    with subprocess.Popen([sys.executable, tmp_path / "spinning.py"], stdout=subprocess.PIPE, text=True) as starter:
        pid = int(starter.stdout.readline())
        assert parent.is_alive(pid)
        starter.kill()
    ends(pid)


STARTING = f"""
import subprocess, time
from fractal_exp.runtime.parent import following

sleep = "import os, time; print(os.getpid(), flush=True); time.sleep(600)"
subprocess.Popen(following([{sys.executable!r}, "-c", sleep]), start_new_session=True)
time.sleep(600)
"""


def test_a_command_of_others_ends_with_the_process_that_started_it():
    with subprocess.Popen([sys.executable, "-c", STARTING], stdout=subprocess.PIPE, text=True) as starter:
        pid = int(starter.stdout.readline())
        assert parent.is_alive(pid)
        starter.kill()
    ends(pid)


def test_a_command_of_others_ends_with_its_own_status():
    command = parent.following([sys.executable, "-c", "import sys; sys.exit(7)"])
    assert subprocess.run(command, start_new_session=True, timeout=60).returncode == 7
