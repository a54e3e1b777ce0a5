"""What `fractal-perceptual` does: train the network of the perceptual distance `fractal` and write its weight file."""

from __future__ import annotations

import json
import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from omegaconf import DictConfig, OmegaConf

from ..methods.base import check_device
from ..perceptual import fractal_features
from ..perceptual_training.training import Recipe, train
from ..runtime import threads
from ..runtime.checkpoint import Checkpoint
from . import configuration
from .folders import FitFolder
from .progress import Reporter
from .runs import Runs


def train_distance(config: DictConfig) -> Path:
    """Train as configured and return the weight file, which lies in the run's folder and in its MLflow run.

    Raises `InputError` on anything a user can mend, before any work.
    """
    with ExitStack() as held:  # the lock of the run's folder
        return _train_distance(config, held)


def _train_distance(config: DictConfig, held: ExitStack) -> Path:
    config = configuration.resolve(config)
    check_device(config.device)
    threads.use(config.threads)
    settings = configuration.plain(config)
    recipe: Recipe = configuration.build(config.recipe)
    runs: Runs = configuration.build(config.tracking)
    identity = {"method": settings["recipe"], "device": config.device}
    folder = FitFolder.open(Path(config.output) / config.study,
                            config.name or f"fractal-{config.scale}-seed{recipe.seed}")
    held.enter_context(folder.alone())
    if config.resume and folder.finished_scores(identity):
        print(f"{folder.path} holds this training, finished; resume=false trains again")
        return _file(folder)
    checkpoint = Checkpoint(folder.checkpoint, config.checkpoint_every, identity, config.resume)
    checkpoint.load()
    if aside := checkpoint.set_aside():
        print(f"an unfinished training was there; its checkpoint is kept as {aside}")
    print(f"the perceptual distance 'fractal', {config.scale} training: {recipe.steps} steps and {recipe.calibration} "
          f"of calibration on {config.device}")
    # What a tracker asks of every run; there is neither a target nor a distance here.
    told = settings | {"method": settings["recipe"], "variant": config.scale, "perceptual": "none", "sweep": None}
    # The CPU draws the pictures, wherever the network learns.
    with runs.start(folder, told, identity, "codes near by", backend="cpu") as run:
        folder.begin(OmegaConf.to_yaml(config))
        if not config.resume:  # an earlier training's weights would pass for this one's until it ends
            _path(folder).unlink(missing_ok=True)
        start = time.perf_counter()
        with Reporter(run, folder) as reporter:
            trained = train(recipe, device=config.device, on_step=reporter,
                            checkpoint=replace(checkpoint, first=run.secure))
        seconds = time.perf_counter() - start
        path = fractal_features.save(_path(folder), trained.layers, trained.channel_weights,
                                     trained.recipe | {"device": config.device, "validation": trained.scores})
        fractal_features.load(path)  # what is not finite must not count as finished
        run.artifact(path.name, path)
        scores = {f"eval/{name}": value for name, value in trained.scores.items()} | {"time/fit_seconds": seconds}
        run.log(scores)
    folder.finish(identity, scores)
    print(f"  {json.dumps({name: round(value, 3) for name, value in trained.scores.items()})} in {seconds:.0f} s")
    if where := runs.where(told):
        print(f"  dashboard  {where}")
    return _file(folder)


def _path(folder: FitFolder) -> Path:
    return folder.path / "fractal_features.safetensors"


def _file(folder: FitFolder) -> Path:
    path = _path(folder)
    fractal_features.load(path)
    print(f"  weights    {path}")
    return path
