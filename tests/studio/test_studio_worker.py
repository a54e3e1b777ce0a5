"""The studio's other process: it ends with the studio, and never gets lost in a task."""

import os
import subprocess
import sys
import time

import pytest

from fractal_exp.runtime.parent import is_alive

SPINNING = """
import os, time
from fractal_exp.studio.worker import Worker

def spin(pipe):
    print(os.getpid(), flush=True)
    while True:  # the busiest of tasks: it looks at nothing
        pass

if __name__ == "__main__":
    worker = Worker(print, spin)
    time.sleep(600)
"""


def test_a_killed_studio_leaves_no_process_at_work(tmp_path):
    (tmp_path / "spinning.py").write_text(SPINNING)
    with subprocess.Popen([sys.executable, tmp_path / "spinning.py"], stdout=subprocess.PIPE, text=True) as studio:
        pid = int(studio.stdout.readline())
        assert is_alive(pid)
        studio.kill()
    end = time.monotonic() + 5
    while is_alive(pid):
        if time.monotonic() > end:
            os.kill(pid, 9)
            pytest.fail("the worker lives on")
        time.sleep(0.05)
