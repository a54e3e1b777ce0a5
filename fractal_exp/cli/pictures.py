"""What `fractal-evaluate` does with pictures: each is judged against a picture."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

import torch
from torch import Tensor
from torch.nn.functional import pad

from ..errors import InputError
from ..evaluation import Perceptual
from ..evaluation.pictures import compare_pictures
from ..evaluation.scoring import TRIVIAL
from ..images.pixels import write_image
from ..images.reading import read_grey
from ..rendering.sheets import comparison_strip
from ..runtime import threads
from ..runtime.extras import need
from ..runtime.files import make_folder, write_atomically
from ..studies.judging import f1_in_words
from .reading import POLARITIES

LARGEST = 50 * 10**6  # pixels of a picture, for the memory


def evaluate_pictures(options: argparse.Namespace) -> None:
    """Judge the pictures that the command line names against the picture that is their truth; write what came out."""
    need("kornia", "pandas")
    import pandas as pd

    threads.use()
    read_one = partial(read_grey, invert=POLARITIES[options.invert], most_pixels=LARGEST)
    truth, true_lit, notes = read_one(options.truth)
    told, read = [f"{options.truth}: {note}" for note in notes], {}
    for name in options.codes:
        picture, lit, notes = read_one(name)
        if picture.shape != truth.shape:
            raise InputError(f"pictures of one size are compared, and {name} has {_size(picture)}, {options.truth} "
                             f"{_size(truth)}; draw it anew (fractal-render --size {truth.shape[1]}x{truth.shape[0]}) "
                             "or scale one of them, which changes every score")
        read[name] = picture, lit
        told += [f"{name}: {note}" for note in notes]
    others = {name: (torch.full_like(truth, one.value), torch.full_like(true_lit, one.value > 0))
              for name, one in TRIVIAL.items()}
    distance = Perceptual.load(options.perceptual, options.perceptual_weights)
    scores = {name: compare_pictures(picture, truth, lit, true_lit, distance)
              for name, (picture, lit) in {**read, **others}.items()}
    table = pd.DataFrame.from_dict(scores, orient="index").dropna(axis="columns", how="all").rename_axis("picture")
    folder = make_folder(options.out)
    strips = make_folder(folder / "strips")
    for number, (name, (picture, _)) in enumerate(read.items(), 1):
        caption = f"{Path(name).name}, {f1_in_words(scores[name]['f1'])}"
        write_image(strips / f"{number}-{Path(name).stem}.png",
                    comparison_strip(_squared(picture), _squared(truth), [caption]))
    report = "\n".join([
        f"pictures against {options.truth}, {_size(truth)}: all pixels, colours by their luminance",
        table.rename_axis(None).to_string(float_format="{:.3f}".format),
        f"no perceptual distance: {distance.absent}" if distance.absent else f"perceptual distance: {distance.name}",
        *told])
    write_atomically(folder / "pictures.csv", table.to_csv())
    write_atomically(folder / "report.txt", report + "\n")
    print(f"{report}\n\n{folder}")


def _size(picture: Tensor) -> str:
    return f"{picture.shape[1]}×{picture.shape[0]} px"


def _squared(picture: Tensor) -> Tensor:
    """A picture (H,W) in the upper left of a square (1,R,R), as sheets have them."""
    height, width = picture.shape
    return pad(picture, (0, max(height - width, 0), 0, max(width - height, 0)))[None]
