"""Makes the pictures of the paper's studies, from the fits that `benchmarks.comparisons` keeps.

    python -m docs.paper_figures closer       docs/images/comparisons.png: all methods, whole and 64 times closer
    python -m docs.paper_figures course       docs/images/comparisons_course.png: quality over time of all methods
    python -m docs.paper_figures ablations    docs/images/ablations.png: the rows of the ablation table
    python -m docs.paper_figures sierpinski   docs/images/sierpinski.png: the triangle with 3 and with 10 maps
    python -m docs.paper_figures real         docs/images/real.png: real pictures, and what was found in them
    python -m docs.paper_figures convergence  docs/images/convergence.png: F1 over the iterations
"""

from __future__ import annotations

import io
import json
import sys
from typing import Any

import numpy as np
import pandas as pd
from PIL import Image, ImageDraw

from fractal_exp import IFS, View, codes, suite
from fractal_exp.ifs import attractor
from fractal_exp.images import read_target, samples
from fractal_exp.methods.super_resolution.enlarged import Enlarged
from fractal_exp.methods.super_resolution.method import SuperResolution
from fractal_exp.rendering.still import render_with_info
from fractal_exp.rendering.zoom import rich_point
from fractal_exp.studies.report_figure import Pair, drawn

from .figures import IMAGES, RESULTS, picture_of, save, seen

CLOSER = 64                  # times, as in the paper's figure
INSTANCES = 0, 3, 4, 5       # of the suite; 64 times closer, 1 and 2 are even mists
SIDE = 96                    # pixels of a picture
THREE_STRIPS = 623           # pixels: the names of the rows, and three fractals
GREYS = 8                    # levels of a picture's palette
MARK = 190                   # grey level of the triangle on views with fewer points
SCOUTED = 600                # iterations of the starts, of sweeps/sizes/ablations/laptop.yaml
SIERPINSKI_CLOSER, REAL_CLOSER = 8, 16
# Rows of the strips, in the order of the paper's table.
TITLES = {"learning_fractals_32": "Learning Fractals, 32 px", "learning_fractals_256": "Learning Fractals, 256 px",
          "evolutionary": "evolutionary", "cuckoo": "cuckoo search", "neural_regression": "neural regression",
          "amortized": "amortized", "super_resolution": "super-resolution", "chaotic": "the paper's method",
          "collage": "collage search"}


def fits(folder: str) -> list[dict[str, Any]]:
    """The fits of a folder of results."""
    return [json.loads(line) for line in (RESULTS / folder / "fits.jsonl").read_text().splitlines()]


def code_of(fit: dict[str, Any]) -> IFS:
    """The code of a fit."""
    return IFS.from_json(fit["code"])


def closer() -> None:
    """A row for each method, and the truth last: whole, and the same view 64 times closer. Codes are aligned by their
    boxes, as for the scores. A view that does not hold the full number of points has a triangle."""
    kept = {(fit["row"], fit["sample"]): fit for fit in fits("comparisons_six_laptop")}
    truths = {f"fractal {k}": attractor.normalize(suite.random_suite(k + 1)[k]) for k in INSTANCES}
    views = {sample: View(rich_point(truth, end_zoom=CLOSER), CLOSER) for sample, truth in truths.items()}
    rows = []
    for method, title in TITLES.items():
        pairs = []
        for sample, truth in truths.items():
            fit = kept[method, sample]
            shown = (enlarged(SuperResolution().reconstruct(suite.target(truth, 256)), views[sample])
                     if fit["code"] is None else
                     pair(attractor.normalize(code_of(fit)), views[sample]))
            pairs.append(Pair(shown, ""))
        rows.append((title, pairs))
    rows.append(("truth", [Pair(pair(truth, views[sample]), "") for sample, truth in truths.items()]))
    save(IMAGES / "comparisons.png", drawn(f"Whole, and {CLOSER} times closer", list(truths), rows, SIDE), GREYS)


def course() -> None:
    """The figure that `benchmarks.comparisons` keeps."""
    kept = Image.open(RESULTS / "comparisons_six_laptop" / "course.png")
    save(IMAGES / "comparisons_course.png", np.asarray(kept.convert("RGB")), 64)


def ablations() -> None:
    """The first three of the six fractals on the strips that `benchmarks.comparisons --study ablations` keeps."""
    strips = np.asarray(Image.open(RESULTS / "ablations_laptop" / "strips.png").convert("L"))
    save(IMAGES / "ablations.png", strips[:, :THREE_STRIPS], GREYS)


def sierpinski() -> None:
    """The truth, and the best of all seeds with 3 and with 10 maps: whole and closer."""
    truth = attractor.normalize(codes.known("sierpinski_triangle"))
    columns = {"the true triangle": truth}
    for count in (3, 10):
        best = max((fit for fit in fits("function_count_laptop") if fit["row"] == f"{count} maps"),
                   key=lambda fit: fit["scores"]["f1"])
        columns[f"{count} maps, {best['sample']}, F1 {best['scores']['f1']:.3f}"] = attractor.normalize(code_of(best))
    view = View(rich_point(truth, end_zoom=SIERPINSKI_CLOSER), SIERPINSKI_CLOSER)
    pairs = [Pair(pair(code, view, 160), "") for code in columns.values()]
    save(IMAGES / "sierpinski.png", drawn(f"Whole, and {SIERPINSKI_CLOSER} times closer", list(columns), [("", pairs)],
                                          160), GREYS)


def real() -> None:
    """A row for the input and for each method: each code whole, and closer at a place of its own."""
    from benchmarks.pictures.shapes import shapes

    inputs = {"retina": samples.retina_vessels(256), "snowflake": samples.snowflake(256),
              "dahlia": read_target(shapes()["flower"].make(0), 256).image}
    kept = {(fit["row"], fit["sample"], is_20): fit for is_20, study in enumerate(("real", "real_20"))
            for folder in (f"{study}_laptop", f"{study}_dahlia_laptop") for fit in fits(folder)}
    rows = [("input", [Pair((Image.fromarray((255 * image).byte().numpy()), None), "") for image in inputs.values()])]
    for title, method, is_20 in (
            ("the paper's method, 20 maps", "chaotic", 0), ("collage search, 20 maps", "collage", 1),
            ("collage search, its own number", "collage", 0)):
        pairs = []
        for name in inputs:
            fit = kept[method, name, is_20]
            code = code_of(fit)
            closest = View(rich_point(code, end_zoom=REAL_CLOSER), REAL_CLOSER)
            pairs.append(Pair(tuple(seen(code, view, 256) for view in (View(), closest)),
                              f"{len(code)} maps, F1 {fit['scores']['f1']:.3f}"))
        rows.append((title, pairs))
    save(IMAGES / "real.png", drawn(f"Whole, and {REAL_CLOSER} times closer", list(inputs), rows, 128), GREYS)


def convergence() -> None:
    """F1 of the best code so far over the iterations: each fractal, and their mean."""
    from matplotlib.figure import Figure

    lines = pd.DataFrame([(fit["row"], fit["sample"], step, f1) for fit in fits("convergence_laptop")
                          for _, f1, step in fit["course"][:-1]], columns=["row", "sample", "step", "f1"])
    figure = Figure(figsize=(7, 3.6), layout="constrained")
    axes = figure.subplots()
    axes.axvspan(0, SCOUTED, color="0.93")
    axes.text(SCOUTED / 2, .43, "six starts, followed in turn", ha="center", color="0.4", fontsize="small")
    for number, (row, part) in enumerate(lines.groupby("row", sort=False)):
        table = part.pivot(index="step", columns="sample", values="f1")
        axes.plot(table.index, table, color=f"C{number}", linewidth=.6, alpha=.6)
        axes.plot(table.index, table.mean(axis=1), color=f"C{number}", linewidth=2.2, label=row)
    axes.set(xlabel="iterations", ylabel="F1 of the whole view", ylim=(.4, 1), xlim=(0, lines["step"].max()))
    axes.grid(alpha=.3)
    axes.legend(loc="lower right", fontsize="small")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    save(IMAGES / "convergence.png", np.asarray(Image.open(buffer).convert("RGB")), 96)


def pair(code: IFS, view: View, side: int = SIDE) -> tuple[Image.Image, ...]:
    """A code whole and in a view, marked where it does not hold the full number of points."""
    pictures = []
    for each in (View(), view):
        image, info = render_with_info(code, each, resolution=2 * side)
        pictures.append(picture_of(image) if info.reason is None else _marked(picture_of(image)))
    return tuple(pictures)


def _marked(picture: Image.Image) -> Image.Image:
    marked, size = picture.copy(), picture.width // 8
    ImageDraw.Draw(marked).polygon([(4, 4 + size), (4 + size, 4 + size), (4 + size // 2, 4)], MARK)
    return marked


def enlarged(found: Enlarged, view: View) -> tuple[Image.Image, ...]:
    """A target as super-resolution enlarged it, whole and in a view. Closer than it can show, pixels stay pixels."""
    part = round(view.zoom / found.largest_zoom)
    near = found.render(View(view.center, found.largest_zoom), resolution=part * 2 * SIDE)
    first = (part - 1) * SIDE
    return (picture_of(found.render(View(), resolution=2 * SIDE)),
            picture_of(near[first:first + 2 * SIDE, first:first + 2 * SIDE]))


if __name__ == "__main__":
    parts = {"closer": closer, "course": course, "ablations": ablations, "sierpinski": sierpinski, "real": real,
             "convergence": convergence}
    if len(sys.argv) != 2 or sys.argv[1] not in parts:
        sys.exit(__doc__)
    parts[sys.argv[1]]()
