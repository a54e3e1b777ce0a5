"""The figure of a sweep and its words: nothing runs into anything else, and nothing is said twice."""

from functools import partial

import numpy as np
import pytest
from PIL import Image
from studies_helpers import keep_sweep

from fractal_exp import tracking
from fractal_exp.studies import report
from fractal_exp.studies.report_figure import Pair, drawn, figure

SIDE = 96
LONG = "no_multisampling_and_no_annealing, sigma 2.5, with a perceptual distance of its own and 20 maps"
NAMES = {
    "short": (["fractal 0", "fractal 1"], ["full", "naive"]),
    "long": (["a-picture-with-a-very-long-file-name-2026-11-23", "fractal 1 of another suite"], [LONG, "x" * 80]),
}


@pytest.mark.parametrize("names", NAMES)
def test_no_text_runs_into_a_picture_or_off_the_sheet(names):
    samples, rows = NAMES[names]
    levels = iter(range(60, 200))
    pairs = [(row, [Pair(tuple(Image.new("L", (8, 8), next(levels)) for _ in range(2)), "F1 0.123" * 9)
                    for _ in samples]) for row in ("target", *rows)]
    sheet = drawn("Ablations, laptop scale " * 20, samples, pairs, SIDE)
    found = [corner(sheet, level) for level in range(60, next(levels))]
    assert len(set(found)) == len(found) == 3 * 4
    edges = np.concatenate([sheet[0], sheet[-1], sheet[:, 0], sheet[:, -1]])
    assert len(np.unique(edges)) == 1


def keep_pictures(jobs, run, number, row):
    with run:
        run.log({"eval/f1": .5})
        job = f"{number},{row}"
        for place, picture in enumerate(("target", "zoomed_target", "result", "zoomed")):
            if (job, picture) != ("0,naive", "zoomed"):  # lost
                run.image(picture, np.full((8, 8), (100 + 10 * jobs.index(job) + place) / 255, np.float32))


@pytest.fixture(scope="module")
def uri(tmp_path_factory):
    """A store with two sweeps, of one sample and of two, whose pictures have a grey of their own each."""
    folder = tmp_path_factory.mktemp("store")
    uri = tracking.prepare_store(folder)
    for name, count in (("one", 1), ("two", 2)):
        jobs = [f"{i},{row}" for i in range(count) for row in ("full", "naive")]
        keep_sweep(uri, folder, name, jobs, partial(keep_pictures, jobs))
    return uri


def corner(sheet, level):
    """The upper left corner of the one square of this grey."""
    full = (sheet == level).all(-1)
    top = int(np.flatnonzero(full.sum(1) >= SIDE)[0])  # text has greys as well, but no line of it has so many
    square = full[top:top + SIDE].all(0)
    assert square.sum() == SIDE
    return top, int(np.flatnonzero(square)[0])


def test_each_picture_stands_in_its_row_and_column(uri):
    sheet = figure(uri, report.read_sweep(uri, "study", "two"), side=SIDE)
    assert sheet.dtype == np.uint8 and sheet.shape[2] == 3
    found = {corner(sheet, level): level for level in (100, 101, 102, 103, 112, 120, 121, 122, 123, 132, 133)}
    rows = sorted({top for top, _ in found})
    columns = sorted({left for _, left in found})
    assert len(rows) == 3 and len(columns) == 4
    assert [[found.get((top, left)) for left in columns] for top in rows] == [
        [100, 101, 120, 121], [102, 103, 122, 123], [112, None, 132, 133]]
