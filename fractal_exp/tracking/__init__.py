"""Numbers, pictures and files of every fit, kept by MLflow; this folder is the only importer of mlflow.

`store` is the place where runs are kept, made before work starts; `run` is one fit being logged, behind four verbs:
log, image, artifact, table; `reading` gets it all back for reports and notebooks; `dashboard` shows it.
"""

from .base import Tracker
from .dashboard import dashboard_command
from .reading import (
    NoArtifact,
    comparison_address,
    find_run,
    nested_below,
    read_artifact,
    read_series,
    read_table,
    runs_frame,
    studies,
)
from .run import MlflowTracker, deliver, start_run
from .store import kept_runs, mark_killed_runs, prepare_store, standard_tags

__all__ = [
    "MlflowTracker", "NoArtifact", "Tracker", "comparison_address", "dashboard_command", "deliver",
    "find_run", "kept_runs", "mark_killed_runs", "nested_below", "prepare_store", "read_artifact", "read_series",
    "read_table", "runs_frame", "standard_tags", "start_run", "studies",
]
