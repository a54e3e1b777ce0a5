import json
import os
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest
import torch
from PIL import Image

from fractal_exp import InputError, tracking
from fractal_exp.tracking import __main__ as command
from fractal_exp.tracking import outbox, store
from fractal_exp.tracking.run import MlflowTracker

# Four workers, forked before anything is opened so that torch and MLflow are imported once. They make the store
# together, start, log, say who they are, and end when stdin does.
WORKERS = """
import os, sys
from fractal_exp import tracking
assert not {"mlflow", "pandas"} & set(sys.modules), "importing the package must stay cheap"
import mlflow

barrier = os.pipe()
for _ in range(4):
    if os.fork() == 0:
        os.close(barrier[1])
        os.read(barrier[0], 1)
        uri = tracking.prepare_store(sys.argv[1])
        with tracking.start_run(uri, "workers", "worker", folder=sys.argv[1], params={"a": 1}) as run:
            for step in range(500):
                run.log({"train/loss": step / 500, "train/rate": 1.0}, step)
            os.write(1, f"{os.getpid()} {run.run_id}\\n".encode())
            os.close(1)
            sys.stdin.read()
        os._exit(0)
os.close(barrier[1])
os.close(1)  # so that the test comes to an end of file should a worker die
sys.stdin.read()
sys.exit(sum(os.wait()[1] == 0 for _ in range(4)))
"""


@pytest.fixture(autouse=True)
def no_server(monkeypatch):
    monkeypatch.delenv("MLFLOW_TRACKING_URI", raising=False)


@pytest.fixture(scope="module")
def uri(tmp_path_factory):
    os.environ.pop("MLFLOW_TRACKING_URI", None)
    return tracking.prepare_store(tmp_path_factory.mktemp("out put é%#"))


@pytest.fixture
def start(uri, tmp_path):
    def start(name="fit", **options):
        return tracking.start_run(uri, "study", name, folder=tmp_path, **options)
    return start


@pytest.fixture
def impatient(monkeypatch):
    """Outages last milliseconds here."""
    monkeypatch.setattr(outbox, "FIRST_RETRY", 0.002)
    monkeypatch.setattr(outbox, "LAST_RETRY", 0.01)
    monkeypatch.setattr(store, "FIRST_RETRY", 0.01)


class Between:
    """A client in front of the real one that counts calls, and fails each of `failing` while `away` says so."""

    def __init__(self, uri, failing=(), away=lambda: False):
        self.real, self.failing, self.away, self.calls = store.connect(uri), failing, away, []

    def __getattr__(self, name):
        value = getattr(self.real, name)
        if not callable(value):
            return value

        def call(*args, **kwargs):
            self.calls.append((name, kwargs))
            if name in self.failing and self.away():
                raise ConnectionError("refused by the test")
            return value(*args, **kwargs)
        return call


def get(uri, run_id):
    return store.connect(uri).get_run(run_id)


def artifacts(uri, run_id, folder=None):
    return {item.path for item in store.connect(uri).list_artifacts(run_id, folder)}


# The store

def test_store_is_sqlite_in_wal_mode_at_an_absolute_path(uri):
    path = store.database_path(uri)
    assert path.is_absolute() and path.name == "mlflow.db"
    with sqlite3.connect(path) as connection:
        assert connection.execute("PRAGMA journal_mode").fetchone()[0] == "wal"


def test_working_directory_and_global_state_of_mlflow_stay_clean(uri, start, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with start() as run:
        run.artifact("a.txt", "a")
    import mlflow

    assert mlflow.active_run() is None and "MLFLOW_TRACKING_URI" not in os.environ
    assert uri not in mlflow.get_tracking_uri()
    assert list(tmp_path.iterdir()) == []
    assert (store.database_path(uri).parent / "mlartifacts" / run.run_id / "artifacts" / "a.txt").read_text() == "a"


def test_folder_that_cannot_be_written_is_an_input_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot keep runs in .*choose an output folder that can be written"):
        tracking.prepare_store(tmp_path / "file" / "out")


def test_a_file_that_is_no_database_is_an_input_error(tmp_path):
    (tmp_path / "mlflow.db").write_text("no database" * 1000)
    with pytest.raises(InputError, match="cannot keep runs in .*not a database"):
        tracking.prepare_store(tmp_path)


def test_a_store_of_another_mlflow_version_names_the_command(uri, tmp_path):
    with sqlite3.connect(store.database_path(uri)) as source, sqlite3.connect(tmp_path / "mlflow.db") as copy:
        source.backup(copy)
        copy.execute("UPDATE alembic_version SET version_num = 'ffffffffffff'")
    with pytest.raises(InputError, match="cannot use .*mlflow.db.*mlflow db upgrade 'sqlite:///"):
        tracking.prepare_store(tmp_path)


@pytest.mark.parametrize("address", ["mlruns", "file:///tmp/mlruns", "sqlite:///mlflow.db", "postgresql://a/b"])
def test_other_stores_are_refused(address, tmp_path, monkeypatch):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", address)
    with pytest.raises(InputError, match="correct MLFLOW_TRACKING_URI"):
        tracking.prepare_store(tmp_path)


def test_a_server_that_does_not_answer_is_an_input_error_without_its_password(tmp_path, monkeypatch, impatient):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://somebody:secret@127.0.0.1:9")
    monkeypatch.setattr(store, "FIRST_PATIENCE", 0.1)
    with pytest.raises(InputError, match=r"127.0.0.1:9 does not answer \(Conn.*refused\); start it") as caught:
        tracking.prepare_store(tmp_path)
    assert "secret" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


# What is logged

def test_buffered_metrics_arrive_with_their_steps_in_few_calls(uri, start, tmp_path):
    run_id = start().run_id
    client = Between(uri)
    run = MlflowTracker(client, run_id, tmp_path)
    for step in range(3000):
        run.log({"train/loss": 1 / (step + 1), "train/rate": torch.tensor(0.5)}, step)
    run.finish()
    series = tracking.read_series(uri, run_id, "train/loss")
    assert series["step"].tolist() == list(range(3000))
    np.testing.assert_array_equal(series["value"], 1 / np.arange(1, 3001))
    assert len(tracking.read_series(uri, run_id, "train/rate")) == 3000
    sizes = [len(kwargs["metrics"]) for name, kwargs in client.calls if name == "log_batch"]
    assert sum(sizes) == 6000 and max(sizes) <= 1000 and len(sizes) <= 12
    assert get(uri, run_id).info.status == "FINISHED"


def test_non_finite_values_are_left_out_and_counted(uri, start):
    with start() as run:
        run.log({"train/loss": float("nan"), "train/rate": 1.0}, 7)
        run.log({"train/loss": float("inf")}, 8)
        run.log({"train/loss": 2.0}, 9)
    data = get(uri, run.run_id).data
    assert data.metrics == {"train/loss": 2.0, "train/rate": 1.0}
    assert data.tags["non_finite"] == "train/loss: 2, first nan at step 7"


@pytest.mark.parametrize("name", ["loss (mean)", "a//b", "/a", "../a", "", "a/", "é(", "x" * 251])
def test_names_that_mlflow_refuses_are_input_errors(start, name):
    with start() as run:
        with pytest.raises(InputError, match="metric names are letters"):
            run.log({name: 1.0})
        with pytest.raises(InputError, match="artifact names are letters"):
            run.artifact(name, "text")
        with pytest.raises(InputError, match="image names are letters"):
            run.image(name, np.zeros((4, 4)), 0)


@pytest.mark.parametrize("name", ["train/loss", "eval/f1", "a.b-c_d e:f/g", "größe"])
def test_names_that_mlflow_takes_are_taken(uri, start, name):
    with start() as run:
        run.log({name: 1.0})
    assert get(uri, run.run_id).data.metrics == {name: 1.0}


def test_images_come_back(uri, start):
    pixels = (np.arange(64).reshape(8, 8) / 63).astype(np.float32)
    with start() as run:
        run.image("preview", torch.from_numpy(pixels), 50)
        run.image("whole", pixels)
        run.image("zoom/4x", Image.fromarray(np.zeros((8, 8, 3), np.uint8)))
    assert {"views/whole.png", "views/zoom"} == artifacts(uri, run.run_id, "views")
    with Image.open(store.database_path(uri).parent / "mlartifacts" / run.run_id / "artifacts/views/whole.png") as png:
        np.testing.assert_array_equal(np.asarray(png), np.rint(255 * pixels))
    previews = artifacts(uri, run.run_id, "images")
    assert any(re.match(r"images/preview\+step\+50\+.*\.png", name) for name in previews), previews


@pytest.mark.parametrize("image, message", [
    (np.full((4, 4), 1.5), r"in \[0,1\] or be uint8, got values from 1.5"),
    (np.full((4, 4), np.nan), "got values from nan"),
    (np.zeros((2, 5, 5)), r"must have shape .*got \(2, 5, 5\)"),
])
def test_what_is_no_image_is_an_input_error(start, image, message):
    with start() as run, pytest.raises(InputError, match=message):
        run.image("preview", image, 0)


def test_tables_come_back_and_are_replaced_not_appended(uri, start):
    frame = pd.DataFrame({"view": ["whole", "a"], "zoom": [1.0, 1 / 3], "psnr": [20.1, np.inf]})
    with start() as run:
        run.table("per_view.json", frame.iloc[:1])
        run.table("per_view.json", frame)
        with pytest.raises(InputError, match="must end in .json"):
            run.table("per_view.csv", frame)
    back = tracking.read_table(uri, run.run_id, "per_view.json")
    pd.testing.assert_frame_equal(back, frame.replace(np.inf, np.nan))
    assert json.loads(get(uri, run.run_id).data.tags["mlflow.loggedArtifacts"]) == [
        {"path": "per_view.json", "type": "table"}]


def test_artifacts_come_back(uri, start, tmp_path):
    (tmp_path / "code.json").write_text("{}")
    with start() as run:
        run.artifact("code.json", tmp_path / "code.json")
        (tmp_path / "code.json").write_text("changed afterwards")
        run.artifact("notes/bytes.bin", b"\x00\x01")
    assert tracking.read_artifact(uri, run.run_id, "code.json") == b"{}"
    assert tracking.read_artifact(uri, run.run_id, "notes/bytes.bin") == b"\x00\x01"
    with pytest.raises(InputError, match=r"no artifact 'code.txt'.*\['code.json'\]"):
        tracking.read_artifact(uri, run.run_id, "code.txt")


def test_parameters_are_flattened_and_long_ones_become_files(uri, start):
    with start(params={"model": {"kind": "svd", "maps": 10}, "seed": None, "path": "x" * 6001}) as run:
        pass
    params = get(uri, run.run_id).data.params
    assert params.pop("path").startswith("6001 characters, sha256 ")
    assert params == {"model.kind": "svd", "model.maps": "10", "seed": "None"}
    assert tracking.read_artifact(uri, run.run_id, "params/path.txt") == b"x" * 6001


def test_standard_tags_and_nesting(uri, start):
    tags = tracking.standard_tags(variant="full", method="chaotic", target="fern", scale="smoke", backend="cpu",
                                  device="cpu", study="s1")
    with start("sweep") as parent, start("child", tags=tags, parent_run_id=parent.run_id) as child:
        pass
    kept = get(uri, child.run_id).data.tags
    assert kept["mlflow.parentRunId"] == parent.run_id
    assert tags.items() <= kept.items() and tags["perceptual"] == "none" and tags["study"] == "s1"
    assert kept["pid"] == str(os.getpid()) and kept["host"] and kept["process_start"] and kept["device_name"]
    assert re.fullmatch(r"\d+\.\d+.*", kept["version"])
    assert re.fullmatch(r"[0-9a-f]{40}(-dirty)?", kept.get("git_commit", "0" * 40))


# How a run ends

def test_leaving_by_exception_is_failed_with_its_traceback(uri, start):
    with pytest.raises(RuntimeError), start() as run:
        run.log({"train/loss": 1.0}, 3)
        raise RuntimeError("it broke\nin two lines")
    ended = get(uri, run.run_id)
    assert ended.info.status == "FAILED" and ended.data.tags["error"] == "RuntimeError: it broke"
    assert ended.data.metrics == {"train/loss": 1.0}
    assert b"raise RuntimeError(" in tracking.read_artifact(uri, run.run_id, "traceback.txt")


@pytest.mark.parametrize("error, status", [(KeyboardInterrupt(), "KILLED"), (SystemExit(0), "FINISHED"),
                                           (SystemExit(1), "FAILED")])
def test_other_ways_out(uri, start, error, status):
    with pytest.raises(type(error)), start() as run:
        raise error
    assert get(uri, run.run_id).info.status == status


def test_finish_counts_once(uri, start):
    with start() as run:
        run.finish("FAILED", "the code was not contractive")
    ended = get(uri, run.run_id)
    assert ended.info.status == "FAILED" and ended.data.tags["error"] == "the code was not contractive"
    with pytest.raises(ValueError, match="'DONE'"):
        run.finish("DONE")


# Going on

def test_resuming_keeps_the_run_and_logs_nothing_twice(uri, start):
    params = {"rate": 0.1}
    with pytest.raises(KeyboardInterrupt), start(params=params) as run:
        for step in range(5):
            run.log({"train/loss": 1.0 / (step + 1)}, step)
        run.table("per_view.json", pd.DataFrame({"f1": [0.5]}))
        raise KeyboardInterrupt
    with start(params=params, resume_run_id=run.run_id) as again:
        reopened = get(uri, run.run_id)
        assert reopened.info.status == "RUNNING" and "error" not in reopened.data.tags
        for step in range(3, 8):  # from the checkpoint at step 3
            again.log({"train/loss": 1.0 / (step + 1)}, step)
        again.table("per_view.json", pd.DataFrame({"f1": [0.7]}))
    assert again.run_id == run.run_id and get(uri, run.run_id).info.status == "FINISHED"
    assert tracking.read_series(uri, run.run_id, "train/loss")["step"].tolist() == list(range(8))
    assert tracking.read_table(uri, run.run_id, "per_view.json")["f1"].tolist() == [0.7]


def test_resuming_takes_another_value_at_a_step_on_record(uri, start):
    with start() as run:
        run.log({"eval/f1": 0.5})
    with start(resume_run_id=run.run_id) as again:
        time.sleep(0.002)
        again.log({"eval/f1": 0.4})
    assert get(uri, run.run_id).data.metrics == {"eval/f1": 0.4}


def test_resuming_with_another_parameter_or_a_run_that_is_gone_is_an_input_error(uri, start):
    with start(params={"rate": 0.1}) as run:
        pass
    with pytest.raises(InputError, match="started with rate=0.1 and cannot go on with rate=0.2"):
        start(params={"rate": 0.2}, resume_run_id=run.run_id)
    store.connect(uri).delete_run(run.run_id)
    with pytest.raises(InputError, match="was deleted; restore it with"):
        start(resume_run_id=run.run_id)
    with pytest.raises(InputError, match="has no run 0123abc to resume"):
        start(resume_run_id="0123abc")


def test_a_deleted_study_is_an_input_error(uri, tmp_path):
    client = store.connect(uri)
    client.delete_experiment(client.create_experiment("deleted"))
    with pytest.raises(InputError, match="'deleted' was deleted.*experiments restore --experiment-id"):
        tracking.start_run(uri, "deleted", "fit", folder=tmp_path)


# The store is away

def test_no_metric_is_lost_while_the_store_is_away(uri, start, tmp_path, impatient, capsys):
    run_id = start().run_id
    failures = iter(range(7))
    client = Between(uri, {"log_batch", "log_artifact", "set_terminated"}, lambda: next(failures, None) is not None)
    run = MlflowTracker(client, run_id, tmp_path)
    for step in range(2500):
        run.log({"train/loss": step}, step)
    run.artifact("code.json", "{}")
    run.finish()
    assert next(failures, None) is None
    assert tracking.read_series(uri, run_id, "train/loss")["value"].tolist() == list(range(2500))
    assert tracking.read_artifact(uri, run_id, "code.json") == b"{}"
    assert get(uri, run_id).info.status == "FINISHED"
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2 and "the fit goes on" in said[0] and "everything arrived" in said[1]
    assert list(tmp_path.iterdir()) == []


def test_what_a_lost_store_did_not_take_is_kept_and_delivered(uri, start, tmp_path, impatient, monkeypatch, capsys):
    monkeypatch.setattr(outbox, "LAST_WAIT", 1.0)
    run_id = start().run_id
    client = Between(uri, {"log_batch", "log_artifact", "log_image", "set_terminated"}, lambda: True)
    with pytest.raises(RuntimeError, match="broke"), MlflowTracker(client, run_id, tmp_path) as run:
        run.log({"train/loss": 0.1}, 4)
        run.image("preview", np.ones((4, 4)), 4)
        run.table("per_view.json", pd.DataFrame({"f1": [0.5]}))
        raise RuntimeError("broke")
    assert f"tracking deliver '{tmp_path}'" in capsys.readouterr().err
    assert (tmp_path / f"undelivered-{run_id}" / "0-preview").read_bytes().startswith(b"\x89PNG")
    assert get(uri, run_id).info.status == "RUNNING"

    assert tracking.deliver(tmp_path) == [run_id]
    ended = get(uri, run_id)
    assert ended.info.status == "FAILED" and ended.data.tags["error"] == "RuntimeError: broke"
    assert tracking.read_series(uri, run_id, "train/loss")[["step", "value"]].values.tolist() == [[4, 0.1]]
    assert tracking.read_table(uri, run_id, "per_view.json")["f1"].tolist() == [0.5]
    assert len(artifacts(uri, run_id, "images")) == 2 and artifacts(uri, run_id) > {"traceback.txt"}
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(InputError, match="nothing waits"):
        tracking.deliver(tmp_path)


def test_one_refused_file_holds_up_nothing_else(uri, start, tmp_path, impatient, monkeypatch):
    monkeypatch.setattr(outbox, "LAST_WAIT", 1.0)
    run_id = start().run_id
    run = MlflowTracker(Between(uri, {"log_image"}, lambda: True), run_id, tmp_path)
    run.image("preview", np.ones((4, 4)), 0)
    run.artifact("code.json", "{}")
    run.log({"train/loss": 1.0})
    run.finish()
    assert tracking.read_artifact(uri, run_id, "code.json") == b"{}"
    ended = get(uri, run_id)
    assert ended.info.status == "FINISHED" and ended.data.metrics == {"train/loss": 1.0}
    assert (tmp_path / f"undelivered-{run_id}" / "0-preview").exists()


# Several processes

def test_four_processes_start_at_once_and_a_killed_one_is_marked(tmp_path):
    with subprocess.Popen([sys.executable, "-c", WORKERS, str(tmp_path)], stdin=subprocess.PIPE,
                          stdout=subprocess.PIPE, text=True) as workers:
        ids = dict(line.split() for line in (workers.stdout.readline() for _ in range(4)))
        uri = tracking.prepare_store(tmp_path)
        pid, run_id = next(iter(ids.items()))
        assert get(uri, run_id).info.status == "RUNNING"
        with pytest.raises(InputError, match=f"is being written by process {pid}"):
            tracking.start_run(uri, "workers", "fit", folder=tmp_path, resume_run_id=run_id)
        os.kill(int(pid), signal.SIGKILL)
        for _ in range(500):  # nobody waits for it yet, so it stays as a zombie; which must count as gone
            if store.process_start(int(pid)) is None:
                break
            time.sleep(0.01)
        tracking.prepare_store(tmp_path)
        killed = get(uri, run_id)
        assert killed.info.status == "KILLED" and f"process {pid} on" in killed.data.tags["error"]
        workers.stdin.close()
    assert workers.returncode == 3  # how many ended well
    del ids[pid]
    for run_id in ids.values():
        assert get(uri, run_id).info.status == "FINISHED"
        assert len(tracking.read_series(uri, run_id, "train/loss")) == 500


def test_a_reused_process_number_is_not_taken_for_the_process(uri, start):
    run = start()
    store.connect(uri).set_tag(run.run_id, "process_start", "another boot 123")
    assert tracking.mark_killed_runs(uri) == [run.run_id]
    run.finish()
    assert get(uri, run.run_id).info.status == "FINISHED"


# Reading back

def test_runs_frame(uri, tmp_path, monkeypatch):
    monkeypatch.setattr(store, "PAGE", 2)
    for i in range(5):
        with tracking.start_run(uri, "frame", f"fit {i}", folder=tmp_path, params={"i": i},
                                tags={"variant": "full" if i else "base"}) as run:
            run.log({"eval/f1": i / 10})
    frame = tracking.runs_frame(uri, "frame")
    assert frame["name"].tolist() == [f"fit {i}" for i in (4, 3, 2, 1, 0)]
    assert frame["metrics.eval/f1"].tolist() == [0.4, 0.3, 0.2, 0.1, 0.0]
    assert frame["params.i"].tolist() == list("43210")
    assert (frame["end_time"] >= frame["start_time"]).all()
    assert tracking.runs_frame(uri, "frame", "tags.variant = 'base'")["name"].tolist() == ["fit 0"]
    assert tracking.runs_frame(uri, "frame", "tags.variant = 'none'").columns.tolist() == [
        "run_id", "name", "status", "start_time", "end_time"]
    with pytest.raises(InputError, match="has no study 'other'; it has .*'frame'"):
        tracking.runs_frame(uri, "other")


def test_dashboard_command(uri, tmp_path, monkeypatch, capsys):
    folder = store.database_path(uri).parent
    assert uri in tracking.dashboard_command(folder, port=1)
    with pytest.raises(InputError, match=f"no runs under {tmp_path} yet"):
        tracking.dashboard_command(tmp_path)
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        with pytest.raises(InputError, match="is taken"):
            tracking.dashboard_command(folder, taken.getsockname()[1])
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "https://tracking.example")
    with pytest.raises(InputError, match="by the server https://tracking.example: open that address"):
        tracking.dashboard_command(folder)
    assert command.main(["dashboard", str(folder)]) == 2
    assert capsys.readouterr().err.startswith("error: the runs are kept by the server")


def test_no_tracker_takes_the_same_calls(tmp_path):
    with tracking.NoTracker() as run:
        run.log({"train/loss": 1.0}, 3)
        run.image("preview", np.zeros((4, 4)), 3)
        run.image("whole", np.zeros((4, 4)))
        run.artifact("code.json", "{}")
        run.table("per_view.json", pd.DataFrame())
    run.finish("FAILED", "error")
    assert run.run_id is None
    with pytest.raises(RuntimeError), tracking.NoTracker():
        raise RuntimeError
    assert issubclass(MlflowTracker, tracking.Tracker) and issubclass(tracking.NoTracker, tracking.Tracker)
