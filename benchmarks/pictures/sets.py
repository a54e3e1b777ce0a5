"""The sets behind one contract: names with roles, pictures, scores of a code, tables of fits."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.images.reading import ReadImage

from . import binary, density_maps, fractaldb, judging, paper, plots, tables, textbook, tone_curves, trees, windows
from .figures import Truth
from .paving import paving
from .seen import Seen
from .seen import score as score_seen
from .shapes import shapes

Scores = dict[str, Any]


@dataclass(frozen=True)
class PictureSet:
    """roles: the pictures by name, each "tuning" or "reporting"; picture: its pixels or its file, as `invert` takes
    them; score: of a code found on it, on the canvas of what was read; tables: of fits, by title; options: for
    `invert`, unless told otherwise; shown: what a sheet shows of a code and the image that it was found on, as two
    images in [0,1]; truth: the true code on the canvas of what was read, if there is one; seen: a picture with its
    shape alone, where that is known."""

    roles: Callable[[], Mapping[str, str]]
    picture: Callable[[str], np.ndarray | Path]
    score: Callable[[str, IFS, ReadImage], Scores]
    tables: Callable[[pd.DataFrame], dict[str, pd.DataFrame]]
    options: Mapping[str, Any] = field(default_factory=dict)
    shown: Callable[[IFS, np.ndarray], tuple[np.ndarray, np.ndarray]] = judging.shapes
    truth: Callable[[str, ReadImage], IFS | None] = lambda name, read: None
    seen: Callable[[str], Seen] | None = None


def _textbook(seed: int) -> PictureSet:
    """The textbook pictures of a seed."""
    return PictureSet(lambda: {name: each.role for name, each in textbook.pictures().items()},
                      lambda name: textbook.pictures()[name].source(seed), partial(_score_textbook, seed),
                      tables.textbook, truth=lambda name, read: _textbook_truth(seed, name, read).code)


def _textbook_truth(seed: int, name: str, read: ReadImage) -> Truth:
    return textbook.pictures()[name].draw(seed).truth_on(read.placement)


def _score_textbook(seed: int, name: str, code: IFS, read: ReadImage) -> Scores:
    picture, truth = textbook.pictures()[name], _textbook_truth(seed, name, read)
    return {"family": picture.family, "depth": picture.depth, "ink": picture.ink, "tool": picture.tool,
            "jpeg": picture.jpeg, "deepest": picture.deepest, **judging.likeness(code, read.image.numpy()),
            **judging.against_truth(code, truth, read.image.shape[-1])}


def _trees(chosen: Callable[[], Mapping[str, trees.Tree]]) -> PictureSet:
    return PictureSet(lambda: {name: each.role for name, each in chosen().items()},
                      lambda name: chosen()[name].source(name), trees.score, tables.trees,
                      truth=lambda name, read: trees.truth(name, read).code)


def _score_density(name: str, code: IFS, read: ReadImage) -> Scores:
    params, given = density_maps.problem(name)
    truth, rng = density_maps.true_code(params), np.random.default_rng(0)
    found = code.similar(density_maps.HALF_SIDE, (0.0, 0.0))
    framed = truth.similar(1 / density_maps.HALF_SIDE, (0.0, 0.0))
    likeness = judging.f1_within_a_pixel(*(judging.drawing(each, density_maps.BINS) for each in (code, framed)))
    true_points = density_maps.points(truth, rng)
    scores: Scores = {"published": name.startswith("published")}
    for prefix, each in (("", found), ("floor_", truth)):
        points = density_maps.points(each, rng)
        distances = judging.point_distances(points, true_points, density_maps.PIXEL, rng)
        error = float(np.square(density_maps.density(points) - given).sum())
        scores |= {prefix + key: value for key, value in {"sse": error, **distances}.items()}
    return scores | judging.against_code(code, framed, likeness, density_maps.BINS)


def _densities(code: IFS, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    points = density_maps.points(code.similar(density_maps.HALF_SIDE, (0.0, 0.0)), np.random.default_rng(0))
    return image / image.max(), density_maps.picture(density_maps.density(points))


def _score_shape(name: str, code: IFS, read: ReadImage) -> Scores:
    image = read.image.numpy()
    plain = paving(judging.shape_of(image), len(code))
    return {**judging.light_and_dark(code, image), **judging.likeness(code, image),
            "f1_paving": judging.likeness(plain, image)["f1_input"], "licence": shapes()[name].licence}


def _score_binary(name: str, code: IFS, read: ReadImage) -> Scores:
    return {**judging.likeness(code, read.image.numpy()), **binary.score(name, code)}


def _thresholded(code: IFS, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return image, binary.drawn(code)


def _seen(names: Callable[[], Mapping[str, Any]], picture: Callable[[str], Seen]) -> PictureSet:
    """Pictures whose shape alone is known, too: half of them for tuning."""
    return PictureSet(lambda: {name: ("tuning", "reporting")[k % 2] for k, name in enumerate(names())},
                      lambda name: picture(name).source,
                      lambda name, code, read: score_seen(name.partition("-")[0], picture(name), code, read),
                      tables.seen, truth=lambda name, read: picture(name).truth(read), seen=picture)


def _fractaldb(picture: Callable[[str], np.ndarray], truth: Callable[[str, ReadImage], IFS],
               shown: Callable[[IFS, np.ndarray], tuple[np.ndarray, np.ndarray]],
               options: Mapping[str, Any]) -> PictureSet:
    return PictureSet(fractaldb.roles, picture, lambda name, code, read: fractaldb.score(truth(name, read), code, read),
                      tables.fractaldb, options, shown, truth)


SETS: dict[str, PictureSet] = {
    "textbook": _textbook(0),
    "textbook_redrawn": _textbook(1),
    "density": PictureSet(lambda: {name: "reporting" if name.startswith("published") else "tuning"
                                   for name in density_maps.names()},
                          lambda name: density_maps.picture(density_maps.problem(name)[1]), _score_density,
                          tables.density, {"frame": "keep", "resolution": density_maps.BINS, "maps": density_maps.MAPS},
                          _densities),
    "shapes": PictureSet(lambda: {name: each.role for name, each in shapes().items()},
                         lambda name: shapes()[name].make(0), _score_shape, tables.shapes,
                         shown=judging.redrawn),
    "binary": PictureSet(lambda: {name: ("tuning", "reporting")[k % 2] for k, name in enumerate(binary.names())},
                         binary.picture, _score_binary, tables.binary, {"frame": "keep"}, _thresholded,
                         truth=lambda name, read: attractor.normalize(binary.truth(name))),
    "tone_curves": PictureSet(lambda: {name: role for name, (_, _, role) in tone_curves.problems().items()},
                              tone_curves.picture, lambda name, code, read: tone_curves.score(name, code),
                              tables.tone_curves, {"frame": "keep"}),
    "windows": PictureSet(lambda: {name: ("tuning", "reporting")[k % 2] for k, name in enumerate(windows.kinds())},
                          lambda name: windows.part(name).pixels, windows.score, tables.windows, truth=windows.truth),
    "paper": _seen(paper.names, paper.seen),
    "plots": _seen(plots.names, plots.seen),
    "trees": _trees(trees.trees),
    "random_trees": _trees(trees.random_trees),
    "fractaldb_grey": _fractaldb(fractaldb.grey, fractaldb.grey_truth, fractaldb.grey_shown, {"frame": "keep"}),
    "fractaldb_dots": _fractaldb(fractaldb.dots, fractaldb.dots_truth, fractaldb.dots_shown, {}),
}
