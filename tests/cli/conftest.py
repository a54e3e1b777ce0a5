"""What the tests of the commands begin with."""

import signal
from pathlib import Path

import numpy as np
import pytest
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig
from PIL import Image

from fractal_exp.cli import interruption


@pytest.fixture(scope="session")
def picture(tmp_path_factory) -> Path:
    """A black cross on white, 64² pixels."""
    path = tmp_path_factory.mktemp("picture") / "cross.png"
    image = np.full((64, 64), 255, np.uint8)
    image[10:54, 28:36] = image[28:36, 10:54] = 0
    Image.fromarray(image).save(path)
    return path


@pytest.fixture
def rendering_side() -> int:
    """Pixels of the rendering that a command writes of its result. At 1024 it takes a third of the time of a fit that
    takes moments."""
    return 128


@pytest.fixture(autouse=True)
def small_rendering(rendering_side, monkeypatch):
    monkeypatch.setattr("fractal_exp.inversion.writing.SIDE", rendering_side)


@pytest.fixture
def signals_are_heard():
    """As a command hears them; at the end they are pytest's again, and none counts as asked."""
    before = {each: signal.getsignal(each) for each in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    interruption.listen()
    yield
    interruption.listen()
    for each, handler in before.items():
        signal.signal(each, handler)


@pytest.fixture
def hydra_composed(monkeypatch):
    """A function that lets Hydra know a configuration as the one that its command composed."""
    def know(config: DictConfig) -> None:
        monkeypatch.setattr(HydraConfig.instance(), "cfg", config)
    return know
