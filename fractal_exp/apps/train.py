"""`fractal-train`: one fit from configuration to scores; with `-m`, one after another."""

from __future__ import annotations

import signal
import sys
import time
from pathlib import Path

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from .. import threads
from ..checkpoint import Checkpoint
from ..errors import InputError
from ..evaluation import Perceptual
from ..images import write_image
from ..methods.base import CodeReconstruction, FitDiverged, Method, Reconstruction
from ..targets import Target
from ..tracking import Tracker
from . import configuration
from .folders import FitFolder
from .judging import Judgement, judge
from .progress import Reporter
from .runs import Runs

NOT_PART_OF_A_FIT = ("output", "study", "name", "resume", "tracking", "threads", "checkpoint_every", "evaluation")


def fit(config: DictConfig) -> dict[str, float]:
    """Run one fit as configured and return its scores; everything it makes lies in its folder and its MLflow run.

    Raises `InputError` on anything a user can mend, before any work.
    """
    config = configuration.resolve(config)
    threads.use(config.threads)
    settings = OmegaConf.to_container(config)
    identity = {key: value for key, value in settings.items() if key not in NOT_PART_OF_A_FIT}
    source = configuration.build(config.target)
    folder = FitFolder.open(Path(config.output) / config.study, config.name or _name(config, source.label))
    if config.resume and (scores := folder.finished_scores(identity)):
        print(f"{folder.path} holds this fit, finished; resume=false fits it again")
        return scores
    method: Method = configuration.build(config.method)
    perceptual = Perceptual.load(config.perceptual, config.perceptual_weights)
    target = source.load(config.resolution)
    checkpoint = Checkpoint(folder.checkpoint, config.checkpoint_every, identity, config.resume)
    checkpoint.load()
    if aside := checkpoint.set_aside():
        print(f"an unfinished fit was there; its checkpoint is kept as {aside}")
    _announce(config, source.label, target)

    runs: Runs = configuration.build(config.tracking)
    with runs.start(folder, settings, source.label) as run:
        folder.begin()
        (folder.path / "config.yaml").write_text(OmegaConf.to_yaml(config))
        start = time.perf_counter()
        with Reporter(run, folder) as reporter:
            reconstruction = method.reconstruct(target.image, on_step=reporter, checkpoint=checkpoint)
        judgement = judge(reconstruction, target, settings["evaluation"], perceptual, time.perf_counter() - start)
        _keep(folder, run, reconstruction, judgement)
        folder.finish(identity, judgement.scores)
    print(f"  {judgement.describe()}")
    print(f"  code       {folder.path / 'code.json'}")
    print(f"  pictures   {folder.views}")
    if where := runs.where(settings):
        print(f"  dashboard  {where}")
    return judgement.scores


def _name(config: DictConfig, label: str) -> str:
    method = config.method._target_.rsplit(".", 1)[-1].lower()
    return f"{label}-{method}-{config.variant}-{config.scale}-seed{config.seed}"


def _announce(config: DictConfig, label: str, target: Target) -> None:
    print(f"{label}: {config.resolution}² pixels, {config.scale} scale; {'; '.join(target.notes)}")
    if config.perceptual == "none" and "perceptual" in config.loss.terms:
        print("  no perceptual term in this objective (perceptual=none); perceptual=lpips_squeeze adds one, "
              "with weights to be downloaded once")


def _keep(folder: FitFolder, run: Tracker, reconstruction: Reconstruction, judgement: Judgement) -> None:
    """Put code, pictures and scores into the folder and into the run."""
    if isinstance(reconstruction, CodeReconstruction):
        path = reconstruction.code.save(folder.path / "code.json")
        run.artifact("code.json", path)
    for name, image in judgement.pictures.items():
        write_image(folder.views / f"{name}.png", image)
        run.image(name, image)
    judgement.per_view.to_csv(folder.path / "per_view.csv", index=False)
    run.table("per_view.json", judgement.per_view)
    run.log(judgement.scores)


@hydra.main(version_base="1.3", config_path="pkg://fractal_exp.conf", config_name="train")
def _hydra_main(config: DictConfig) -> dict[str, float]:
    try:
        return fit(config)
    except (InputError, FitDiverged) as error:
        if HydraConfig.get().mode == RunMode.MULTIRUN:
            raise
        print(f"fractal-train: error: {error}", file=sys.stderr)
        raise SystemExit(2) from None
    except KeyboardInterrupt:
        print("\nfractal-train: interrupted; the same command with resume=true goes on", file=sys.stderr)
        raise SystemExit(130) from None


def main() -> None:
    """The command line: Hydra composes, `fit` works, errors are one line."""
    def terminate(*_: object) -> None:
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, terminate)
    configuration.register()
    _hydra_main()


if __name__ == "__main__":
    main()
