"""Where runs are kept: made once before work starts and cleared of dead runs; the tags that say where a run is from."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import importlib.metadata
import os
import platform
import re
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from filelock import FileLock

from ..errors import InputError, did_you_mean
from ..runtime.parent import is_alive
from .addresses import database_path, reason, root, shown, store_uri
from .building import artifacts, build, check
from .client import connect

T = TypeVar("T")

PATIENCE = 60.0                       # seconds that a fit waits to start while its server is away,
FIRST_PATIENCE = 10.0                 # and that the first command waits, when an address may be mistaken
FIRST_RETRY, LAST_RETRY = 0.5, 5.0    # seconds between attempts, doubling
PAGE = 1000                           # runs per request
PARENT = "mlflow.parentRunId"         # the tag by which MLflow nests runs


def prepare_store(folder: str | Path, patience: float = FIRST_PATIENCE) -> str:
    """Make sure that runs can be kept, mark those that died while running, and return the store's URI.

    The store is `folder`/mlflow.db, an SQLite database in WAL mode, with the artifacts under `folder`/mlartifacts. If
    MLFLOW_TRACKING_URI is set, that http(s) server or absolute sqlite:// database is used and nothing is made under
    `folder`. Call it once, in the parent, before any worker starts; workers are processes of their own, not forks of
    this one, which would share its connection. Raises `InputError` if the folder cannot be written, the database
    cannot be used, or the server does not answer within `patience` seconds.
    """
    uri = store_uri(folder)
    database = database_path(uri)
    if database is None:
        _check_server(uri, patience)
    else:
        build(database, uri)
    mark_killed_runs(uri)
    return uri


def kept_runs(folder: str | Path) -> str:
    """The URI of the store of an output folder, whose runs are to be read. Raises `InputError` if none are kept there,
    or they cannot be read."""
    uri = store_uri(folder)
    database = database_path(uri)
    if database is None:
        _check_server(uri, FIRST_PATIENCE)
    elif not database.exists():
        raise InputError(f"no runs are kept in {database.parent}; fit something first, or name the output folder "
                         "of the fits")
    else:
        check(database, uri)
    return uri


def _check_server(uri: str, patience: float) -> None:
    client = connect(uri)
    from mlflow.exceptions import MlflowException

    try:
        patiently(uri, client.search_experiments, max_results=1, patience=patience)
    except MlflowException as error:
        raise InputError(f"{shown(uri)} refuses to keep runs ({reason(error)}); check that it is an MLflow server and "
                         f"that you may use it, or unset MLFLOW_TRACKING_URI") from None


def artifact_root(uri: str) -> str | None:
    """Where the artifacts of an SQLite store go, an absolute file:// URI; None where a server decides."""
    database = database_path(uri)
    return database and artifacts(database).as_uri()


def patiently(uri: str, call: Callable[..., T], *args: Any, patience: float = PATIENCE, **kwargs: Any) -> T:
    """The result of call(*args, **kwargs), tried again for `patience` seconds while the store does not answer.

    Raises `InputError` when it has not answered in that time; what the store refuses is raised at once.
    """
    from tenacity import RetryCallState, Retrying, retry_if_exception, stop_before_delay, wait_exponential

    def said(state: RetryCallState) -> str:
        return reason(root(state.outcome.exception()))  # pyright: ignore[reportOptionalMemberAccess, reportArgumentType]

    def tell(state: RetryCallState) -> None:
        if state.attempt_number == 1:
            print(f"tracking: waiting for {shown(uri)} ({said(state)})", file=sys.stderr)

    def give_up(state: RetryCallState) -> None:
        raise InputError(f"the store {shown(uri)} does not answer ({said(state)}); start it, or unset "
                         f"MLFLOW_TRACKING_URI to keep runs in the output folder")

    return Retrying(retry=retry_if_exception(_is_outage), stop=stop_before_delay(patience), before_sleep=tell,
                    wait=wait_exponential(FIRST_RETRY, LAST_RETRY), retry_error_callback=give_up)(call, *args, **kwargs)


def _is_outage(error: BaseException) -> bool:
    from mlflow.exceptions import MlflowException

    if isinstance(error, MlflowException):
        return error.get_http_status_code() >= 500 or error.get_http_status_code() == 429
    return isinstance(error, OSError)


def pages(search: Callable[..., Any], **query: Any) -> Iterator[Any]:
    """Everything that a paged search of the client finds."""
    token = None
    while True:
        page = search(**query, max_results=PAGE, page_token=token)
        yield from page
        token = page.token
        if not token:
            return


def no_study(there: str, name: str, known: Iterable[Any]) -> InputError:
    """The error that says which studies there are instead. known: experiments of MLflow."""
    names = sorted(each.name for each in known if each.name != "Default")
    return InputError(f"{there} no study {name!r}{did_you_mean(name, names) or ';'} it has "
                      f"{', '.join(names) or 'none'}")


def process_tags() -> dict[str, str]:
    """Tags that say which process writes a run, so that its death can be noticed."""
    import psutil

    return {"host": socket.gethostname(), "pid": str(os.getpid()), "process_start": str(psutil.Process().create_time())}


def is_written_elsewhere(tags: Mapping[str, str]) -> bool:
    """Whether the run with these tags is being written by another process of this host that is alive."""
    return (tags.get("host") == socket.gethostname() and tags.get("pid") != str(os.getpid())
            and is_alive(int(tags.get("pid", 0)), tags.get("process_start", "")))


def mark_killed_runs(uri: str) -> list[str]:
    """Set every run that is RUNNING by a process of this host that is gone to KILLED; the ids of those runs.

    Runs of other hosts are left alone. Should a live one be taken for dead (two containers of one host name), its
    status comes right when it ends.
    """
    client, host, killed = connect(uri), socket.gethostname(), []
    with changing_hands(uri):
        experiments = [experiment.experiment_id for experiment in pages(client.search_experiments)]
        running = list(pages(client.search_runs, experiment_ids=experiments,
                             filter_string=f"attributes.status = 'RUNNING' and tags.host = '{host}'"))
        for run in running:
            tags = run.data.tags
            if "process_start" in tags and not is_alive(int(tags["pid"]), tags["process_start"]):
                client.set_tag(run.info.run_id, "error", f"killed: process {tags['pid']} on {tags['host']} is gone and "
                                                         f"had not ended the run")
                client.set_terminated(run.info.run_id, status="KILLED")
                killed.append(run.info.run_id)
    return killed


@contextlib.contextmanager
def changing_hands(uri: str) -> Iterator[None]:
    """A lock among this host's processes: a run is not reopened by one while another takes it for dead."""
    user = os.getuid() if hasattr(os, "getuid") else ""
    digest = hashlib.sha256(uri.encode()).hexdigest()[:16]
    with FileLock(Path(tempfile.gettempdir()) / f"fractal-exp-{user}-{digest}.lock"):
        yield


def standard_tags(*, variant: str, method: str, target: str, scale: str, backend: str, device: str,
                  perceptual: str | None = None, **more: Any) -> dict[str, str]:
    """The tags that every fit carries: what the caller names, and device_name, version, git_commit (with -dirty).

    git_commit is present only if this package is run from its own checkout; `start_run` adds host and process.
    """
    tags = {"variant": variant, "method": method, "target": target, "scale": scale, "backend": backend,
            "device": device, "device_name": _device_name(device), "perceptual": perceptual or "none",
            "version": importlib.metadata.version("fractal-exp"), "git_commit": _git_commit(), **more}
    return {name: str(value) for name, value in tags.items() if value is not None}


def _device_name(device: str) -> str:
    if device.startswith("cuda"):
        import torch

        return torch.cuda.get_device_name(device)
    cpuinfo = Path("/proc/cpuinfo")
    model = re.search(r"^model name\s*:\s*(.+)$", cpuinfo.read_text() if cpuinfo.exists() else "", re.MULTILINE)
    return model[1] if model else platform.processor() or platform.machine()


@functools.cache  # the code that runs is the one that was imported
def _git_commit() -> str | None:
    git = ["git", "-C", str(Path(__file__).parent)]
    try:  # a package installed below somebody else's checkout must not carry that one's commit
        subprocess.run([*git, "ls-files", "--error-unmatch", "store.py"], check=True, capture_output=True)
        described = subprocess.run([*git, "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"],
                                   check=True, capture_output=True, text=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return described.stdout.strip()
