"""`fractal-train task=pretrain`: train the network that a method needs, and write its weights."""

from __future__ import annotations

import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

from ..errors import InputError
from ..methods.base import check_device
from ..runtime import threads, weights
from ..runtime.checks import check_seconds
from ..training.codes import CodeTraining
from ..training.loop import Trained, train
from . import configuration
from .folders import FitFolder
from .progress import Reporter
from .runs import NoRuns


def pretrain(config: DictConfig) -> dict[str, float]:
    """Train the network of the method as configured and return its scores; the weights, safetensors with what they were
    trained on, lie in the run's folder and in its MLflow run.

    Raises `InputError` on anything a user can mend, before any work.
    """
    with ExitStack() as held:  # the lock of the run's folder
        return _pretrain(config, held)


def _pretrain(config: DictConfig, held: ExitStack) -> dict[str, float]:
    config = configuration.resolve(config)
    method = configuration.method_name(config.method)
    if not config.pretraining:
        raise InputError(f"task=pretrain: the method {method} has no network to train, or not at scale="
                         f"{config.scale}; choose method=neural_regression or another of the choices of pretraining")
    check_device(config.device)
    check_seconds(config.seconds)
    threads.use(config.threads)
    settings = configuration.plain(config)
    training: CodeTraining = configuration.build(config.pretraining)
    runs: NoRuns = configuration.build(config.tracking)
    identity = {"pretraining": settings["pretraining"], "device": config.device}
    name = training.method.name
    variant = "-as-released" if training.recipe().get("as_released") else ""
    folder = FitFolder.open(Path(config.output) / config.study,
                            config.name or f"{name}{variant}-{config.scale}-seed{config.seed}")
    held.enter_context(folder.alone())
    if config.resume and (scores := folder.finished_scores(identity)):
        weights.load(_path(training, folder), name)  # they may be gone, or damaged
        print(f"{folder.path} holds this training, finished; resume=false trains again")
        _tell(training, folder)
        return scores
    checkpoint = folder.checkpoint_of("training", config.checkpoint_every, identity, config.resume)
    print(f"{name}: training of its network, {config.scale} scale: {training.steps} steps at most on {config.device}")
    told = settings | {"method": settings["method"] | settings["pretraining"], "perceptual": "none"}
    # The CPU draws the pictures, wherever the network learns.
    with runs.start(folder, told, told, "random codes", backend="cpu") as run:
        folder.begin(OmegaConf.to_yaml(config))
        if not config.resume:  # an earlier training's weights would pass for this one's until it ends
            _path(training, folder).unlink(missing_ok=True)
        start = time.perf_counter()
        with Reporter(run, folder) as reporter:
            trained = train(training, device=config.device, seconds=config.seconds, on_step=reporter,
                            checkpoint=replace(checkpoint, first=run.secure))
        seconds = time.perf_counter() - start
        path = _keep(training, trained, folder, seconds)
        run.artifact(path.name, path)
        scores = {f"eval/{key}": value for key, value in trained.scores.items()} | {"time/fit_seconds": seconds}
        run.log(scores)
    folder.finish(identity, scores)
    print("  " + ", ".join(f"{key.replace('_', ' ')} {value:.4g}" for key, value in trained.scores.items())
          + f"; {trained.stopped}, in {seconds:.0f} s")
    _tell(training, folder)
    if where := runs.where(settings):
        print(f"  dashboard  {where}")
    return scores


def _keep(training: CodeTraining, trained: Trained, folder: FitFolder, seconds: float) -> Path:
    """The file of the weights, read again: what is not finite must not count as finished."""
    recipe = training.recipe() | {"stopped": trained.stopped, "seconds": round(seconds)}
    path = weights.save(_path(training, folder), training.method.name, trained.tensors, recipe, trained.scores)
    weights.load(path, training.method.name).fill(training.method.built(recipe))
    return path


def _path(training: CodeTraining, folder: FitFolder) -> Path:
    return folder.path / f"{training.method.name}.safetensors"


def _tell(training: CodeTraining, folder: FitFolder) -> None:
    print(f"  weights    {_path(training, folder)}")
