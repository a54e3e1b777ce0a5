"""The store of runs: where it is, what it refuses, several processes and outages, and reading back."""

import os
import signal
import socket
import sqlite3
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor, wait

import numpy as np
import pandas as pd
import pytest
from commands import refusal
from tracking_helpers import AT_ONCE, IMPATIENT, Between, artifacts, get

from fractal_exp import InputError, tracking
from fractal_exp.cli import report
from fractal_exp.tracking import __main__ as command
from fractal_exp.tracking import store
from fractal_exp.tracking.outbox import Patience
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


# Where it is

def test_store_is_sqlite_in_wal_mode_at_an_absolute_path(uri):
    path = store.database_path(uri)
    assert path.is_absolute() and path.name == "mlflow.db"
    with sqlite3.connect(path) as connection:
        assert connection.execute("PRAGMA journal_mode").fetchone()[0] == "wal"


def test_working_directory_and_global_state_of_mlflow_stay_clean(uri, start, folder):
    with start() as run:
        run.artifact("a.txt", "a")
    import mlflow

    assert mlflow.active_run() is None and "MLFLOW_TRACKING_URI" not in os.environ
    assert uri not in mlflow.get_tracking_uri()
    assert list(folder.iterdir()) == []
    assert (store.database_path(uri).parent / "mlartifacts" / run.run_id / "artifacts" / "a.txt").read_text() == "a"


def test_folder_that_cannot_be_written_is_an_input_error(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot keep runs in .*choose an output folder that can be written"):
        tracking.prepare_store(tmp_path / "file" / "out")


@pytest.mark.parametrize("damage", ["read-only", "no database"])
def test_a_store_that_cannot_be_used_is_one_line_for_whoever_reads_it(uri, damage, tmp_path, monkeypatch, capsys):
    if damage == "read-only":
        with sqlite3.connect(store.database_path(uri)) as source, sqlite3.connect(tmp_path / "mlflow.db") as copy:
            source.backup(copy)
        monkeypatch.setattr("fractal_exp.tracking.building.os.access", lambda *_: False)  # root may write anywhere
    else:
        (tmp_path / "mlflow.db").write_text("no database" * 1000)
    told = r"mlflow.db may not be written to" if damage == "read-only" else "mlflow.db: file is not a database"
    with pytest.raises(InputError, match=told):
        tracking.prepare_store(tmp_path)
    assert command.main(["dashboard", str(tmp_path), "--port", "1"]) == 2 and told in capsys.readouterr().err
    assert told in refusal(report, "study", "--output", tmp_path)


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


def test_a_server_that_does_not_answer_is_an_input_error_without_its_password(tmp_path, monkeypatch):
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://somebody:secret@127.0.0.1:9")
    with pytest.raises(InputError, match=r"127.0.0.1:9 does not answer \(Conn.*refused\); start it") as caught:
        tracking.prepare_store(tmp_path, patience=0.1)
    assert "secret" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []


# The store is away

def test_a_store_that_does_not_answer_at_once_is_asked_again(capsys):
    failures = iter([ConnectionError("refused")])

    def ask():
        for failure in failures:
            raise failure
        return "an answer"

    assert store.patiently("http://somebody:secret@127.0.0.1:9", ask) == "an answer"
    assert capsys.readouterr().err == "tracking: waiting for http://127.0.0.1:9 (ConnectionError: refused)\n"


def test_no_metric_is_lost_while_the_store_is_away(uri, start, tmp_path, capsys):
    run_id = start().run_id
    failures = iter(range(7))
    client = Between(uri, {"log_batch", "log_artifact", "set_terminated"}, lambda: next(failures, None) is not None)
    run = MlflowTracker(client, run_id, tmp_path, patience=IMPATIENT)
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


def test_what_a_lost_store_did_not_take_is_kept_and_delivered(uri, start, tmp_path, capsys):
    run_id = start().run_id
    client = Between(uri, {"log_batch", "log_artifact", "log_image", "set_terminated"}, lambda: True)
    with (pytest.raises(RuntimeError, match="broke"),
          MlflowTracker(client, run_id, tmp_path, patience=AT_ONCE) as run):
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


def test_one_refused_file_holds_up_nothing_else(uri, start, tmp_path):
    run_id = start().run_id
    without_images = Between(uri, {"log_image"}, lambda: True)
    run = MlflowTracker(without_images, run_id, tmp_path, patience=Patience(0.002, 0.01, 1.0))
    run.image("preview", np.ones((4, 4)), 0)
    run.artifact("code.json", "{}")
    run.log({"train/loss": 1.0})
    run.finish()
    assert tracking.read_artifact(uri, run_id, "code.json") == b"{}"
    ended = get(uri, run_id)
    assert ended.info.status == "FINISHED" and ended.data.metrics == {"train/loss": 1.0}
    assert (tmp_path / f"undelivered-{run_id}" / "0-preview").exists()


# Several processes

@pytest.mark.slow
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
            if not store.is_alive(int(pid)):
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
    store.connect(uri).set_tag(run.run_id, "process_start", "123.45")
    assert tracking.mark_killed_runs(uri) == [run.run_id]
    run.finish()
    assert get(uri, run.run_id).info.status == "FINISHED"


def held_up(uri, work, meanwhile):
    """Let work wait for another process, which does something meanwhile."""
    with ThreadPoolExecutor(1) as thread:
        with store.changing_hands(uri):
            waiting = thread.submit(work)
            wait([waiting], timeout=0.5)  # long enough for it to end, were it not made to wait
            meanwhile()
        waiting.result()


def test_a_run_that_another_process_goes_on_with_meanwhile_is_not_taken_for_killed(uri, start):
    run_id, client = start().run_id, store.connect(uri)
    client.set_tag(run_id, "process_start", "123.45")
    held_up(uri, lambda: tracking.mark_killed_runs(uri), lambda: client.set_terminated(run_id, "FAILED"))
    assert get(uri, run_id).info.status == "FAILED"


def test_a_run_is_not_gone_on_with_while_another_process_looks_for_killed_ones(uri, start):
    run_id, tags = start().run_id, []
    store.connect(uri).set_tag(run_id, "process_start", "123.45")
    held_up(uri, lambda: start(resume_run_id=run_id).finish(), lambda: tags.append(get(uri, run_id).data.tags))
    assert tags[0]["process_start"] == "123.45" and get(uri, run_id).info.status == "FINISHED"


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
    with pytest.raises(InputError, match="has no study 'other'; it has .*frame"):
        tracking.runs_frame(uri, "other")


def test_dashboard_command(uri, tmp_path, monkeypatch, capsys):
    folder = store.database_path(uri).parent
    assert uri in tracking.dashboard_command(folder, port=1)
    with pytest.raises(InputError, match=f"no runs are kept in {tmp_path}; fit something first"):
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
