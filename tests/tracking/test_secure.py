"""What outlives a kill: values on their way to the store, and no password."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tracking_helpers import Between, artifacts, get

from fractal_exp import tracking
from fractal_exp.tracking.run import MlflowTracker

# For each folder a run that is killed right after a checkpoint, with the store away: nothing of it was sent. They are
# forked before anything is opened, so that torch and MLflow are imported once.
KILLED = """
import os, signal, sys
import mlflow, numpy as np
from fractal_exp import tracking

for folder in sys.argv[2:]:
    if os.fork() == 0:
        break
    assert os.wait()[1] == signal.SIGKILL
else:
    sys.exit()
run = tracking.start_run(sys.argv[1], "study", "fit", folder=folder, params={"rate": 0.1})
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


@pytest.fixture(scope="module")
def killed(uri, tmp_path_factory) -> list[tuple[str, Path]]:
    """Two runs and their folders; a test uses one up."""
    folders = [tmp_path_factory.mktemp("killed") for _ in range(2)]
    done = subprocess.run([sys.executable, "-c", KILLED, uri, *map(str, folders)], capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stderr
    return list(zip(done.stdout.split(), folders, strict=True))


@pytest.mark.slow
def test_what_was_secured_before_a_kill_is_there_once_after_resuming(uri, killed):
    run_id, folder = killed[0]
    params = {"rate": 0.1}
    with tracking.start_run(uri, "study", "fit", folder=folder, params=params, resume_run_id=run_id) as run:
        for step in range(4, 9):  # from a checkpoint before what is on record
            run.log({"train/loss": step / 10}, step)
        run.image("preview", np.ones((4, 4)), 5)
    series = tracking.read_series(uri, run_id, "train/loss")
    assert series["step"].tolist() == list(range(9)) and series["value"].tolist() == [step / 10 for step in range(9)]
    assert len(artifacts(uri, run_id, "images")) == 2, "one picture, in two sizes"
    assert list(folder.iterdir()) == []


def test_what_was_secured_of_a_run_that_is_never_resumed_can_be_delivered(uri, killed):
    run_id, folder = killed[1]
    tracking.mark_killed_runs(uri)
    assert tracking.deliver(folder) == [run_id]
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
