"""Draws the pictures of the documentation.

    python docs/figures.py fits outputs/fits     docs/fits.png, from what `make run` left
    python docs/figures.py collage               docs/collage.png: a target, and the code after each stage of the search
"""

import sys
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from fractal_exp import View, render, suite
from fractal_exp.ifs import attractor
from fractal_exp.images import write_image
from fractal_exp.methods.collage.method import Collage
from fractal_exp.rendering.sheets import comparison_strip

HERE = Path(__file__).parent
FITS = {"retina": "blood vessels, skimage.data.retina()", "fern": "Barnsley's fern"}
STAGES = {"search": "after the search at 64 x 64", "detail": "after the search at 128 x 128",
          "picture": "after the picture"}
SUITE_SEED, FRACTAL = 101, 7


def read(folder: Path, name: str) -> torch.Tensor:
    """A grey picture of a fit, (R,R) in [0,1]."""
    return torch.from_numpy(np.asarray(Image.open(folder / "views" / f"{name}.png").convert("L")) / np.float32(255))


def fits(folder: Path) -> None:
    """Target, result and difference of both fits of `make run`."""
    folders = [next(folder.glob(f"{name}-collage-*-laptop-*")) for name in FITS]
    images, truth = (torch.stack([read(each, name) for each in folders]) for name in ("result", "target"))
    write_image(HERE / "fits.png", comparison_strip(images, truth, list(FITS.values())))


def collage() -> None:
    """The codes of one search, whole and four times closer, beside the truth."""
    truth = attractor.normalize(suite.random_suite(FRACTAL + 1, SUITE_SEED)[FRACTAL])
    found = {}

    def keep(progress) -> None:  # noqa: ANN001
        if progress.code is not None:
            found[progress.stage] = progress.code

    Collage().reconstruct(suite.target(truth, 256), on_step=keep)
    images, targets, captions = [], [], []
    for view, closer in ((View(), ""), (View(center=(-0.2, -0.15), zoom=4.0), ", four times closer")):
        for stage, caption in STAGES.items():
            images.append(render(found[stage], view, resolution=512, seed=1))
            targets.append(render(truth, view, resolution=512))
            captions.append(caption + closer)
    write_image(HERE / "collage.png", comparison_strip(torch.stack(images), torch.stack(targets), captions, side=220))


if __name__ == "__main__":
    {"fits": lambda: fits(Path(sys.argv[2])), "collage": collage}[sys.argv[1]]()
