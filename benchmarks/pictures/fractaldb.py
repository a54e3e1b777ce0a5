"""The thousand codes of FractalDB-1k, to be found again from their pictures.

Kataoka et al., "Pre-training without Natural Images" (IJCV 2022). The codes are read from the folder of CSV files as
the set is distributed (csv_rate0.2_category1000), or from an .npz with `rows` (C,N,7), a b c d e f p each and NaN where
a code has fewer maps, and `name` (C,). --fractaldb or FRACTAL_EXP_FRACTALDB names either. A picture is called by its
category's number: odd ones are for reporting, even ones for tuning.
"""

from __future__ import annotations

import os
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from fractal_exp import suite
from fractal_exp.datasets import kernels
from fractal_exp.errors import InputError
from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.images.levels import TARGET_SUPERSAMPLE
from fractal_exp.images.reading import ReadImage
from fractal_exp.ops.histogram.pool import choice
from fractal_exp.rendering.still import points_per_view, render

from . import density_maps, judging

VARIABLE = "FRACTAL_EXP_FRACTALDB"  # the environment's name of the folder or the file
RESOLUTION = 256                    # of grey targets
SIZE, POINTS = 362, 100_000         # of the set's own pictures
READ_SIZE = 468                     # of such a picture as it is read: its dots are three quarters of the side


@cache
def load(path: Path) -> dict[str, IFS]:
    """The codes of a folder or a file by name, in the order of the names. Raises `InputError` unless there are any."""
    try:
        if path.is_dir():
            tables = {each.stem: np.loadtxt(each, delimiter=",", ndmin=2) for each in path.rglob("*.csv")}
        else:
            with np.load(path, allow_pickle=False) as file:
                tables = {str(name): rows[~np.isnan(rows[:, 0])]
                          for name, rows in zip(file["name"], file["rows"], strict=True)}
        codes = {name: IFS(rows[:, :4].reshape(-1, 2, 2), rows[:, 4:6], rows[:, 6] / rows[:, 6].sum())
                 for name, rows in sorted(tables.items())}
        if not codes:
            raise ValueError("no file ends in .csv")
        if wrong := [name for name in codes if not name.isdecimal()]:
            raise ValueError(f"{wrong[0]!r} is no number of a category")
    except (OSError, KeyError, IndexError, ValueError) as error:
        raise InputError(f"{path} holds no codes of FractalDB: {error}; take the folder csv_rate0.2_category1000, or "
                         "an .npz with rows (C,N,7) and name (C,)") from error
    return codes


def codes() -> dict[str, IFS]:
    """All codes by name, in their own coordinates. Raises `InputError` where no file is named."""
    if not os.environ.get(VARIABLE):
        raise InputError(f"the codes of FractalDB-1k are not here; name their folder or their .npz by --fractaldb or "
                         f"{VARIABLE}")
    return load(Path(os.environ[VARIABLE]))


def roles() -> dict[str, str]:
    """The role of each picture by name."""
    return {name: "reporting" if int(name) % 2 else "tuning" for name in codes()}


def grey(name: str) -> np.ndarray:
    """The density (256,256) in [0,1], as the grey targets of the suite show it."""
    return suite.target(codes()[name], RESOLUTION).numpy()


def grey_truth(name: str, read: ReadImage) -> IFS:
    """The code on the canvas of its grey picture."""
    return attractor.normalize(codes()[name])


def dots(name: str) -> np.ndarray:
    """The picture (362,362) uint8 as the set draws it: dots of 127 on black."""
    return _dotted(name)[0]


def dots_truth(name: str, read: ReadImage) -> IFS:
    """The code on the canvas of its picture of dots. x and y are stretched apart, as the set does."""
    _, low, high = _dotted(name)
    corners = _pixels(np.array([low, high]), low, high)
    return stretched(codes()[name], *_onto(np.array([low, high]), read.placement.to_canvas(corners)))


@cache
def _dotted(name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The picture of dots, and the extremes (2,) of its points."""
    code = codes()[name]
    maps = np.concatenate([code.linear.double().flatten(1), code.offset.double()], 1)
    image, points = np.zeros((SIZE, SIZE), np.uint8), np.empty((2, POINTS))
    kernels.draw(maps, *choice(code.sampling_probabilities().double().numpy()), np.uint64(int(name)), kernels.POINTS,
                 1.0, *points, image)
    return image, points.min(1), points.max(1)


def _pixels(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Where points (P,2) lie in the picture, in the pixels of a `Placement`."""
    inner = (points - low) / (high - low) * (SIZE - 2 * kernels.MARGIN) + kernels.MARGIN
    return inner * [1, -1] + [0, SIZE]


def _onto(points: np.ndarray, images: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Scale (2,) and shift (2,), by axes, that send two points (2,2) to their images."""
    scale = (images[1] - images[0]) / (points[1] - points[0])
    return scale, images[0] - scale * points[0]


def stretched(code: IFS, scale: np.ndarray, shift: np.ndarray) -> IFS:
    """The code whose attractor is scale · A + shift, with a scale (2,) for each axis."""
    linear = scale[:, None] * code.linear.double().numpy() / scale
    return replace(code, linear=linear, offset=scale * code.offset.double().numpy() + shift - linear @ shift)


def score(truth: IFS, code: IFS, read: ReadImage) -> dict[str, Any]:
    """How a code compares with the true one, both on the canvas of the picture.

    contraction: of the truth; largest: its largest singular value as it is drawn. f1_truth: F1 within a pixel of both
    drawings. density_sse: of the density as the density maps have it, over the canvas; floor_sse: of the truth against
    itself. f1_input, f1_input_truth: F1 within a pixel of either drawing and the picture.
    """
    image = read.image.numpy()
    size = len(image)
    likeness = judging.f1_within_a_pixel(judging.drawing(code, size), judging.drawing(truth, size))
    rng = np.random.default_rng(0)
    wide = [each.similar(density_maps.HALF_SIDE, (0.0, 0.0)) for each in (truth, truth, code)]
    given, again, found = (density_maps.density(density_maps.points(each, rng)) for each in wide)
    return {"contraction": truth.contraction.kind, "largest": float(truth.singular_values().max()),
            "true_maps": len(truth), "f1_truth": likeness, "density_sse": float(np.square(found - given).sum()),
            "floor_sse": float(np.square(again - given).sum()), **judging.likeness(code, image),
            "f1_input_truth": judging.likeness(truth, image)["f1_input"],
            **judging.against_code(code, truth, likeness, size)}


def grey_shown(code: IFS, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The picture (R,R), and a code drawn as it is."""
    size = len(image)
    return image, render(code, resolution=size, points_in_view=points_per_view(size),
                         supersample=TARGET_SUPERSAMPLE).numpy()


def dots_shown(code: IFS, image: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The picture (R,R), and as many dots of a code, of the same size."""
    points, _ = attractor.random_points(code, POINTS)
    counts, _, _ = np.histogram2d(-points[:, 1], points[:, 0], READ_SIZE, [[-1, 1], [-1, 1]])
    drawn = Image.fromarray((counts > 0).astype(np.float32)).resize(image.shape[::-1], Image.Resampling.BOX)
    return image / image.max(), np.asarray(drawn)
