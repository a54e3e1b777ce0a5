"""A worker ends with the process that it works for, whoever started the worker."""

import subprocess
import sys

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
