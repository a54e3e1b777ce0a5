"""What the tests of methods with a trained network share: networks of a few numbers, and their files."""

from dataclasses import replace

import pytest
from configured import composed
from hydra.utils import get_method

from fractal_exp.runtime import weights
from fractal_exp.runtime.checkpoint import Checkpoint
from fractal_exp.training.amortized import AmortizedTraining
from fractal_exp.training.loop import train
from fractal_exp.training.neural_regression import RegressionTraining
from fractal_exp.training.super_resolution import SuperResolutionTraining

REGRESSION = {"side": 16, "channels": [2, 4, 4], "hidden": 8, "codes": 12, "batch": 4, "epochs": 3, "held_out": 6}
SUPER = {"width": 32, "groups": 1, "layers": 2, "heads": 2, "window": 4, "features": 2, "side": 32, "patch": 8,
         "supersample": 2, "codes": 4, "batch": 2, "steps": 9, "every": 3, "held_out": 4}
SET = {"side": 16, "channels": [4, 8], "heads": 2, "hidden": 8, "codes": 12, "batch": 4, "epochs": 3, "held_out": 6}
TRAININGS = {"amortized": lambda **options: AmortizedTraining(**(SET | options)),
             "neural_regression": lambda **options: RegressionTraining(**(REGRESSION | options)),
             "super_resolution": lambda **options: SuperResolutionTraining(**(SUPER | options))}
each_training = pytest.mark.parametrize("name", TRAININGS)


class Stop(Exception):
    pass


def stopped_after(step: int):
    def on_step(progress):
        if progress.step == step:
            raise Stop
    return on_step


def resumed(training, path, *stops: int, every: int = 2):
    """What comes of a training that is interrupted after these steps."""
    checkpoint = Checkpoint(path, every, {})
    for number, stop in enumerate(stops):
        with pytest.raises(Stop):
            train(training(), on_step=stopped_after(stop), checkpoint=replace(checkpoint, resume=number > 0))
    steps = []
    trained = train(training(), on_step=lambda progress: steps.append(progress.step),
                    checkpoint=replace(checkpoint, resume=True))
    return trained, steps


def saved(path, name: str, **options):
    """The file of a network with its first weights."""
    training = TRAININGS[name](**options)
    return weights.save(path, name, training.network().state_dict(), training.recipe(), {"held_out": 1.0})


def run(*words: str) -> dict[str, float]:
    """What `fractal-train` does."""
    config = composed(*words)
    return get_method(config.task)(config)
