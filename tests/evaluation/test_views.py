"""The views of a fractal: the same for every method, on the canvas, and spread as the protocol says."""

import numpy as np
import pytest

from fractal_exp import View, codes, ops
from fractal_exp.errors import InputError
from fractal_exp.evaluation.views import evaluation_views, zoom_class
from fractal_exp.ifs import attractor
from fractal_exp.suite import random_suite

KINDS = ("attractor", "released", "uniform")


@pytest.mark.parametrize("kind", KINDS)
def test_seven_views_the_first_whole(kind):
    views = evaluation_views(random_suite(1)[0], kind, seed=3)
    assert list(views) == ["whole", "1-2x-a", "1-2x-b", "2-4x-a", "2-4x-b", "4-8x-a", "4-8x-b"]
    assert views["whole"] == View()
    for name, view in views.items():
        assert name.startswith(zoom_class(view.zoom))


@pytest.mark.parametrize("kind", KINDS[1:])
def test_windows_stay_on_the_canvas_and_fill_their_reach(kind):
    reaches, zooms = [], []
    for seed in range(300):
        for view in list(evaluation_views(None, kind, seed=seed).values())[1:]:
            assert all(-1 - 1e-12 <= side <= 1 + 1e-12 for side in view.box)
            reach = (1 - 1 / view.zoom) / (1 if kind == "uniform" else view.zoom)
            reaches.extend(c / reach for c in view.center)
            zooms.append(view.zoom)
    assert -1 <= min(reaches) < -0.99 and 0.99 < max(reaches) <= 1 + 1e-9
    assert abs(np.mean(reaches)) < 0.03 and np.var(reaches) == pytest.approx(1 / 3, rel=0.05)
    zooms = np.reshape(zooms, (300, 3, 2))
    for i, (low, high) in enumerate(((1, 2), (2, 4), (4, 8))):
        assert low <= zooms[:, i].min() and zooms[:, i].max() <= high
        assert zooms[:, i].mean() == pytest.approx((low + high) / 2, rel=0.03)


def test_views_are_pinned():
    view = evaluation_views(None, "uniform", seed=0)["4-8x-b"]
    assert (*view.center, view.zoom) == pytest.approx((0.5718998061443388, 0.06528920695491096, 4.702622482410236),
                                                      rel=1e-12)
    assert evaluation_views(None, "uniform", seed=1)["4-8x-b"].zoom != view.zoom


def test_what_is_not_a_kind_of_views():
    code = random_suite(1)[0]
    with pytest.raises(InputError, match="attractor, released, uniform"):
        evaluation_views(code, "mine")
    with pytest.raises(InputError, match="at least 0"):
        evaluation_views(code, seed=-1)
    with pytest.raises(InputError, match="needs seed"):
        evaluation_views(None, "uniform")
    with pytest.raises(InputError, match="take views=released or views=uniform"):
        evaluation_views(None, "attractor", seed=1)


def test_attractor_views_are_centred_by_the_invariant_measure():
    carpet = codes.known("sierpinski_carpet")  # eight cells about a hole, all of one measure
    centers = np.array([view.center for seed in range(150)
                        for name, view in evaluation_views(carpet, seed=seed).items() if name != "whole"])
    cells = np.floor((centers / 1.5 + 0.5) * 3 - 1e-9).clip(0, 2).astype(int)
    counts = np.bincount(3 * cells[:, 1] + cells[:, 0], minlength=9)
    assert counts[4] == 0, "never in the hole"
    expected = len(centers) / 8
    chi_square = float(((np.delete(counts, 4) - expected) ** 2 / expected).sum())
    assert chi_square < 24.3  # 99.9% of 7 degrees of freedom


@pytest.mark.slow
def test_no_attractor_view_of_the_suite_is_empty_inside_its_crop():
    for code in random_suite():
        framed = attractor.normalize(code)
        x = ops.chaos_game(framed.linear, framed.offset, trajectories=2000, length=80, warmup=40, seed=1,
                           probabilities=framed.sampling_probabilities()).double().numpy()
        for name, view in evaluation_views(code).items():
            inside = (np.abs(x - view.center) < 0.75 / view.zoom).all(1).mean()
            # Hundreds of points even where a view is drawn with as few as 20 000.
            assert inside > 1e-3, (code.meta["name"], name)
