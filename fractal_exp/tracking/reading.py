"""Looking at the runs that are kept: frames for tables and notebooks, and files."""

from __future__ import annotations

import io
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from ..errors import InputError
from ..runtime.extras import need
from ..runtime.files import check_file
from .addresses import database_path, shown
from .client import connect
from .store import PARENT, no_study, pages, patiently

if TYPE_CHECKING:
    import pandas as pd


def runs_frame(uri: str, experiment: str, where: str = "") -> pd.DataFrame:
    """One row a run: run_id, name, status, start_time, end_time (UTC), then params.…, metrics.… (last values), tags.….

    `where` is an MLflow search filter, e.g. "tags.variant = 'full'". The newest run comes first. Raises `InputError`
    on an experiment that the store does not have.
    """
    need("pandas")
    import pandas as pd

    client = connect(uri)
    found = client.get_experiment_by_name(experiment)
    if found is None:
        raise no_study(f"{shown(uri)} has", experiment, pages(client.search_experiments))
    rows = [
        {"run_id": run.info.run_id, "name": run.info.run_name, "status": run.info.status,
         "start_time": run.info.start_time, "end_time": run.info.end_time,
         **{f"{kind}.{name}": value for kind in ("params", "metrics", "tags")
            for name, value in getattr(run.data, kind).items()}}
        for run in pages(client.search_runs, experiment_ids=[found.experiment_id], filter_string=where)
    ]
    frame = pd.DataFrame(rows) if rows else pd.DataFrame(columns=["run_id", "name", "status", "start_time", "end_time"])
    for column in ("start_time", "end_time"):
        frame[column] = pd.to_datetime(frame[column], unit="ms", utc=True)
    return frame


def studies(uri: str) -> list[str]:
    """The names of all studies of a store, in order."""
    return sorted(each.name for each in pages(connect(uri).search_experiments) if each.name != "Default")


def find_run(uri: str, experiment: str, tags: Mapping[str, str]) -> str | None:
    """The newest run of a study that has all these tags, or None."""
    client = connect(uri)
    found = patiently(uri, client.get_experiment_by_name, experiment)
    if found is None:
        return None
    where = " and ".join(f"tags.`{name}` = '{value}'" for name, value in tags.items())
    runs = patiently(uri, client.search_runs, [found.experiment_id], filter_string=where, max_results=1)
    return runs[0].info.run_id if runs else None


def nested_below(run_id: str) -> str:
    """The filter of `runs_frame` for the runs nested below one."""
    return f"tags.`{PARENT}` = '{run_id}'"


def comparison_address(uri: str, experiment: str, parent_run_id: str) -> str:
    """Where the dashboard compares the runs below a parent: on the server, or on one that `dashboard_line` names."""
    found = connect(uri).get_experiment_by_name(experiment)
    if found is None:
        raise InputError(f"the store {shown(uri)} has no study {experiment!r}")
    server = "http://127.0.0.1:5000" if database_path(uri) else shown(uri).rstrip("/")
    query = quote(nested_below(parent_run_id))
    return (f"{server}/#/experiments/{found.experiment_id}/runs?workflowType=machine_learning&searchFilter={query}"
            "&compareRunsMode=CHART")


def read_series(uri: str, run_id: str, name: str) -> pd.DataFrame:
    """Every value of one metric: columns step, value, time (UTC), in order of step. Empty if never logged."""
    need("pandas")
    import pandas as pd

    history = connect(uri).get_metric_history(run_id, name)
    frame = pd.DataFrame([(m.step, m.value, m.timestamp) for m in history], columns=["step", "value", "time"])
    frame["time"] = pd.to_datetime(frame["time"], unit="ms", utc=True)
    return frame.sort_values(["step", "time"], ignore_index=True)


class NoArtifact(InputError):
    """A run has no artifact of the name that was asked for."""


def read_artifact(uri: str, run_id: str, name: str, most_bytes: int | None = None) -> bytes:
    """The content of one artifact of a run, of at most `most_bytes`.

    Raises `NoArtifact`, an `InputError`, if the run has none of that name, and `InputError` on one that is larger. The
    size is that of the store's list where it gives one, so that a large artifact is not even fetched.
    """
    client = connect(uri)
    parent = name.rpartition("/")[0] or None
    sizes = {artifact.path: artifact.file_size for artifact in client.list_artifacts(run_id, parent)
             if not artifact.is_dir}
    if name not in sizes:
        raise NoArtifact(f"run {run_id} has no artifact {name!r}; in that folder it has {list(sizes)}")
    if most_bytes is not None and (sizes[name] or 0) > most_bytes:
        raise InputError(f"cannot read the artifact {name!r} of run {run_id}: it has {sizes[name]} bytes, at most "
                         f"{most_bytes} are read")
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(client.download_artifacts(run_id, name, scratch))
        return check_file(path, f"the artifact {name!r} of run {run_id} in", most_bytes).read_bytes()


def read_table(uri: str, run_id: str, name: str) -> pd.DataFrame:
    """A frame that was logged by `table`. Raises `InputError` if the run has none of that name."""
    need("pandas")
    import pandas as pd

    return pd.read_json(io.BytesIO(read_artifact(uri, run_id, name)), orient="split", precise_float=True)
