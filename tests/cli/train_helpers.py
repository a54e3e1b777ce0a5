"""Tracked fits at sizes that take moments."""

from configured import composed

from fractal_exp.cli.train import fit

TINY = ["scale=smoke", "resolution=32", "iterations=6", "checkpoint_every=2", "anneal_every=3", "threads=1", "name=fit"]


def train(*overrides: str) -> dict[str, float]:
    return fit(composed(*TINY, *overrides))
