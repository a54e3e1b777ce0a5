"""Where a fit is logged: an MLflow run of its study, or nowhere. The choices of the config group `tracking`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omegaconf import OmegaConf

from .. import tracking
from .folders import FitFolder


class Runs(ABC):
    """A place that fits are logged to."""

    @abstractmethod
    def start(self, folder: FitFolder, settings: Mapping[str, Any], target: str) -> tracking.Tracker:
        """Begin the run of the fit in `folder`, or go on with it if the fit itself is resumed.

        settings: the resolved configuration as plain data. Raises `InputError` if the store cannot be used.
        """

    def where(self, settings: Mapping[str, Any]) -> str | None:
        """How to look at the runs, in words."""
        return None


class NoRuns(Runs):
    """tracking=none."""

    def start(self, folder: FitFolder, settings: Mapping[str, Any], target: str) -> tracking.Tracker:
        return tracking.NoTracker()


class MlflowRuns(Runs):
    """tracking=mlflow: the database in the output folder, or the server that MLFLOW_TRACKING_URI names."""

    def start(self, folder: FitFolder, settings: Mapping[str, Any], target: str) -> tracking.Tracker:
        uri = tracking.prepare_store(Path(settings["output"]))
        tags = tracking.standard_tags(
            variant=settings["variant"], method=settings["method"]["_target_"].rsplit(".", 1)[-1].lower(),
            target=target, scale=settings["scale"], backend=settings["backend"], device=settings["device"],
            perceptual=settings["perceptual"])
        resumed = folder.run_to_resume(uri) if settings["resume"] else None
        run = tracking.start_run(uri, settings["study"], folder.path.name, folder=folder.path,
                                 params=_params(settings), tags=tags, resume_run_id=resumed)
        folder.remember_run(uri, run.run_id)
        run.artifact("config.yaml", OmegaConf.to_yaml(dict(settings)))
        return run

    def where(self, settings: Mapping[str, Any]) -> str | None:
        return "make dashboard" if Path(settings["output"]) == Path("outputs").absolute() else (
            f"python -m fractal_exp.tracking dashboard {settings['output']}")


def _params(settings: Mapping[str, Any]) -> dict[str, Any]:
    """What is compared between runs: everything that shapes a fit, once."""
    return {key: value for key, value in settings.items() if key not in ("resume", "tracking", "name", "method")} | {
        "method": {key: value for key, value in settings["method"].items()
                   if key not in ("model", "objective", "optimizer")}}
