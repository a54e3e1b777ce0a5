"""Tracked fits at sizes that take moments, and commands that do something else in a fit's place."""

from collections.abc import Callable
from pathlib import Path

from configured import composed
from omegaconf import OmegaConf

from fractal_exp import IFS
from fractal_exp.cameras.camera import Camera
from fractal_exp.cli.train import fit
from fractal_exp.methods.base import CodeReconstruction, Method

TINY = ["scale=smoke", "resolution=32", "iterations=6", "checkpoint_every=2", "anneal_every=3", "threads=1", "name=fit"]


def train(*overrides: str) -> dict[str, float]:
    return fit(composed(*TINY, *overrides))


def own_task(folder: Path, task: Callable) -> list[str]:
    """The words with which a command does this in place of a fit; its file is put into the folder."""
    (folder / "task").mkdir(exist_ok=True)
    (folder / "task" / "own.yaml").write_text(f"# @package _global_\ntask: {task.__module__}.{task.__qualname__}\n")
    return ["--config-dir", str(folder), "task=own"]


class Knowing(Method):
    """A method whose answer lies in a file. pen: the radius, canvas units, of the pen that it says drew the picture;
    None: it says nothing of the camera."""

    def __init__(self, file: str, pen: float | None = None):
        self.file, self.known = file, None if pen is None else Camera("coverage", pen=pen)

    def reconstruct(self, target, *, on_step=None, checkpoint=None) -> CodeReconstruction:
        return CodeReconstruction(IFS.load(self.file), camera=self.known)


def own_method(folder: Path, answer: IFS, pen: float | None = None) -> list[str]:
    """The words with which a fit is by a method that has this answer; its files are put into the folder."""
    (folder / "method").mkdir(exist_ok=True)
    file = answer.save(folder / "method" / "answer.json")
    options = {"_target_": f"{__name__}.Knowing", "file": str(file), "pen": pen}
    OmegaConf.save(OmegaConf.create(options), folder / "method" / "own.yaml")
    return [f"hydra.searchpath=[file://{folder}]", "method=own"]
