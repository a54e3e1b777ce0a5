"""Where a fit is logged: an MLflow run of its study, or nowhere. The choices of the config group `tracking`."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from hydra.core.hydra_config import HydraConfig
from omegaconf import OmegaConf

from .. import tracking
from ..errors import InputError
from ..ops import backends
from ..tracking.addresses import dashboard_line, shown
from ..tracking.store import PARENT
from .configuration import PARENT as PARENT_RUN
from .configuration import VARIED, method_name, own_words, words_of_a_fit
from .folders import FitFolder

SWEEP, SEVERAL = "sweep", "several"  # the tag `kind` of a parent run
GENERAL = ("target", "target_image", "fingerprint", "resolution", "scale", "variant", "perceptual",
           "perceptual_weights", "seed", "colour", "device", "backend")  # settings that every method has
TOLD = (*VARIED, "ablation", "without", "seed", "method", "init", "picture", "target", "target.name", "target.path",
        "target.index", "output", "study", "name", "resume", "tracking", "threads", "checkpoint_every"
        )  # settings that the other words of a run's name tell, or that make no other fit


class NoRuns:
    """tracking=none: fits are logged nowhere. And what any place that they are logged to can do."""

    def start(self, folder: FitFolder, settings: Mapping[str, Any], identity: Mapping[str, Any], target: str,
              backend: str | None = None) -> tracking.Tracker:
        """Begin the run of the fit in `folder`, or go on with it if the fit itself is resumed.

        settings: the resolved configuration as plain data; identity: the part of it that shapes the fit, which becomes
        the run's parameters; target: the name of the target; backend: who draws, where the settings leave no choice
        (None: what their backend comes to on their device). Raises `InputError` if the store cannot be used.
        """
        return tracking.Tracker()

    def start_sweep(self, settings: Mapping[str, Any], folder: Path, words: Sequence[str] = ()) -> tracking.Tracker:
        """Begin the parent run of the sweep in `folder`, or go on with it if that sweep was begun before.

        settings: as far as it is common to all jobs; words: those of the command after the study. Raises `InputError`
        if the store cannot be used.
        """
        return tracking.Tracker()

    def start_several(self, settings: Mapping[str, Any], folder: Path, name: str, words: Sequence[str]
                      ) -> tracking.Tracker:
        """Begin the parent run of the fits of one command, or go on with it if the command resumes them.

        settings: as far as it is common to all fits; folder: its own; name: what is varied; words: those of the
        command. Raises `InputError` if the store cannot be used.
        """
        return tracking.Tracker()

    def fail(self, settings: Mapping[str, Any], folder: Path, error: BaseException) -> None:
        """Note that the job of a sweep in `folder` failed, even if it failed before it had a run."""

    def check_kept(self, folder: FitFolder, settings: Mapping[str, Any]) -> None:
        """Raise `InputError` if the finished fit in `folder` is a sweep's job whose run this store does not have."""

    def where(self, settings: Mapping[str, Any]) -> str | None:
        """How to look at the runs, in words."""
        return None


class MlflowRuns(NoRuns):
    """tracking=mlflow: the database in the output folder, or the server that MLFLOW_TRACKING_URI names."""

    def start(self, folder: FitFolder, settings: Mapping[str, Any], identity: Mapping[str, Any], target: str,
              backend: str | None = None) -> tracking.Tracker:
        uri = tracking.prepare_store(Path(settings["output"]))
        backend = backend or backends.choose(settings["backend"], torch.empty(0, device=settings["device"]))
        tags = tracking.standard_tags(
            variant=settings["variant"], method=method_name(settings["method"]), target=target,
            scale=settings["scale"], backend=backend, device=settings["device"], perceptual=settings["perceptual"])
        resumed = None
        if settings["sweep"]:
            tags |= _job_tags(settings["sweep"], folder.path)
            resumed = _job_run(uri, settings, folder.path)
        elif settings["resume"]:
            resumed = folder.run_to_resume(uri)
        sweep = settings["sweep"]
        run = tracking.start_run(uri, settings["study"], _run_name(settings, tags), folder=folder.path,
                                 params=_params(identity), tags=tags | {"folder": folder.path.name},
                                 resume_run_id=resumed, note=_note(settings, tags),
                                 parent_run_id=sweep["run"] if sweep else settings[PARENT_RUN])
        folder.remember_run(uri, run.run_id)
        run.artifact("config.yaml", OmegaConf.to_yaml(dict(settings)))
        return run

    def start_sweep(self, settings: Mapping[str, Any], folder: Path, words: Sequence[str] = ()) -> tracking.Tracker:
        uri = tracking.prepare_store(Path(settings["output"]))
        known = tracking.find_run(uri, settings["study"], {"kind": SWEEP, "sweep": folder.name})
        return tracking.start_run(uri, settings["study"], folder.name, folder=folder, resume_run_id=known,
                                  note=f"**{settings['sweep']['title']}**: the sweep of the runs below it, with its "
                                       f"table in report/{_command('fractal-sweep', settings['study'], *words)}",
                                  tags={"kind": SWEEP, "sweep": folder.name, "scale": settings["scale"],
                                        "device": settings["device"], "perceptual": settings["perceptual"],
                                        "views": settings["evaluation"]["views"]})

    def start_several(self, settings: Mapping[str, Any], folder: Path, name: str, words: Sequence[str]
                      ) -> tracking.Tracker:
        uri, tags = tracking.prepare_store(Path(settings["output"])), {"kind": SEVERAL, "several": folder.name}
        known = tracking.find_run(uri, settings["study"], tags) if settings["resume"] else None
        return tracking.start_run(uri, settings["study"], name, folder=folder, resume_run_id=known,
                                  note=f"The fits below, with their table in summary.json"
                                       f"{_command('fractal-train', '-m', *words)}",
                                  tags=tags | {name: settings[name] for name in ("scale", "device")})

    def fail(self, settings: Mapping[str, Any], folder: Path, error: BaseException) -> None:
        uri, sweep = tracking.prepare_store(Path(settings["output"])), settings["sweep"]
        # A run that the fit has begun carries the error already; gone on with, it is none the worse.
        run = tracking.start_run(uri, settings["study"], folder.name, folder=folder, tags=_job_tags(sweep, folder),
                                 resume_run_id=_job_run(uri, settings, folder), parent_run_id=sweep["run"])
        run.finish("FAILED", error)

    def check_kept(self, folder: FitFolder, settings: Mapping[str, Any]) -> None:
        if not settings["sweep"]:
            return
        uri = tracking.prepare_store(Path(settings["output"]))
        tracking.deliver(folder.path, uri)
        if _job_run(uri, settings, folder.path) is None:
            raise InputError(f"{folder.path} holds this fit, finished, but its run is not below this sweep's in the "
                             "store; use the store that it was tracked in, or delete that folder to fit it again")

    def where(self, settings: Mapping[str, Any]) -> str | None:
        if server := os.environ.get("MLFLOW_TRACKING_URI"):
            return shown(server)
        return dashboard_line(settings["output"])


def _job_tags(sweep: Mapping[str, Any], folder: Path) -> dict[str, str]:
    """What a report needs to know of a job."""
    return {"kind": "job", "sweep": sweep["folder"], "job": folder.name, "row": str(sweep["row"]),
            "sample": str(sweep["sample"])}


def _job_run(uri: str, settings: Mapping[str, Any], folder: Path) -> str | None:
    """The run that this job was given before. The store knows, whatever was killed before it could write a file."""
    return tracking.find_run(uri, settings["study"], {PARENT: settings["sweep"]["run"], "job": folder.name})


def _params(identity: Mapping[str, Any]) -> dict[str, Any]:
    """What is compared between runs: what shapes a fit by its method, once (the method repeats its parts).

    Settings of other methods, which the configuration holds too, are left out.
    """
    method = identity["method"]
    whole = {key: value for key, value in identity.items()
             if key in GENERAL or key in method or (key == "loss" and "objective" in method)}
    own = {key: value for key, value in method.items() if key not in whole and key != "objective"}
    return {**whole, "method": own}


def _run_name(settings: Mapping[str, Any], tags: Mapping[str, str]) -> str:
    """A few words, as lists have little room; the tags tell the rest."""
    if settings["sweep"]:
        return f"{tags['row']}, {tags['sample']}"
    if settings["name"]:
        return settings["name"]
    variant = [] if tags["variant"] == "full" else [tags["variant"]]
    seed = [f"seed {settings['seed']}"] if settings.get("seed") else []
    words = own_words().split() or (words_of_a_fit() if HydraConfig.initialized() else [])
    own = [word for word in words if word.split("=")[0].lstrip("+~") not in TOLD]
    return ", ".join([tags["target"], tags["method"], *variant, *seed, *own])


def _note(settings: Mapping[str, Any], tags: Mapping[str, str]) -> str:
    """The description of a run: what was fitted how, and the command."""
    what = f"**{tags['target']}** by {tags['method']} ({tags['variant']}, {tags['scale']} scale)"
    if sweep := settings["sweep"]:
        return f"{what}: row {tags['row']}, sample {tags['sample']} of the sweep {sweep['folder']}"
    if not HydraConfig.initialized():  # no command made it
        return what
    return what + _command("fractal-train", *words_of_a_fit())


def _command(*words: str) -> str:
    return f"\n\n    {shlex.join(words)}"
