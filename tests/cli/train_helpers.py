"""Tracked fits at sizes that take moments."""

from hydra import compose, initialize_config_module

from fractal_exp.cli import configuration
from fractal_exp.cli.train import fit

TINY = ["scale=smoke", "resolution=32", "iterations=6", "checkpoint_every=2", "anneal_every=3", "threads=1", "name=fit"]


def train(*overrides: str) -> dict[str, float]:
    configuration.register()
    with initialize_config_module("fractal_exp.conf", version_base="1.3"):
        return fit(compose("train", [*TINY, *overrides]))
