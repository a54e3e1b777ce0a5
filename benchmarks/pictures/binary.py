"""The binary suite: the hundred fractals of the random suite at I > 0.25."""

from __future__ import annotations

from functools import cache

import numpy as np

from fractal_exp import suite
from fractal_exp.evaluation import evaluate
from fractal_exp.evaluation.code_error import code_error
from fractal_exp.evaluation.summary import without_empty
from fractal_exp.ifs.code import IFS
from fractal_exp.rendering.still import points_per_view, render

from .. import archive

RESOLUTION = 256


def names() -> list[str]:
    """"suite-000" to "suite-099"."""
    return [f"suite-{k:03d}" for k in range(suite.SUITE_COUNT)]


@cache
def truth(name: str) -> IFS:
    """The code that drew a picture of the set."""
    return archive.true_code(int(name.removeprefix("suite-")), suite.SUITE_SEED)


def picture(name: str) -> np.ndarray:
    """The picture (256,256) in [0,1], white on black, as it is framed."""
    return suite.target(truth(name), RESOLUTION, "binary").numpy()


def drawn(code: IFS) -> np.ndarray:
    """The picture (256,256) of a code that is in the frame already, drawn as `picture` draws the true ones."""
    image = render(code, resolution=RESOLUTION, points_in_view=points_per_view(RESOLUTION),
                   supersample=suite.TARGET_SUPERSAMPLE)
    return (image > suite.THRESHOLD).float().numpy()


def score(name: str, code: IFS) -> dict[str, float | bool]:
    """Mean F1 over the attractor's views in the frames of each code's own box and of the input, and whether the code
    is exact."""
    box, frame = (without_empty(evaluate(code, truth(name), align=align, resolution=RESOLUTION))["f1"].mean()
                  for align in ("bbox", "none"))
    return {"f1_box": float(box), "f1_frame": float(frame),
            "exact": bool(code_error(code, truth(name), align="none", resolution=RESOLUTION).exact)}
