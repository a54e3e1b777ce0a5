"""Optional: sweeps that log to an MLflow server on PostgreSQL, which goes away for a while (`make test-launchers`)."""

import importlib.util
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

import pytest
from processes import wait_for
from sweeps_helpers import start

from fractal_exp import tracking
from fractal_exp.studies import report

pytestmark = pytest.mark.optional
POSTGRES = Path(__file__).parent / "postgres.sh"
AWAY = 20.0  # seconds
ITERATIONS = 300


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def database():
    if os.geteuid() or not shutil.which("apt-get") or not importlib.util.find_spec("psycopg"):
        pytest.skip("needs root on Debian, and psycopg; `make test-launchers` brings the rest")
    port = free_port()
    with tempfile.TemporaryDirectory(prefix="fractal-exp-postgres-") as folder:  # pytest's own let no other user in
        subprocess.run([POSTGRES, "start", folder, str(port)], check=True)
        yield f"postgresql+psycopg://fractal@127.0.0.1:{port}/mlflow"
        subprocess.run([POSTGRES, "stop", folder], check=True)


class Server:
    """An `mlflow server` that can be taken away and brought back."""

    def __init__(self, database: str, folder: Path) -> None:
        self.port = free_port()
        self.uri = f"http://127.0.0.1:{self.port}"
        self.command = [sys.executable, "-m", "mlflow", "server", "--backend-store-uri", database, "--port",
                        str(self.port), "--artifacts-destination", str(folder), "--serve-artifacts", "--workers", "2"]
        self.start()

    def start(self) -> None:
        self.process = subprocess.Popen(self.command, env={**os.environ, "MLFLOW_DISABLE_TELEMETRY": "true"},
                                        start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        wait_for(self.answers, "waited for the server", self.process)

    def answers(self) -> bool:
        try:
            return urllib.request.urlopen(f"{self.uri}/health", timeout=5).status == 200
        except OSError:
            return False

    def stop(self) -> None:
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()


@pytest.fixture
def server(database, tmp_path):
    server = Server(database, tmp_path / "artifacts")
    yield server
    server.stop()


def test_four_workers_lose_nothing_while_the_server_is_away(server, tmp_path):
    words = ["function_count", "sweep.count=2", "model.maps=3,5", "launch=joblib", "sweep.workers=4",
             f"iterations={ITERATIONS}", "checkpoint_every=20"]
    process = start(tmp_path, *words, MLFLOW_TRACKING_URI=server.uri)

    def in_work() -> bool:
        return len(list(tmp_path.glob("function_count/*/*/checkpoint.safetensors"))) == 4

    wait_for(in_work, "waited for four checkpoints", process)
    server.stop()
    time.sleep(AWAY)
    server.start()
    printed, _ = process.communicate(timeout=300)
    assert process.returncode == 0 and "4 of 4 jobs finished" in printed, printed

    sweep = report.read_sweep(server.uri, "function_count")
    runs = tracking.runs_frame(server.uri, "function_count")
    assert set(runs["status"]) == {"FINISHED"} and len(runs) == 5 and not (tmp_path / "mlflow.db").exists()
    for run_id in sweep.jobs["run_id"]:
        for name in ("train/loss", "train/temperature"):
            steps = tracking.read_series(server.uri, run_id, name)["step"]
            assert list(steps) == list(range(1, ITERATIONS + 1)), name
        assert tracking.read_artifact(server.uri, run_id, "code.json")
    logs = [path.read_text() for path in tmp_path.glob("function_count/*/*/log.txt")]
    assert all("tracking: everything arrived after" in log for log in logs), "each of them met the outage"
