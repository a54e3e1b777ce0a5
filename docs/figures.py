"""Draws docs/fits.png from what `make run` left: target, result and difference of both fits.

    python docs/figures.py outputs/fits
"""

import sys
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from fractal_exp.evaluation.pictures import comparison_strip
from fractal_exp.images import write_image

FITS = {"retina": "blood vessels, skimage.data.retina()", "fern": "Barnsley's fern"}


def read(folder: Path, name: str) -> torch.Tensor:
    """A grey picture of a fit, (R,R) in [0,1]."""
    return torch.from_numpy(np.asarray(Image.open(folder / "views" / f"{name}.png").convert("L")) / np.float32(255))


def main() -> None:
    fits = Path(sys.argv[1])
    folders = [next(fits.glob(f"{name}-*-laptop-*")) for name in FITS]
    images, truth = (torch.stack([read(folder, name) for folder in folders]) for name in ("result", "target"))
    write_image(Path(__file__).with_name("fits.png"), comparison_strip(images, truth, list(FITS.values())))


if __name__ == "__main__":
    main()
