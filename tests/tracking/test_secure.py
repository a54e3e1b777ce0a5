"""What outlives a kill: values on their way to the store, and no password."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
from tracking_helpers import Between, get

from fractal_exp import tracking
from fractal_exp.tracking.run import MlflowTracker

# A run that is killed right after a checkpoint, with the store away: nothing of it was sent.
KILLED = """
import os, signal, sys
import numpy as np
from fractal_exp import tracking

run = tracking.start_run(sys.argv[1], "study", "fit", folder=sys.argv[2], params={"rate": 0.1})
run.log({"train/loss": 0.0}, 0)
run._outbox._send = lambda end: (_ for _ in ()).throw(ConnectionError("refused by the test"))
for step in range(1, 6):
    run.log({"train/loss": step / 10}, step)
run.image("preview", np.ones((4, 4)), 5)
run.secure()
run.log({"train/loss": 0.6}, 6)
print(run.run_id, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_what_was_secured_of_a_run_that_is_never_resumed_can_be_delivered(uri, tmp_path):
    done = subprocess.run([sys.executable, "-c", KILLED, uri, str(tmp_path)], capture_output=True, text=True)
    assert done.returncode == -signal.SIGKILL, done.stderr
    run_id = done.stdout.strip()
    tracking.mark_killed_runs(uri)
    assert tracking.deliver(tmp_path) == [run_id]
    assert set(tracking.read_series(uri, run_id, "train/loss")["step"]) >= set(range(1, 6))
    ended = get(uri, run_id)
    assert ended.info.status == "KILLED" and "killed: process" in ended.data.tags["error"]


def test_what_was_sent_and_secured_is_there_once(uri, start, tmp_path):
    run_id = start().run_id
    lost = MlflowTracker(Between(uri, {"log_batch", "log_artifact"}, lambda: True), run_id, tmp_path)
    lost.log({"train/loss": 0.5}, 1)
    lost.image("preview", np.ones((4, 4)), 1)
    lost.secure()  # and sent after all, by the time of the kill
    lost._outbox._abandoned = True
    note = json.loads((tmp_path / f"undelivered-{run_id}" / "run.json").read_text())
    assert note["status"] is None and [entry["name"] for entry in note["files"]] == ["preview"]
    again = MlflowTracker(lost._outbox._client.real, run_id, tmp_path)
    again.log({"train/loss": 0.5}, 1)
    again.finish()
    assert len(tracking.read_series(uri, run_id, "train/loss")) == 1
    assert os.listdir(tmp_path) == []
