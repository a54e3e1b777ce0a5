"""The figure of a sweep and its words: nothing runs into anything else, and nothing is said twice."""

from functools import partial
from itertools import combinations

import numpy as np
import pytest
from PIL import Image
from studies_helpers import keep_sweep

from fractal_exp import tracking
from fractal_exp.studies import report
from fractal_exp.studies.report_figure import Pair, figure, font_for, layout, line_height

SIDE = 96
LONG = "no_multisampling_and_no_annealing, sigma 2.5, with a perceptual distance of its own and 20 maps"
NAMES = {
    "short": (["fractal 0", "fractal 1"], ["full", "naive"]),
    "long": (["a-picture-with-a-very-long-file-name-2026-11-23", "fractal 1 of another suite"], [LONG, "x" * 80]),
}


def boxes(samples, rows, title="Ablations, laptop scale"):
    """The size of a sheet, and the boxes (left, top, right, bottom) of its texts and its pictures."""
    pictures = tuple(Image.new("L", (8, 8)) for _ in range(2))
    pairs = [(row, [Pair(pictures, "F1 0.123")] * len(samples)) for row in rows]
    size, labels, places = layout(title, samples, [("target", [Pair(pictures, "")] * len(samples)), *pairs], SIDE)
    font = font_for(SIDE)
    texts = [(label.text, (label.x, label.y, label.x + font.getlength(label.text), label.y + line_height(font)))
             for label in labels]
    return size, texts, [(x, y, x + SIDE, y + SIDE) for _, x, y in places]


def apart(a, b):
    return a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]


@pytest.mark.parametrize("names", NAMES)
def test_no_text_runs_into_another_or_into_a_picture_or_off_the_sheet(names):
    (width, height), texts, pictures = boxes(*NAMES[names])
    assert len(pictures) == 3 * 4
    for (one, a), (other, b) in combinations(texts, 2):
        assert apart(a, b), f"{one!r} and {other!r}"
    for text, a in texts:
        assert 0 <= a[0] and 0 <= a[1] and a[2] <= width and a[3] <= height, text
        for b in pictures:
            assert apart(a, b), text
    assert all(apart(a, b) for a, b in combinations(pictures, 2))


def drawn(jobs, run, number, row):
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
        keep_sweep(uri, folder, name, jobs, partial(drawn, jobs))
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
