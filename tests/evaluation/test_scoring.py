"""Evaluation from codes to tables: ceilings, trivial rows, alignment, caches, summaries."""

import math

import numpy as np
import pandas as pd
import pytest
import torch

from fractal_exp import IFS, InputError, codes
from fractal_exp.evaluation import Perceptual, evaluate, summarize
from fractal_exp.evaluation.scoring import TRIVIAL
from fractal_exp.evaluation.summary import describe
from fractal_exp.ifs import attractor
from fractal_exp.suite import random_suite

SMALL = {"resolution": 64, "points_in_view": 300_000, "supersample": 4}
COLUMNS = ["view", "zoom", "center_x", "center_y", "empty", "f1", "iou", "psnr", "ssim", "lpips"]


def test_a_code_against_itself_is_at_the_ceiling_but_not_above():
    table = evaluate(codes.known("fern"), codes.known("fern"), **SMALL)
    assert list(table.columns) == COLUMNS and len(table) == 7
    assert table.f1.mean() > 0.98 and table.ssim.mean() > 0.9
    assert table.psnr[0] < 60  # other points: no pixel-perfect copy
    assert table.lpips.isna().all() and table.attrs["perceptual_absent"]


def test_alignment_by_the_attractors_box_or_not_at_all():
    fern = attractor.normalize(codes.known("fern"))
    moved = fern.similar(0.5, (0.3, -0.2))
    assert evaluate(moved, fern, **SMALL).f1.mean() > 0.97
    assert evaluate(moved, fern, **SMALL, align="none").f1.mean() < 0.6
    assert evaluate(fern, fern, **SMALL, align="none").f1.mean() > 0.97


def test_trivial_rows():
    square = IFS(torch.eye(2).expand(4, 2, 2) / 2, torch.tensor([[-1.0, -1], [-1, 1], [1, -1], [1, 1]]) / 4)
    sparse = SMALL | {"points_in_view": 60_000}
    white, black = (evaluate(TRIVIAL[name], square, **sparse) for name in ("all white", "all black"))
    # The square fills the whole view's inner crop: a part is lit with q = 1 - exp(-rho), a pixel is the mean of 16.
    q = 1 - math.exp(-60_000 / (64 * 64 * 16 * 0.75**2))
    assert white.f1[0] == pytest.approx(1, abs=1e-3)
    assert white.psnr[0] == pytest.approx(-10 * math.log10((1 - q) ** 2 + q * (1 - q) / 16), abs=0.1)
    assert black.psnr[0] == pytest.approx(-10 * math.log10(q**2 + q * (1 - q) / 16), abs=0.1)
    assert black.f1[0] == 0 and black.iou[0] == 0
    point = IFS(torch.eye(2)[None] / 2, torch.tensor([[0.0, 0.0]]))  # many views do not hold it: both are empty
    black, white = (evaluate(TRIVIAL[name], point, **SMALL, views="uniform") for name in ("all black", "all white"))
    assert black.f1[~black["empty"]].eq(0).all() and 0 < black["empty"].sum() < 7
    assert not white["empty"].any() and white.f1.lt(0.1).all(), "white on an empty truth is wrong, and counts"


class Ring:
    """A reconstruction that is no code and keeps what it was asked for."""

    def __init__(self):
        self.asked = []

    def render(self, view, *, resolution, points_in_view, supersample, seed):
        self.asked.append((view, points_in_view, seed))
        return torch.zeros(resolution, resolution)


def test_whatever_renders_is_accepted_as_reconstruction_and_as_truth():
    ring = Ring()
    table = evaluate(ring, codes.known("fern"), **SMALL)
    assert len(ring.asked) == 7 and table.f1.max() <= 1
    assert [view.zoom for view, *_ in ring.asked] == table.zoom.tolist()
    assert evaluate(TRIVIAL["all white"], ring, **SMALL, seed=3, views="uniform").f1.eq(0).all()
    with pytest.raises(InputError, match="needs seed"):
        evaluate(codes.known("fern"), ring, **SMALL)
    with pytest.raises(InputError, match="not a code; take views=released or views=uniform"):
        evaluate(codes.known("fern"), ring, **SMALL, seed=3)


def test_the_cache_changes_nothing_and_is_used(tmp_path):
    fern, other = codes.known("fern"), random_suite(1)[0]
    plain = evaluate(other, fern, **SMALL)
    folder = tmp_path / "truth"
    pd.testing.assert_frame_equal(evaluate(other, fern, **SMALL, cache=folder), plain)
    pd.testing.assert_frame_equal(evaluate(other, fern, **SMALL, cache=folder), plain)
    files = [*folder.glob("*.npz")]
    assert len(files) == 7, "of the truth alone"
    for file in files:
        np.savez(file, lit=np.zeros((64, 64), np.uint16))
    assert evaluate(other, fern, **SMALL, cache=folder).f1.eq(0).all(), "they are read"
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="image cache"):
        evaluate(other, fern, **SMALL, cache=tmp_path / "file")


class Mean:
    def __call__(self, a, b):
        return (a - b).abs().mean((-2, -1))


@pytest.mark.parametrize(("name", "column"), [("lpips_alex", "lpips"), ("fractal", "fractal_distance")])
def test_a_perceptual_distance_stands_under_its_own_name(name, column):
    table = evaluate(TRIVIAL["all white"], codes.known("fern"), **SMALL, perceptual=Perceptual(name, Mean()))
    assert table[column].between(0.1, 1).all() and table.attrs["perceptual"] == name
    assert table.attrs["perceptual_absent"] is None
    assert ("fractal_distance" in table) == table.lpips.isna().all() == (name == "fractal")
    assert "fractal" not in table, "the name of the fractal, in tables of several"


def test_lpips_without_weights_is_absent_and_says_why(monkeypatch):
    from fractal_exp.perceptual import distances as perceptual

    def fail(*_):
        raise perceptual.WeightsUnavailable("no weights for lpips_alex here")

    monkeypatch.setitem(perceptual.LOADERS, "lpips_alex", fail)
    table = evaluate(codes.known("fern"), codes.known("fern"), **SMALL, perceptual="lpips_alex")
    assert table.lpips.isna().all() and "no weights" in table.attrs["perceptual_absent"]
    summary = summarize(table)
    assert summary[summary.metric == "lpips"]["mean"].isna().all() and "absent" in describe(summary)


def tables(count: int = 12, seed: int = 0) -> pd.DataFrame:
    rng, rows = np.random.default_rng(seed), []
    for fractal in range(count):
        level = rng.uniform(0.5, 1)
        for view, zoom in (("whole", 1), ("1-2x-a", 1.5), ("2-4x-a", 3), ("4-8x-a", 7)):
            f1 = level - 0.01 * zoom
            rows.append({"fractal": fractal, "view": view, "zoom": zoom, "f1": f1, "psnr": 10 * f1, "lpips": np.nan})
    return pd.DataFrame(rows)


def test_summaries_average_over_views_and_bootstrap_over_fractals():
    table = tables()
    summary = summarize(table).set_index(["zoom_class", "metric"])
    row = summary.loc[("all", "f1")]
    per_fractal = table.groupby("fractal").f1.mean()
    assert row["mean"] == pytest.approx(table.f1.mean()) and row["std"] == pytest.approx(per_fractal.std())
    assert row["views"] == 48 and row["fractals"] == 12
    # The interval of a mean is about ± 1.96 standard errors.
    half = 1.96 * per_fractal.std() / math.sqrt(12)
    assert row["high"] - row["low"] == pytest.approx(2 * half, rel=0.15)
    assert row["low"] < row["mean"] < row["high"]
    assert summary.loc[("4-8x", "f1"), "mean"] == pytest.approx(table[table.zoom == 7].f1.mean())
    repeated = pd.concat([part for _, part in table.groupby("fractal")])
    repeated.index = [0, 1, 2, 3] * 12  # as when tables of `evaluate` are laid one after another
    pd.testing.assert_frame_equal(summarize(repeated), summarize(table))
    assert list(summary.index.get_level_values(0).unique()) == ["all", "whole", "1-2x", "2-4x", "4-8x"]
    pd.testing.assert_frame_equal(summarize(table), summarize(table))


@pytest.mark.parametrize(("arguments", "message"), [
    ({"align": "left"}, "bbox, none"), ({"views": "all"}, "attractor, released, uniform"),
    ({"resolution": 0}, "resolution"),
    ({"resolution": 12}, "SSIM needs pictures of at least 13 px a side, got 12; raise resolution"),
    ({"perceptual": "vision"}, "no perceptual distance 'vision'"),
])
def test_what_cannot_be_evaluated(arguments, message):
    with pytest.raises(InputError, match=message):
        evaluate(codes.known("fern"), codes.known("fern"), **(SMALL | arguments))


class Half:
    """A picture whose views beyond twice are black."""

    def render(self, view, *, resolution, **_):
        return torch.full((resolution, resolution), float(view.zoom <= 2))


def test_pairs_of_empty_views_are_marked_and_left_out():
    half, size = Half(), SMALL | {"views": "released", "seed": 3}
    table = evaluate(half, half, **size)
    assert table["empty"].tolist() == [False] * 3 + [True] * 4
    assert table[["f1", "iou", "psnr", "ssim"]].isna().all(axis=1).equals(table["empty"])
    assert table.f1[:3].eq(1).all() and table.f1.mean() == 1 and table.psnr.mean() == 100
    black, white = (evaluate(TRIVIAL[name], half, **size) for name in ("all black", "all white"))
    assert black["empty"].equals(table["empty"]) and black.f1.mean() == 0 == black.psnr.mean()
    assert not white["empty"].any() and white.f1.mean() == pytest.approx(3 / 7)
    distance = evaluate(half, half, **size, perceptual=Perceptual("fractal", Mean())).fractal_distance
    assert distance.isna().equals(table["empty"])
