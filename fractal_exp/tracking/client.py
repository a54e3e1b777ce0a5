"""How this package talks to MLflow."""

from __future__ import annotations

import logging
import os
from typing import TYPE_CHECKING

from ..runtime.extras import need

if TYPE_CHECKING:
    from mlflow import MlflowClient

# Read by MLflow when it is imported or called. Its own retries would hold one call for minutes: ours stand instead.
ENVIRONMENT = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_LOGGING_LEVEL": "WARNING",
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "0",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "30",
}


def configure() -> None:
    """Set MLflow's settings, before it is imported; those that the user has set stay."""
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    logging.getLogger("alembic").setLevel(logging.WARNING)
    logging.getLogger("mlflow.store.db.utils").setLevel(logging.CRITICAL)  # it prints what it raises, we report it


def connect(uri: str) -> MlflowClient:
    """A client of the store at `uri`. MLflow's global state stays untouched: one process can talk to several stores."""
    need("mlflow")
    configure()
    from mlflow import MlflowClient

    return MlflowClient(uri)
