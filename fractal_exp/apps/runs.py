"""Where a fit is logged: an MLflow run of its study, or nowhere. The choices of the config group `tracking`."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from omegaconf import OmegaConf

from .. import tracking
from ..ops import backends
from .configuration import method_name
from .folders import FitFolder


class Runs(ABC):
    """A place that fits are logged to."""

    @abstractmethod
    def start(self, folder: FitFolder, settings: Mapping[str, Any], identity: Mapping[str, Any], target: str
              ) -> tracking.Tracker:
        """Begin the run of the fit in `folder`, or go on with it if the fit itself is resumed.

        settings: the resolved configuration as plain data; identity: the part of it that shapes the fit, which becomes
        the run's parameters; target: the name of the target. Raises `InputError` if the store cannot be used.
        """

    def where(self, settings: Mapping[str, Any]) -> str | None:
        """How to look at the runs, in words."""
        return None


class NoRuns(Runs):
    """tracking=none."""

    def start(self, folder: FitFolder, settings: Mapping[str, Any], identity: Mapping[str, Any], target: str
              ) -> tracking.Tracker:
        return tracking.NoTracker()


class MlflowRuns(Runs):
    """tracking=mlflow: the database in the output folder, or the server that MLFLOW_TRACKING_URI names."""

    def start(self, folder: FitFolder, settings: Mapping[str, Any], identity: Mapping[str, Any], target: str
              ) -> tracking.Tracker:
        uri = tracking.prepare_store(Path(settings["output"]))
        backend = backends.choose(settings["backend"], torch.empty(0, device=settings["device"]))
        tags = tracking.standard_tags(
            variant=settings["variant"], method=method_name(settings["method"]), target=target,
            scale=settings["scale"], backend=backend, device=settings["device"], perceptual=settings["perceptual"])
        resumed = folder.run_to_resume(uri) if settings["resume"] else None
        run = tracking.start_run(uri, settings["study"], folder.path.name, folder=folder.path,
                                 params=_params(identity), tags=tags, resume_run_id=resumed)
        folder.remember_run(uri, run.run_id)
        run.artifact("config.yaml", OmegaConf.to_yaml(dict(settings)))
        return run

    def where(self, settings: Mapping[str, Any]) -> str | None:
        if server := os.environ.get("MLFLOW_TRACKING_URI"):
            return server
        return "make dashboard" if Path(settings["output"]) == Path("outputs").absolute() else (
            f"python -m fractal_exp.tracking dashboard {settings['output']}")


def _params(identity: Mapping[str, Any]) -> dict[str, Any]:
    """What is compared between runs: everything that shapes a fit, once (the method repeats its parts)."""
    method = {key: value for key, value in identity["method"].items() if key not in identity and key != "objective"}
    return {**identity, "method": method}
