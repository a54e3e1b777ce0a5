"""What the tests of the commands begin with."""

import pytest


@pytest.fixture
def rendering_side() -> int:
    """Pixels of the rendering that a command writes of its result. At 1024 it takes a third of the time of a fit that
    takes moments."""
    return 128


@pytest.fixture(autouse=True)
def small_rendering(rendering_side, monkeypatch):
    monkeypatch.setattr("fractal_exp.inversion.writing.SIDE", rendering_side)
