"""The dashboard, opened where the scores are: MLflow's front page is about language models."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path
from typing import TYPE_CHECKING

from ..errors import InputError
from ..runtime.parent import following
from .addresses import database_path, shown, store_uri
from .building import artifacts, hide_default
from .client import ENVIRONMENT, connect
from .store import kept_runs, no_study, pages

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import Experiment

NOTE = "mlflow.note.content"  # the tag that MLflow shows as the description of an experiment or a run
SHARED = "mlflow.sharedViewState."  # and those in which it keeps views of an experiment, to be named in an address
KIND = "mlflow.experimentKind"  # without it MLflow guesses, and shows tools for language models
VIEW = "scores"
SCORES = ("f1", "iou", "psnr", "ssim", "lpips", "fractal_distance")  # the last two: by the distance in use
COLUMNS = [*(f"metrics.`eval/{name}`" for name in SCORES), "metrics.`time/fit_seconds`",
           *(f"tags.`{name}`" for name in ("target", "method", "variant", "scale", "row", "sample"))]
LAST_SECONDS = 5.0  # that the server has to end
ABOUT = """[All runs with their scores, best F1 first]({address}): each run of {name} recovers the code of a
self-similar shape from one image.

`eval/…` are mean scores over the views, `trivial/…` what an all white and an all black image would get there,
`train/…` what the method told step by step, `time/…` seconds. F1, IoU and SSIM are at most 1, more is better; PSNR is
in decibels."""


def describe(client: MlflowClient, experiment_id: str, name: str) -> None:
    """Give an experiment the view of its runs by F1 with scores as columns, and a description that leads there: who
    clicks on an experiment sees MLflow's own page, whose columns no store can choose."""
    view = {"orderByKey": COLUMNS[0], "orderByAsc": False, "selectedColumns": COLUMNS}
    for key, value in {f"{SHARED}{VIEW}": json.dumps(view), KIND: "custom_model_development",
                       NOTE: ABOUT.format(name=name, address=runs_address(".", experiment_id))}.items():
        client.set_experiment_tag(experiment_id, key, value)


def runs_address(server: str, experiment_id: str) -> str:
    """Where the runs of an experiment stand by F1, with their scores."""
    return f"{server}/#/experiments/{experiment_id}/runs?workflowType=machine_learning&viewStateShareKey={VIEW}"


def dashboard_command(folder: str | Path, port: int = 5000) -> list[str]:
    """The command that serves the runs kept under `folder` at http://127.0.0.1:`port`.

    Raises `InputError` if there are none yet or they cannot be read, if a server keeps them, or if the port is taken.
    """
    uri = store_uri(folder)
    database = database_path(uri)
    if database is None:
        raise InputError(f"the runs are kept by the server {shown(uri)}: open that address in the browser")
    kept_runs(folder)
    with socket.socket() as probe:
        if probe.connect_ex(("127.0.0.1", port)) == 0:
            raise InputError(f"port {port} is taken, perhaps by an open dashboard; choose another port")
    return [sys.executable, "-m", "mlflow", "ui", "--backend-store-uri", uri, "--port", str(port), "--workers", "1",
            "--uvicorn-opts", "--log-level warning", "--default-artifact-root", artifacts(database).as_uri()]


def serve(folder: str | Path, port: int = 5000, study: str | None = None) -> int:
    """Serve the runs under `folder` until Ctrl-C and print, once the server answers, where a study's runs stand.

    study: the newest if None. Returns the exit status. Raises `InputError` as `dashboard_command` does, if there is no
    such study, or if the server ends before it answers.
    """
    command = dashboard_command(folder, port)
    client = connect(command[command.index("--backend-store-uri") + 1])
    experiment = _experiment(client, study)
    hide_default(client)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))
    print("dashboard: starting", flush=True)
    server = subprocess.Popen(following(command), env={**ENVIRONMENT, **os.environ}, stdout=subprocess.DEVNULL,
                              stderr=subprocess.PIPE, text=True, start_new_session=True)
    try:
        _wait_for(server, f"http://127.0.0.1:{port}")
        address = runs_address(f"http://127.0.0.1:{port}", experiment.experiment_id)
        print(f"dashboard: the runs of {experiment.name}, best F1 first (Ctrl-C ends it)\n  {address}\n"
              f"  {address}&compareRunsMode=CHART  as charts", flush=True)
        for line in server.stderr or ():
            print(line, end="", file=sys.stderr)
        return server.wait()
    except KeyboardInterrupt:
        return 0
    finally:
        _end(server)


def _experiment(client: MlflowClient, name: str | None) -> Experiment:
    """The named experiment, or that of the newest run."""
    known = [experiment for experiment in pages(client.search_experiments) if experiment.name != "Default"]
    if name is not None:
        found = next((experiment for experiment in known if experiment.name == name), None)
        if found is None:
            raise no_study("there is", name, known)
        return found
    newest = known and client.search_runs([experiment.experiment_id for experiment in known], max_results=1,
                                          order_by=["attributes.start_time DESC"])
    if not newest:
        raise InputError("no run is kept here yet; fit something first, or name the output folder")
    return next(each for each in known if each.experiment_id == newest[0].info.experiment_id)


def _end(server: subprocess.Popen) -> None:
    """End MLflow's command and the server that it has started."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        with contextlib.suppress(ProcessLookupError, subprocess.TimeoutExpired):
            os.killpg(server.pid, number)
            server.wait(LAST_SECONDS)


def _wait_for(server: subprocess.Popen[str], address: str) -> None:
    while True:
        if server.poll() is not None:
            said = server.stderr.read().strip()[-500:] if server.stderr else ""
            raise InputError(f"the dashboard's server ended with status {server.returncode}: {said}")
        try:
            with urllib.request.urlopen(f"{address}/health", timeout=5) as answer:
                if answer.status == 200:
                    return
        except OSError:
            time.sleep(0.2)
