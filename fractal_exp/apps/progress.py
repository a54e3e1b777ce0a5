"""What a fit tells while it works: a progress bar on the terminal, series and previews in the run."""

from __future__ import annotations

import sys
from typing import Self

from tqdm import tqdm

from ..images import write_image
from ..methods.base import Progress
from ..tracking import Tracker
from . import interruption
from .folders import FitFolder


class Reporter:
    """An `on_step` that draws a bar with stage, loss or score, temperature and time left, and logs every step."""

    def __init__(self, run: Tracker, folder: FitFolder):
        self.run, self.folder = run, folder

    def __enter__(self) -> Self:
        self.bar = tqdm(total=100, unit="%", file=sys.stdout, leave=True,
                        mininterval=0.5 if sys.stdout.isatty() else 10,
                        bar_format="  {l_bar}{bar}| {elapsed} < {remaining}{postfix}")
        return self

    def __exit__(self, *error: object) -> None:
        self.bar.close()

    def __call__(self, progress: Progress) -> None:
        interruption.check()
        self.bar.n = round(100 * progress.fraction, 2)
        stage = {"stage": progress.stage} if progress.stage else {}
        self.bar.set_postfix(stage | {name: f"{value:.3g}" for name, value in progress.scalars.items()
                                      if name in ("loss", "temperature", "score")}, refresh=False)
        self.bar.update(0)
        self.run.log({f"train/{name}": value for name, value in progress.scalars.items()}, progress.step)
        if progress.preview is not None:
            write_image(self.folder.views / "preview.png", progress.preview)
            self.run.image("preview", progress.preview, progress.step)
